"""Sobol indices as bars with their intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mdr_dask.plots import drawing, style
from mdr_dask.plots.drawing import Mean

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LABELS = {"first": "first order: alone", "total": "total: with interactions"}
#: Thickness of a bar, and how far those of one input lie apart, of a row.
THICK, APART = 0.36, 0.38


def sensitivity(indices: xr.Dataset) -> Figure:
    """Draw what `mdr_dask.fits.sensitivity.sobol_indices` found: a bar for every index of every input."""
    inputs = [style.quantity(str(name)).symbol for name in indices["parameter"].to_numpy()]
    kinds = [kind for kind in ("first", "total") if indices[kind].notnull().any()]
    figure, (axes,) = drawing.panels(1, size=(drawing.PANEL[0], 1.6 + 0.5 * len(inputs)))
    for k, kind in enumerate(kinds):
        place = xr.zeros_like(indices[kind]) + np.arange(len(inputs)) + APART * (k - (len(kinds) - 1) / 2)
        unknown = xr.full_like(place, np.nan)
        axes.barh(place, indices[kind], THICK, color=style.colour(k), label=LABELS[kind], alpha=0.85)
        along = Mean(indices[kind], indices[f"{kind}_low"], indices[f"{kind}_high"])
        drawing.points(axes, indices[kind], Mean(place, unknown, unknown), "black", "|", kind, along)
    axes.set_yticks(np.arange(len(inputs)), inputs)
    axes.invert_yaxis()
    axes.axvline(0, color="black", linewidth=0.8)
    axes.set_xlabel("share of the variance")
    handles, labels = axes.get_legend_handles_labels()
    bars = [(handle, label) for handle, label in zip(handles, labels, strict=True) if label in LABELS.values()]
    axes.legend(*zip(*bars, strict=True), fontsize="small")
    about = f"{indices.attrs['cases']} cases, {indices.attrs['realisations']} realisations; bars: 95 % intervals"
    style.title(figure, f"{str(indices.attrs['output']).replace('_', ' ')}: Sobol indices", about)
    return figure
