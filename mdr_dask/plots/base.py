"""What a figure is: data about it and one function from the series of a store to a matplotlib Figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import xarray as xr

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Plot:
    """A figure that can be drawn from a store.

    Parameters
    ----------
    name : str
        As in ``mdr-dask plot STORE NAME``.
    models : tuple of str
        Models whose stores it understands.
    summary : str
        One line: what is over what, and the figure of the thesis it redraws.
    draw : callable, mapping of str to Dataset -> Figure
        Takes the groups of a store as :class:`mdr_dask.fit.base.Fit` does. Axes carry units; bands carry the
        standard error or interval and say which.
    """

    name: str
    models: tuple[str, ...]
    summary: str
    draw: Callable[[Mapping[str, xr.Dataset]], Figure]
