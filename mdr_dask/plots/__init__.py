"""Figures drawn from a store."""

from __future__ import annotations

from importlib import import_module

from mdr_dask.plots.base import Plot

#: Modules of this room that hold ``PLOTS``.
SUBJECTS: tuple[str, ...] = ("ehl", "friction", "kinetics", "master_curve", "mixed", "protocols", "wear")


def available(model: str) -> dict[str, Plot]:
    """Return the figures that can be drawn from the stores of a model, by name."""
    plots = (plot for subject in SUBJECTS for plot in import_module(f"mdr_dask.plots.{subject}").PLOTS)
    return {plot.name: plot for plot in plots if model in plot.models}
