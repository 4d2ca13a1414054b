"""What a fit is: data about a law and one function from the series of a store to its constants."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import xarray as xr

from mdr_dask.errors import FitError


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
    apart : bool
        Whether each series of a store is fitted for itself, with a mapping of that one series only.
    """

    name: str
    models: tuple[str, ...]
    summary: str
    compute: Callable[[Mapping[str, xr.Dataset]], xr.Dataset]
    apart: bool = False

    def results(self, groups: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
        """Fit a store: one result for each series that has the data for it, or one for all series together.

        Raises
        ------
        FitError
            If no series has the data; each one's reason is given.
        """
        if not self.apart:
            return {"": self.compute(groups)}
        found, reasons = {}, []
        for name, dataset in groups.items():
            try:
                found[name] = self.compute({name: dataset})
            except FitError as error:
                reasons.append(f"{name}: {error}" if name else str(error))
        if not found:
            raise FitError("; ".join(dict.fromkeys(reasons)))
        return found
