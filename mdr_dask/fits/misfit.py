"""Whether measured points contradict a model: chi squared where errors are known, else a trend of the residuals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as fisher

from mdr_dask.arrays import FloatArray
from mdr_dask.fits.base import DOUBTFUL, WITHIN

#: Probability of a trend of the residuals by chance, below which the model is doubted.
TREND = 0.005
#: Fewest points whose residuals can show a trend.
FEWEST = 6


class Residuals(NamedTuple):
    """What the best prediction leaves.

    Attributes
    ----------
    scaled : array, shape (points,)
        Measured less predicted, over the standard deviation of both.
    relative : float
        Root mean square of measured less predicted, over that of the whole.
    chi_squared : float
        With the correlations of the errors; NaN where the errors of measurement are unknown.
    freedom : int
        Points less directions that are determined.
    """

    scaled: FloatArray
    relative: float
    chi_squared: float
    freedom: int

    @property
    def chance(self) -> float:
        """How often errors alone leave as much; NaN where they are unknown."""
        return float(chi2.sf(self.chi_squared, self.freedom)) if self.freedom > 0 else np.nan


def law_holds(residuals: Residuals, conditions: Mapping[str, FloatArray], whole: str = "the measured values") -> str:
    """Say in words whether the model explains the points; residuals are told as shares of the whole."""
    told = f"residuals of {residuals.relative:.2g} of {whole}, rms"
    if residuals.freedom < 1:
        return "not tested: as many constants as points leave nothing to compare"
    if np.isfinite(residuals.chi_squared):
        compared = f"{told}, chi squared {residuals.chi_squared:.3g} of {residuals.freedom}"
        known = f"{compared} (probability {residuals.chance:.2g})"
        return (
            f"yes: the errors explain {known}"
            if residuals.chance >= DOUBTFUL
            else f"no: the errors do not explain {known}"
        )
    if residuals.scaled.size < FEWEST:
        return f"not tested: {residuals.scaled.size} points without errors of their own leave too little; {told}"
    probability, along = trend(residuals.scaled, conditions)
    if probability < TREND and residuals.relative > WITHIN:
        return f"no: {told}, follow a trend along {along} (by chance with probability {probability:.1g})"
    return f"yes: {told}, follow no trend (probability {probability:.2g})" if probability >= TREND else f"yes: {told}"


def trend(scaled: FloatArray, conditions: Mapping[str, FloatArray]) -> tuple[float, str]:
    """Return how often chance alone makes residuals follow a parabola along a condition so well, and which one.

    The condition is taken by rank; the probability is that of the worst of all conditions.
    """
    worst, along = 1.0, ""
    for name, values in conditions.items():
        if np.unique(values).size < 4:
            continue
        rank = np.searchsorted(np.unique(values), values)
        terms = np.vander(rank / rank.max() - 0.5, 3)
        left = scaled - terms @ np.linalg.lstsq(terms, scaled)[0]
        spare = scaled.size - 3
        share = (np.sum(scaled**2) - np.sum(left**2)) / 2 / max(np.sum(left**2) / spare, 1e-30)
        probability = float(fisher.sf(share, 2, spare))
        if probability < worst:
            worst, along = probability, name
    return min(1.0, worst * max(1, len(conditions))), along
