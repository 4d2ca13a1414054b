"""Test a model against measured points, by chi squared or, if errors are unknown, by a trend of the residuals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, fdtrc

from mdr_dask.arrays import FloatArray
from mdr_dask.fits.base import APPROXIMATE, DOUBTFUL, WITHIN


class Residuals(NamedTuple):
    """Residuals of the best prediction.

    A residual is a measured minus a predicted value. `scaled` contains the residuals divided by their standard
    deviations. `relative` is the rms residual divided by the rms measured value. `errors` is the rms standard deviation
    divided by the rms measured value. `chi_squared` takes the correlations of the errors into account. `chi_squared` is
    NaN if the measurement errors are unknown. `freedom` is the number of points minus the number of unknowns and
    products of unknowns that the data determine.
    """

    scaled: FloatArray
    relative: float
    chi_squared: float
    freedom: int
    errors: float

    @property
    def chance(self) -> float:
        """Probability that errors alone cause such large residuals; NaN for unknown errors or `freedom` below 1."""
        return float(chdtrc(self.freedom, self.chi_squared)) if self.freedom > 0 else np.nan


def law_holds(residuals: Residuals, conditions: Mapping[str, FloatArray]) -> str:
    """Return a sentence (*yes*, *no* or *not tested* with a reason) on whether the model explains the measured points.

    The sentence is *not tested* instead of *yes* if the errors would hide any misfit. With too few points, it is always
    *not tested*.
    """
    size = f"residuals are {100 * residuals.relative:.2g} % of the measured values, rms"
    hidden = (
        f"not tested: errors of {100 * residuals.errors:.2g} % of the measured values would hide any misfit; {size}"
    )
    if residuals.freedom < 1:
        return "not tested: expected more points than constants that the data determine"
    if np.isfinite(residuals.chi_squared):
        test = f"chi squared {residuals.chi_squared:.3g}, {residuals.freedom} degrees of freedom"
        about = f"({test}, probability {residuals.chance:.2g}); {size}"
        if residuals.chance < DOUBTFUL:
            return f"no: the errors do not explain the residuals {about}"
        return hidden if residuals.errors > APPROXIMATE else f"yes: the errors explain the residuals {about}"
    probability, along = trend(residuals.scaled, conditions)
    if np.isnan(probability) or residuals.freedom < 4:  # a trend is a parabola with three constants
        return f"not tested: {residuals.scaled.size} points without known errors are too few; {size}"
    is_trend = probability < DOUBTFUL
    about = f"(probability that chance causes such a trend: {probability:.2g}); {size}"
    if is_trend and residuals.relative > WITHIN:
        return f"no: the residuals have a trend along {along} {about}"
    if residuals.errors > APPROXIMATE:
        return hidden
    if is_trend:
        return f"yes: the residuals have a trend along {along} {about}, which is at most {100 * WITHIN:g} %"
    return f"yes: the residuals have no significant trend {about}"


def trend(scaled: FloatArray, conditions: Mapping[str, FloatArray]) -> tuple[float, str]:
    """Return the probability that chance causes the clearest trend of the residuals, and the condition of this trend.

    For each condition, a parabola is fitted to the residuals against the rank of the condition's value.
    The smallest probability is multiplied by the number of conditions, because every condition is another chance to
    find a trend. If no condition has four or more different values, NaN and an empty name are returned.
    """
    found = []
    for name, values in conditions.items():
        if np.unique(values).size < 4:  # a parabola through three values leaves no residuals
            continue
        rank = np.searchsorted(np.unique(values), values)
        terms = np.vander(rank / rank.max() - 0.5, 3)
        left = scaled - terms @ np.linalg.lstsq(terms, scaled)[0]
        spare = scaled.size - 3
        share = (np.sum(scaled**2) - np.sum(left**2)) / 2 / max(np.sum(left**2) / spare, np.finfo(float).tiny)
        found.append((float(fdtrc(2, spare, max(share, 0.0))), name))
    worst, along = min(found, default=(np.nan, ""))
    return float(np.minimum(1.0, worst * len(conditions))), along
