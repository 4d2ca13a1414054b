"""What a fit is: data about a law, one function from the series of a store to its constants, and whether the law holds.

Every result has a variable ``law_holds``, a sentence that begins with *yes*, *no* or *not tested*. A law that does not
hold gets no narrow interval: what it misses goes into the interval as an error of every case (`fitted`), or the ends
are NaN and the sentence is the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.campaign import Campaign
from mdr_dask.errors import FitError, distinguishable

#: Departure of a law, rms and half of the largest, that counts as none: laws of friction are not meant to hold better.
WITHIN = 0.05
#: Probability of the departure by scatter and errors alone, below which the law is doubted.
DOUBTFUL = 0.05


@dataclass(frozen=True)
class Fit:
    """A law that can be fitted to a store.

    Parameters
    ----------
    name : str
        As in ``mdr-dask fit STORE NAME``.
    models : tuple of str
        Models whose stores it understands; none stands for all models.
    summary : str
        One line with the law itself.
    compute : callable, mapping of str to Dataset -> Dataset
        Takes the groups of a store by series name (``""`` without series), each with dimensions (axes..., realisation,
        ...) and every scalar parameter as a coordinate, varied or not. Returns one variable for every constant, over
        whatever it varies with, beside ``<name>_low`` and ``<name>_high`` (95 % interval), measures of the goodness
        of fit, and ``law_holds``; units in attrs.
    apart : bool
        Whether each series of a store is fitted for itself, with a mapping of that one series only.
    constants : tuple of str, or callable, Campaign -> tuple of str
        Constants with an interval that realisations may go on for (``until: {name.constant: 1 %}``).
    """

    name: str
    models: tuple[str, ...]
    summary: str
    compute: Callable[[Mapping[str, xr.Dataset]], xr.Dataset]
    apart: bool = False
    constants: tuple[str, ...] | Callable[[Campaign], tuple[str, ...]] = ()

    def constants_of(self, campaign: Campaign) -> tuple[str, ...]:
        """Return the constants that realisations of a campaign may go on for."""
        return self.constants(campaign) if callable(self.constants) else self.constants

    def results(self, groups: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
        """Fit a store: one result for each series that has the data for it, or one for all series together.

        Raises
        ------
        FitError
            If no series has the data; each one's reason is given.
        """
        if not self.apart:
            return {"": _judged(self.compute(groups))}
        found, reasons = {}, []
        for name, dataset in groups.items():
            try:
                found[name] = _judged(self.compute({name: dataset}))
            except FitError as error:
                reasons.append(f"{name}: {error}" if name else str(error))
        if not found:
            raise FitError("; ".join(dict.fromkeys(reasons)))
        return found


def require(data: xr.Dataset, *names: str) -> None:
    """Raise FitError where a study lacks parameters of a Kelvin body on a generated line that a law is written in."""
    missing = [name for name in names if name not in data.variables]
    if missing:
        raise FitError(
            f"the law holds for a Kelvin body on a generated line: expected {', '.join(names)},"
            f" got a study without {', '.join(missing)}"
        )


LAW_HOLDS = {"units": "1", "long_name": "whether the law holds"}


def _judged(result: xr.Dataset) -> xr.Dataset:
    """Return a result that says whether its law holds, at the end of its variables."""
    sentence = result.get("law_holds", xr.DataArray("not tested: this fit compares no law with its data"))
    return result.drop_vars("law_holds", errors="ignore").assign(law_holds=sentence.assign_attrs(LAW_HOLDS))


class Fitted(NamedTuple):
    """A law fitted to a stack.

    Attributes
    ----------
    constants : array, shape (1 + RESAMPLES + 2 groups, p)
        Stack of the constants, for `mdr_dask.bootstrap.interval`.
    departures : array, shape (...)
        Data less law.
    chance : float
        How often scatter and errors alone leave as much; NaN where too few realisations know the scatter.
    """

    constants: FloatArray
    departures: FloatArray
    chance: float


def fitted(
    fit: Callable[[FloatArray], FloatArray],
    left: Callable[[FloatArray, FloatArray], FloatArray],
    data: FloatArray,
    count: int,
) -> Fitted:
    """Fit a law; where scatter and errors do not explain its departures, they become an error of every case.

    Parameters
    ----------
    fit : callable
        From data, shape (rows, ...), to constants, shape (rows, p).
    left : callable
        From data and constants to what the law leaves of the data.
    data : array, shape (1 + RESAMPLES + 2 groups, ...)
        Stack of the data.
    count : int
        Realisations that were resampled.
    """
    constants = fit(data)
    residuals = left(data, constants)
    probability = bootstrap.chance(residuals, count)
    if not probability >= DOUBTFUL:
        constants = np.concatenate([constants, fit(bootstrap.moved(data[0], residuals[0]))])
    return Fitted(constants, residuals[0], probability)


def law_holds(
    departures: FloatArray, chance: float, constants: int = 0, where: str = "", within: float = WITHIN
) -> str:
    """Say in words whether a law holds.

    Parameters
    ----------
    departures : array
        Relative departures of the data from the law.
    chance : float
        As in `Fitted`.
    constants : int
        Number of constants fitted to these data.
    where : str
        Where the largest departure lies.
    within : float
        Departure that counts as none: rms, and half of the largest.
    """
    if departures.size <= constants:
        return f"not tested: {departures.size} cases for {constants} constants leave nothing to compare"
    rms, largest = np.sqrt(np.mean(departures**2)), np.max(np.abs(departures))
    (mean, of_mean), (most, of_most) = (
        distinguishable(rms, within, digits=2),
        distinguishable(largest, 2 * within, digits=2),
    )
    departs = f"departs by {mean} rms, at most {most}{f' at {where}' if where else ''}"
    if max(rms, largest / 2) <= within:
        return f"yes: {departs}, within {of_mean} and {of_most}"
    if np.isnan(chance):
        return f"not tested: too few realisations to know the scatter; {departs}"
    if chance >= DOUBTFUL:
        return f"yes: {departs}, which the scatter explains (probability {chance:.2g})"
    likely = f"{chance:.2g}" if chance else f"below {1 / bootstrap.RESAMPLES:g}"
    return f"no: {departs}; by scatter alone with probability {likely}"
