"""What a fit is: data about a law and one function from the series of a store to its constants."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import xarray as xr


@dataclass(frozen=True)
class Fit:
    """A law that can be fitted to a store.

    Parameters
    ----------
    name : str
        As in ``mdr-dask fit STORE NAME``.
    models : tuple of str
        Models whose stores it understands.
    summary : str
        One line with the law itself.
    compute : callable, mapping of str to Dataset -> Dataset
        Takes the groups of a store by series name (``""`` without series), each with dimensions (axes..., realisation,
        ...) and every scalar parameter as a coordinate, varied or not. Returns one variable for every constant, over
        whatever it varies with, beside ``<name>_low`` and ``<name>_high`` (95 % interval) and measures of the goodness
        of fit; units in attrs.
    """

    name: str
    models: tuple[str, ...]
    summary: str
    compute: Callable[[Mapping[str, xr.Dataset]], xr.Dataset]
