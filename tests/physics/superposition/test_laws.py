"""Laws of shift factors: constants within their intervals, the same law at every reference."""

import numpy as np
import pytest
from scipy import stats

from mdr_dask.errors import FitError
from mdr_dask.physics.superposition.laws import fit_arrhenius, fit_power, fit_wlf


def test_laws_of_factors_recover_their_constants_within_their_intervals():
    random = np.random.default_rng(0)
    velocities = np.geomspace(1e-3, 1e-1, 12)
    covariance = np.diag(np.r_[0.0, np.full(11, 0.02**2)])
    scatter = np.r_[0.0, 0.02 * random.standard_normal(11)]
    value, low, high = fit_power(velocities, -0.15 * np.log10(velocities / 1e-3) + scatter, covariance, 0).constants[
        "exponent"
    ]
    assert low < -0.15 < high
    assert value == pytest.approx(-0.15, abs=0.03)
    kelvins = np.linspace(280, 350, 12)
    factors = 8e4 / (8.31446261815324 * np.log(10)) * (1 / kelvins - 1 / 280) + scatter
    _, low, high = fit_arrhenius(kelvins, factors, covariance, 0).constants["activation_energy"]
    assert low < 8e4 < high
    law = fit_wlf(kelvins, -17.4 * (kelvins - 280) / (51.6 + kelvins - 280) + scatter, covariance, 0, 280.0)
    assert law.constants["c1"][1] < 17.4 < law.constants["c1"][2]
    assert law.constants["c2"][1] < 51.6 < law.constants["c2"][2]


def test_wlf_is_the_same_law_at_every_reference():
    """c1 c2 and T_ref - c2 do not depend on the reference; the constants are those of a direct fit there."""
    random, kelvins = np.random.default_rng(1), np.linspace(280, 350, 9)
    factors = -9 * (kelvins - kelvins[4]) / (80 + kelvins - kelvins[4])
    factors += np.where(np.arange(9) == 4, 0.0, 0.01 * random.standard_normal(9))
    covariance = np.diag((np.arange(9) != 4) * 0.01**2)
    found = [fit_wlf(kelvins, factors, covariance, 4, reference) for reference in (*kelvins, 281.3, 298.15, 349.0)]
    products = [law.constants["c1"][0] * law.constants["c2"][0] for law in found]
    ends = [
        reference - law.constants["c2"][0]
        for law, reference in zip(found, (*kelvins, 281.3, 298.15, 349.0), strict=True)
    ]
    np.testing.assert_allclose(products, products[0], rtol=1e-6)
    np.testing.assert_allclose(ends, ends[0], rtol=1e-6)
    for law, reference in zip(found, kelvins, strict=False):
        c1, c2 = (law.constants[name][0] for name in ("c1", "c2"))
        distance = kelvins - reference
        shifted = -c1 * distance / (c2 + distance)
        np.testing.assert_allclose(shifted - shifted[4], law.factors(kelvins), atol=1e-9)
    true_c2 = 80 + 298.15 - kelvins[4]
    law = found[10]
    assert law.constants["c2"][1] < true_c2 < law.constants["c2"][2]
    assert law.constants["c1"][1] < 720 / true_c2 < law.constants["c1"][2]


def test_wlf_of_factors_linear_in_temperature_has_no_upper_end_of_c2():
    kelvins = np.linspace(280, 350, 10)
    factors = -0.1 * (kelvins - 280) - 1e-5 * (kelvins - 280) ** 2  # bent a little the other way
    law = fit_wlf(kelvins, factors, np.diag(np.r_[0.0, np.full(9, 0.02**2)]), 0, 280.0)
    for name in ("c1", "c2"):
        value, low, high = law.constants[name]
        assert 10 < low < value < high == np.inf
    assert law.constants["c1"][1] / law.constants["c2"][1] == pytest.approx(0.1, rel=0.02)
    assert law.residual < 0.03


def test_a_law_that_does_not_hold_gets_a_wide_interval():
    velocities = np.geomspace(1, 1e4, 9)
    covariance = np.diag(np.r_[0.0, np.full(8, 1e-6)])
    law = fit_power(velocities, 0.1 * np.log10(velocities) ** 2, covariance, 0)
    value, low, high = law.constants["exponent"]
    assert law.residual > 0.1
    assert high - low > 0.1 * value
    assert law.chance < 1e-6


def test_the_chance_of_a_law_is_that_of_the_errors_alone():
    """Factors 0.03 decades off a law, known to 0.01: chi-squared of the residuals has its probability."""
    groups = np.geomspace(1e-3, 1, 9)
    factors = -0.3 * np.log10(groups) + 0.03 * np.array([0, 1, -1, 1, 1, -1, -1, 1, -1])
    factors -= factors[0]
    found = fit_power(groups, factors, np.diag([0.0] + [0.01**2] * 8), 0)
    distance = np.log10(groups / groups[0])[1:]
    slope = distance @ factors[1:] / (distance @ distance)
    squares = np.sum((factors[1:] - slope * distance) ** 2) / 0.01**2
    assert found.chance == pytest.approx(stats.chi2.sf(squares, 7), rel=1e-6)


def test_laws_refuse_groups_they_are_not_made_for():
    with pytest.raises(FitError, match="temperatures above 0 K, got"):
        fit_arrhenius(np.array([-1.0, 1.0]), np.zeros(2), np.zeros((2, 2)), 0)
    with pytest.raises(FitError, match="needs more than 1 shift factors besides the reference, got 0"):
        fit_power(np.array([1.0, 2.0]), np.zeros(2), np.zeros((2, 2)), 0)
