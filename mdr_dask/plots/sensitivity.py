"""Sobol indices as bars with their intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mdr_dask.plots import drawing, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def sensitivity(indices: xr.Dataset) -> Figure:
    """Draw what `mdr_dask.fits.sensitivity.sobol_indices` found: a bar for every index of every input."""
    from matplotlib.figure import Figure

    inputs = [style.quantity(str(name)).symbol for name in indices["parameter"].to_numpy()]
    kinds = [kind for kind in ("first", "total") if indices[kind].notnull().any()]
    figure = Figure(figsize=(drawing.PANEL[0], 1.6 + 0.5 * len(inputs)), layout="constrained")
    axes = figure.subplots()
    for k, kind in enumerate(kinds):
        value = indices[kind].to_numpy()
        ends = np.array([value - indices[f"{kind}_low"], indices[f"{kind}_high"] - value])
        at = np.arange(len(inputs)) + 0.38 * (k - (len(kinds) - 1) / 2)
        axes.barh(at, value, 0.36, color=style.COLOURS[k], label=_LABELS[kind], alpha=0.85)
        axes.errorbar(value, at, xerr=ends, fmt="none", ecolor="black", capsize=3, gid=style.DATA)
    axes.set_yticks(np.arange(len(inputs)), inputs)
    axes.invert_yaxis()
    axes.axvline(0, color="black", linewidth=0.8)
    axes.set_xlabel("share of the variance")
    axes.legend(fontsize="small")
    output = str(indices.attrs["output"]).replace("_", " ")
    cases, count = indices.attrs["cases"], indices.attrs["realisations"]
    axes.set_title(
        f"{output}: Sobol indices\n{cases} cases, {count} realisations; bars: 95 % intervals", fontsize="medium"
    )
    return figure


_LABELS = {"first": "first order: alone", "total": "total: with interactions"}
