"""A distributed parameter-study runner for tribology with the method of dimensionality reduction.

Each public name is imported at its first use, so that importing the package is quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mdr_dask.version import __version__

_HOMES = {
    "Resources": ("mdr_dask.execute", "Resources"),
    "aggregate": ("mdr_dask.studies", "aggregate"),
    "check": ("mdr_dask.studies", "check"),
    "fit": ("mdr_dask.studies", "fit"),
    "master_curve": ("mdr_dask.studies", "master_curve"),
    "open": ("mdr_dask.studies", "open_study"),
    "plot": ("mdr_dask.studies", "plot"),
    "read": ("mdr_dask.studies", "read"),
    "run": ("mdr_dask.studies", "run"),
    "table": ("mdr_dask.studies", "table"),
}

if TYPE_CHECKING:
    from mdr_dask.execute import Resources
    from mdr_dask.studies import aggregate, check, fit, master_curve, plot, read, run, table
    from mdr_dask.studies import open_study as open  # noqa: A004

__all__ = [
    "Resources",
    "__version__",
    "aggregate",
    "check",
    "fit",
    "master_curve",
    "open",
    "plot",
    "read",
    "run",
    "table",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, attribute = _HOMES[name]
    return getattr(import_module(module), attribute)
