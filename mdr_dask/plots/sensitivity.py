"""The figure of Sobol indices with intervals."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mdr_dask.plots import colours
from mdr_dask.plots.figure import Axis, Figure, Mean, Panel, Trace, columns

NAMES = {"first": "first order: alone", "total": "total: with interactions"}


def sensitivity(indices: xr.Dataset) -> Figure:
    """Draw the Sobol indices of every input. `mdr_dask.fits.sensitivity` computes these indices."""
    inputs = [str(name) for name in indices["parameter"].to_numpy()]
    ticks = [(float(k), name.replace("_", " ")) for k, name in enumerate(inputs)]
    y = Axis("", ticks=ticks, low=-0.5, high=len(inputs) - 0.5, reverse=True)
    panel = Panel(Axis("share of the variance"), y)
    for k, kind in enumerate(NAMES):
        row = np.arange(len(inputs)) + (k - 0.5) / 3  # thirds of a row
        share = Mean(indices[kind], indices[f"{kind}_low"], indices[f"{kind}_high"])
        points = columns(indices[[kind]], x=share, y=row)
        panel.traces.append(Trace("curve", points, kind, NAMES[kind], colours.colour(k), "", colours.MARKERS[k]))
    zero = columns(x=np.zeros(2), y=np.array([-0.5, len(inputs) - 0.5]))
    panel.traces.append(Trace("law", zero, "zero", "", "#808080", ":"))
    cases, realisations = indices.attrs["cases"], indices.attrs["realisations"]
    subject = f"{str(indices.attrs['output']).replace('_', ' ')}: Sobol indices"
    about = f"{cases} cases, {realisations} realisations; bars: 95 % intervals"
    figure = Figure([panel], subject, bars=about, ratio=min(1.5, 0.2 + 0.1 * len(inputs)))
    if indices.attrs["left_out"]:
        figure.leave_out([f"{indices.attrs['left_out']} cases without a value"])
    return figure
