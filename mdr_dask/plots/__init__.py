"""Figures drawn from a store.

A figure is first described as data (module `figure`), and then drawn with matplotlib (module `render`).
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import entry_points
from itertools import chain
from typing import TYPE_CHECKING

from mdr_dask import models
from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    import xarray as xr

#: Modules of this package that have a tuple ``PLOTS``.
SUBJECTS = ("named", "history", "calibration", "measured", "master_curve")

#: Entry point group in which other packages offer tuples of `Plot`.
GROUP = "mdr_dask.plots"


def available(model: str) -> dict[str, Plot]:
    """Return the figures of a model, indexed by name, including the figures of other packages (see `GROUP`)."""
    own = (import_module(f"mdr_dask.plots.{module}").PLOTS for module in SUBJECTS)
    every = chain(*own, models.offered(entry_points(group=GROUP)))
    name = models.registered_name(model)
    return {plot.name: plot for plot in every if name in plot.models or not plot.models}


def figures_of(model: str, groups: Mapping[str, xr.Dataset]) -> dict[str, Plot]:
    """Return the figures of a model, indexed by name.

    A model without its own figures also gets one figure for each output that varies and has one value for each result.
    """
    from mdr_dask.plots.view import figure_of, varied

    known = available(model)
    if any(plot.models for plot in known.values()):
        return known
    outputs = {str(name): data for data in groups.values() for name in data.data_vars if name != "status"}
    drawn = [name for name, data in outputs.items() if set(data[name].dims) <= set(data["status"].dims)]
    drawn = [name for name in drawn if varied(outputs[name], name)]
    return {name: figure_of(groups, name) for name in drawn} | known
