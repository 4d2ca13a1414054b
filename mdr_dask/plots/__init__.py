"""Figures drawn from a store.

A figure is first described as data (`figure`). `view` makes this description for any output against parameters, from
the series of a store; `named` makes it for the figures that have a name. The description is then drawn with matplotlib
(`render`), or in a browser on the page of `mdr_dask.report`.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points

from mdr_dask.plots.base import Plot

#: Modules of this package that have a tuple ``PLOTS``.
SUBJECTS = ("named", "history", "calibration", "master_curve")

#: Entry point group in which other packages offer tuples of `Plot`.
GROUP = "mdr_dask.plots"


def available(model: str) -> dict[str, Plot]:
    """Return the figures for stores of a model, by name, including those that other packages offer in `GROUP`."""
    own = (import_module(f"mdr_dask.plots.{module}").PLOTS for module in SUBJECTS)
    others = (entry.load() for entry in entry_points(group=GROUP))
    return {plot.name: plot for plots in (*own, *others) for plot in plots if model in plot.models or not plot.models}
