"""Figures drawn from a store."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points

from mdr_dask.plots.base import Plot

#: Modules of this room that hold ``PLOTS``.
SUBJECTS: tuple[str, ...] = (
    *("calibration", "contact", "ehl", "friction", "kinetics", "master_curve", "mixed", "protocols", "scaling", "wear"),
)

#: Entry point group in which other packages offer tuples of `Plot`.
GROUP = "mdr_dask.plots"


def available(model: str) -> dict[str, Plot]:
    """Return the figures for stores of a model, by name; other packages offer tuples of them in `GROUP`."""
    own = (import_module(f"mdr_dask.plots.{subject}").PLOTS for subject in SUBJECTS)
    others = (entry.load() for entry in entry_points(group=GROUP))
    return {plot.name: plot for plots in (*own, *others) for plot in plots if model in plot.models or not plot.models}
