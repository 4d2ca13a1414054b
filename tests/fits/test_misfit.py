"""Trends of residuals, and verdicts on models."""

import numpy as np
import pytest

from mdr_dask.fits.base import WITHIN
from mdr_dask.fits.misfit import Residuals, law_holds, trend

DRAWS, POINTS = 600, 30


def noise(seed: int) -> np.ndarray:
    """Return random residuals with the mean zero, as of a fit with a free constant."""
    drawn = np.random.default_rng(seed).standard_normal((DRAWS, POINTS))
    return drawn - drawn.mean(axis=1, keepdims=True)


@pytest.mark.parametrize("count", [1, 3])
def test_noise_has_a_trend_as_often_as_its_probability(count):
    """This holds exactly for one condition. With several conditions, trends are found at most as often."""
    random = np.random.default_rng(2)
    conditions = {f"condition {k}": random.permutation(POINTS).astype(float) for k in range(count)}
    found = np.array([trend(residuals, conditions)[0] for residuals in noise(1)])
    assert np.all((found > 0) & (found <= 1))
    for level in (0.05, 0.2, 0.5):
        below, spread = np.mean(found < level), 4 * np.sqrt(level * (1 - level) / DRAWS)
        assert below < level + spread
        # for three independent conditions, it is 1 - (1 - level / 3)^3
        assert below > (level if count == 1 else 0.6 * level) - spread
    assert np.mean(found == 1) == pytest.approx(0.0 if count == 1 else (2 / 3) ** 3, abs=4 * np.sqrt(0.21 / DRAWS))


def test_the_condition_that_residuals_follow_is_named():
    random, residuals = np.random.default_rng(3), noise(4)[0]
    conditions = {name: random.permutation(POINTS) ** 3.0 for name in ("velocity", "force")}
    rank = np.argsort(np.argsort(conditions["force"])) / POINTS
    probability, along = trend(residuals + 6 * (rank - 0.5), conditions)
    assert (probability < 1e-3, along) == (True, "force")
    assert np.isnan(trend(residuals, {"few": np.arange(POINTS) % 3})[0])


def test_residuals_without_known_errors_are_judged_by_their_trend():
    velocity = np.geomspace(0.01, 1, 12)
    bent = np.log(velocity) ** 2 - 8 + 0.1 * np.random.default_rng(0).normal(size=12)
    even = np.random.default_rng(1).normal(size=12)

    def judged(scaled, relative=0.1, freedom=10, errors=0.1, squares=np.nan, velocity=velocity):
        return law_holds(Residuals(scaled, relative, squares, freedom, errors), {"velocity": velocity})

    assert judged(even, freedom=0).startswith("not tested: expected more points")
    assert judged(even).startswith("yes: ")
    assert judged(even[:3], velocity=velocity[:3]).startswith("not tested: 3 points")
    assert judged(even, freedom=3).startswith("not tested: 12 points")
    assert judged(bent).startswith("no: the residuals have a trend along velocity")
    assert judged(bent, relative=0.9 * WITHIN).startswith("yes: ")
    for squares in (np.nan, 5.0):
        assert judged(even, squares=squares).startswith("yes: ")
        assert judged(even, errors=0.5, squares=squares).startswith("not tested: errors of 50 %")
