"""Verdicts of fits: sentences, and constants that are not determined."""

import numpy as np
import pytest
import xarray as xr

from mdr_dask import bootstrap
from mdr_dask.fits.base import Fit, fitted, law_holds, verdict


@pytest.mark.parametrize(
    ("departures", "chance", "constants", "begins"),
    [
        ([0.01, -0.02, 0.01], 0.0, 0, "yes: departs by 1.4 % rms, at most 2 %"),
        ([0.3, -0.4, 0.2], 0.3, 0, "not tested: departs by 31 % rms, at most 40 % at x = 1, which scatter explains"),
        ([0.08, -0.22, 0.05], 0.3, 0, "approximately: departs by 14 % rms, at most 22 % at x = 1"),
        ([0.08, -0.22, 0.05], 0.0, 0, "approximately: departs by 14 % rms, at most 22 % at x = 1"),
        ([0.3, -0.4, 0.2], 0.0, 0, "no: departs by 31 % rms, at most 40 % at x = 1"),
        ([0.0] * 99 + [0.4], 0.0, 0, "no: departs by 4 % rms, at most 40 %"),  # a single bad case counts
        ([0.3, -0.4, 0.2], 0.0, 3, "not tested: 3 cases for 3 constants"),
        ([0.3, -0.4, 0.2], np.nan, 0, "not tested: too few realisations"),
        ([-0.17], 0.0, 0, "no: departs by -17 %"),
    ],
)
def test_sentences(departures, chance, constants, begins):
    assert law_holds(np.array(departures), chance, constants, "x = 1").startswith(begins)


@pytest.mark.parametrize(
    ("departures", "departs"),
    [
        ([3.0, -4.0], "a factor of 34 rms, at most a factor of 55 at x = 1"),
        ([0.01] * 99 + [0.5], "5.1 % rms, at most a factor of 1.6 at x = 1"),
        ([-3.0], "a factor of 0.05"),
        ([-0.17], "-17 %"),
    ],
)
def test_large_differences_of_logarithms_are_factors(departures, departs):
    assert law_holds(np.array(departures), 0.0, 0, "x = 1", logarithmic=True).startswith(f"no: departs by {departs};")


RANKS = {"not tested": 0, "no": 0, "approximately": 1, "yes": 2}


@pytest.mark.parametrize(("off", "best"), [(0.0, "yes"), (0.1, "approximately"), (0.6, "no")])
@pytest.mark.parametrize("cases", [1, 12])
def test_fewer_realisations_give_no_better_verdict(off, best, cases):
    """The scatter of a realisation is as large as the mean; with two realisations, there is no verdict."""
    for seed in range(5):
        values = 1 + off + np.random.default_rng(seed).normal(size=(4_000, cases))
        found = {}
        for count in (1, 2, 5, 4_000):
            sentence = verdict(bootstrap.means(values[:count]) - 1, count)
            found[count] = sentence.partition(":")[0]
        assert found[1] == found[2] == "not tested"
        assert RANKS[found[5]] <= RANKS[best]
        assert found[4_000] == best


def test_a_law_that_does_not_hold_moves_its_constants():
    rows = np.repeat([[1.0, 2.0, 4.0]], 401, axis=0)
    mean = fitted(lambda data: data.mean(axis=1, keepdims=True), lambda data, found: data - found, rows, 10)
    assert len(mean.constants) == 401 + 6
    assert np.allclose(mean.residuals[0], [-4 / 3, -1 / 3, 5 / 3])
    assert mean.holds().startswith("no: ")


LOG_LOADS = np.repeat(np.linspace(0.0, 1.0, 4), 3)


@pytest.mark.parametrize(
    ("columns", "known"),
    [
        ([1 + 0 * LOG_LOADS, LOG_LOADS], [True, True]),
        ([1 + 0 * LOG_LOADS, 0.05 * LOG_LOADS], [True, False]),  # nearly equal loads
        ([1 + 0 * LOG_LOADS, 1e-3 * LOG_LOADS**2, 0 * LOG_LOADS], [True, False, False]),  # constants without effect
        ([1 + 0 * LOG_LOADS, LOG_LOADS, 2 * LOG_LOADS], [True, False, False]),  # two constants with the same effect
    ],
)
@pytest.mark.parametrize("misfit", [0.0, 0.2])
def test_constants_without_effect_are_not_determined(columns, known, misfit):
    design = np.stack(columns)
    bent = design.sum(axis=0) + misfit * np.cos(9 * LOG_LOADS)
    rows = bent + 0.01 * np.random.default_rng(0).normal(size=(401, bent.size))
    found = fitted(lambda data: data @ np.linalg.pinv(design), lambda data, c: data - c @ design, rows, 10)
    low, high = bootstrap.interval(found.constants, 10)
    for values in (found.constants[0], low, high):
        assert np.isfinite(values).tolist() == known
    assert np.isfinite(found.rms)


def test_a_fit_without_a_verdict_is_not_tested():
    plain = Fit("plain", ("toy",), "none", lambda groups: xr.Dataset({"a": 1.0}), apart=False)
    assert plain.results({})[""]["law_holds"].item().startswith("not tested: ")
    apart = Fit("plain", ("toy",), "none", lambda groups: xr.Dataset({"a": 1.0}))
    assert apart.results({"x": xr.Dataset()})["x"]["law_holds"].item().startswith("not tested: ")
