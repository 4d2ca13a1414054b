"""The models by name; each is imported only when a campaign names it."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from mdr_dask.models.base import Model

NAMES: tuple[str, ...] = (
    "sliding_friction",
    "velocity_jump",
    "fretting_wear",
    "ehl_line",
    "mixed_lubrication",
)


def load(name: str) -> Model[Any]:
    """Return the model of that name.

    Parameters
    ----------
    name : str
        One of `NAMES`; the module ``mdr_dask.models.<name>`` holds it as ``MODEL``.

    Raises
    ------
    KeyError
        If there is no such model.
    """
    if name not in NAMES:
        raise KeyError(name)
    model: Model[Any] = import_module(f"mdr_dask.models.{name}").MODEL
    return model
