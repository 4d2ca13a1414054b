"""The driver of grid refinement, on problems whose solution and order of convergence are known."""

from itertools import pairwise

import numpy as np
import pytest

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import Solution, refine

LEVELS = [4, 8, 16, 32, 64, 128]


def converged(*values):
    return Solution([np.asarray(value, float) for value in values], np.zeros(len(values[0]), np.int8))


def power_error(level, cases, order=2.0, size=10.0):
    return converged(1.0 + size * 4.0 ** (1.0 - cases) * level**-order)


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 3.0])
def test_each_case_stops_on_the_coarsest_grid_that_meets_the_accuracy(order):
    found = refine(lambda level, cases: power_error(level, cases, order), 5, LEVELS, 0.01, order, safety=1.0)
    true = np.abs(found.values[0] - 1)
    # without a safety factor the estimate is the error left on the last grid
    np.testing.assert_allclose(found.errors[0], true, rtol=0.02)
    assert np.all(found.met == (found.errors[0] <= 0.01 * found.values[0]))
    assert np.all(np.diff(found.level) <= 0)
    for case, level in enumerate(found.level):
        if level > LEVELS[1] and found.met[case]:  # the grid before was not good enough
            assert abs(power_error(level // 2, np.array([case]), order).values[0][0] - 1) > 0.0099


def test_only_cases_that_miss_the_accuracy_are_solved_again():
    seen = []

    def solve(level, cases):
        seen.append((level, cases.tolist()))
        return power_error(level, cases)

    refine(solve, 3, LEVELS, 0.01, 2.0)
    assert seen[:2] == [(4, [0, 1, 2]), (8, [0, 1, 2])]
    assert all(set(later[1]) <= set(earlier[1]) for earlier, later in pairwise(seen))
    assert seen[-1][1] == [0]


def test_grids_that_agree_by_chance_are_not_believed():
    values = {4: 1.0, 8: 2.0, 16: 2.0, 32: 1.7}
    found = refine(lambda level, cases: converged([values[level]]), 1, list(values), 0.01, 1.0)
    assert not found.met[0]
    assert found.errors[0, 0] >= 0.3


def test_outputs_share_the_largest_change_unless_they_converge_differently():
    def solve(level, cases):
        return converged([1 + level**-2.0], [50 + 500.0 / level])

    shared = refine(solve, 1, LEVELS[:3], 1e-6, 1.0)
    own = refine(solve, 1, LEVELS[:3], 1e-6, 1.0, shared=False)
    assert shared.errors[0, 0] / shared.values[0][0] == pytest.approx(shared.errors[1, 0] / shared.values[1][0])
    assert own.errors[0, 0] / own.values[0][0] < own.errors[1, 0] / own.values[1][0]


def test_profiles_are_measured_by_their_largest_value_and_change():
    x = np.linspace(0, 1, 5)

    def solve(level, cases):
        profile = np.where(x > 0.9, np.nan, 2 * x + (x == 0.5) / level)
        return converged([profile])

    found = refine(solve, 1, [4, 8], np.inf, 1.0, safety=1.0)
    assert found.errors[0, 0] == pytest.approx(0.125)
    assert np.isnan(found.values[0][0, -1])


def test_zero_is_met_with_a_floor_and_exactly():
    found = refine(lambda level, cases: converged([1e-4 / level], [0.0]), 1, LEVELS, 0.01, 1.0, floors=[0.1, 0.0])
    assert found.met[0]
    assert found.level[0] == 8
    assert not refine(lambda level, cases: converged([1e-4 / level]), 1, LEVELS, 0.01, 1.0).met[0]


def test_a_failure_is_a_value():
    tried = []

    def solve(level, cases):
        tried.extend(cases.tolist())
        outcome = np.array([[Outcome.OUTSIDE_LINE, Outcome.CONVERGED, Outcome.DEPTH_NOT_FOUND, Outcome.CONVERGED][case]
                            for case in cases], np.int8)  # fmt: skip
        outcome[(cases == 1) & (level == 4)] = Outcome.DEPTH_NOT_FOUND  # too coarse a grid
        outcome[(cases == 3) & (level > 8)] = Outcome.DEPTH_NOT_FOUND
        return Solution([1 + level ** np.where(cases == 3, -0.5, -2.0)], outcome)

    found = refine(solve, 4, LEVELS, 0.01, 1.0)
    assert found.outcome.tolist() == [Outcome.OUTSIDE_LINE, 0, Outcome.DEPTH_NOT_FOUND, 0]
    assert tried.count(0) == 1
    assert found.met.tolist() == [False, True, False, False]
    assert np.isnan(found.values[0][[0, 2]]).all()
    assert np.isinf(found.errors[0, [0, 2]]).all()
    assert found.level[3] == 8  # the last solution, with its error
    assert np.isfinite(found.errors[0, 3])


def test_the_error_of_a_single_grid_is_infinite():
    found = refine(power_error, 2, [8], 0.01, 2.0)
    assert np.isinf(found.errors).all()
    assert not found.met.any()


def test_no_cases():
    found = refine(power_error, 0, LEVELS, 0.01, 2.0)
    assert found.errors.shape == (1, 0)
