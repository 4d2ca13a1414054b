"""A Kelvin body on measured lines that jump, spike and saw: as right as it says, and to the accuracy asked."""

import numpy as np
import pytest
from references.measured_lines import FAMILIES, samples
from slow_friction import Body, reference
from slow_friction import samples as through

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.problem import Aim, Arms, Line, solve
from mdr_dask.physics.sliding.steady import steady_sliding
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.surfaces.waves import waves_of

COLUMNS = ("drag", "depth", "contact_fraction", "contact_slope")
FINEST = 512  # nodes a sample of the truth
CASES = 12  # of a family
ROUNDING = 1e-9


def draw(family):
    """Yield lines, Deborah numbers and loads: seven decades of load, ten of speed."""
    random = np.random.default_rng([11, FAMILIES.index(family)])
    for _ in range(CASES):
        height = samples(family, random)
        waves = waves_of(height)
        fast = 10 ** random.uniform(-4, 1.5) / waves.rms_slope()
        deborah = fast if random.uniform() < 0.7 else 10 ** random.uniform(-8, 1)
        yield height, Line(waves, None), np.array([deborah]), np.array([10 ** random.uniform(-6, 0.5)])


def truth_of(line, deborah, load):
    nodes = FINEST * line.points
    state = steady_sliding(periodic_line(line.heights(nodes), line.slopes(nodes)), deborah, load)
    assert state.status[0] == Outcome.CONVERGED
    return state


def test_the_truth_is_that_of_following_one_element():
    """An independent slow march of one element along the line finds the same load and friction at the depth."""
    judged = 0
    for family in FAMILIES:
        for height, line, deborah, load in list(draw(family))[:4]:
            truth = truth_of(line, deborah, load)
            if height.size % 2 or truth.contact_fraction[0] < 0.02:  # not known to the march, or not resolved by it
                continue
            exact = reference(through(height), float(truth.depth[0]), Body(np.empty(0), np.empty(0), float(deborah[0])))
            if exact is not None and exact.doubt < 0.01:
                judged += 1
                assert load[0] == pytest.approx(exact.load, rel=3 * exact.doubt + 1e-3)
                assert truth.drag[0] / load[0] == pytest.approx(exact.friction, rel=3 * exact.doubt + 1e-3)
    assert judged >= 10


@pytest.mark.parametrize("accuracy", [0.05, 0.01, 0.002])
def test_estimates_hold_and_the_accuracy_is_met(accuracy):
    """19 of 20 within their estimates, 19 of 20 to the accuracy; before, 9 of 10 and 7 of 10 (1 %)."""
    ratios, met = {column: [] for column in COLUMNS}, []
    for family in FAMILIES:
        for _, line, deborah, load in draw(family):
            truth = truth_of(line, deborah, load)
            state, errors = solve(line, None, deborah, load, Aim(accuracy=accuracy))
            assert state.status[0] == Outcome.CONVERGED
            for column in COLUMNS:
                exact = float(getattr(truth, column)[0])
                miss = abs(float(getattr(state, column)[0]) - exact)
                ratios[column].append(miss / (float(getattr(errors, column)[0]) + ROUNDING * abs(exact)))
            met.append(abs(state.drag[0] / truth.drag[0] - 1) <= accuracy)
    assert np.mean(met) >= 0.95
    for column, ratio in ratios.items():
        # 19 of 20 are asked for; of 156 cases the share scatters by 1.7 %
        assert np.mean(np.array(ratio) <= 1) >= (0.93 if column == "drag" else 0.9), column
    assert max(ratios["drag"]) < 20


@pytest.mark.parametrize("family", FAMILIES)
def test_arms_on_measured_lines_say_how_wrong_they_are(family):
    """No number of a general solid is off by many times its estimate, though two of its grids agree by chance."""
    random, ratios = np.random.default_rng([3, FAMILIES.index(family)]), []
    for _, line, _, load in list(draw(family)):
        moduli, times = 10 ** random.uniform(-2, 2, 3), np.sort(10 ** random.uniform(-6, 3, 3))
        arms, none = Arms(tuple(moduli), tuple(times)), np.zeros(1)
        states = [solve(line, arms, none, np.maximum(load, 1e-4), Aim(oversampling=grid)) for grid in (8, 256)]
        (found, errors), (exact, doubt) = states
        if found.status[0] != Outcome.CONVERGED:
            continue
        for column in COLUMNS:
            miss = abs(float(getattr(found, column)[0] - getattr(exact, column)[0]))
            known = float(getattr(errors, column)[0] + getattr(doubt, column)[0])
            ratios.append(miss / (known + ROUNDING * abs(float(getattr(exact, column)[0]))))
    assert np.mean(np.array(ratios) <= 1) >= 0.88  # of 48, 19 of 20 are expected
    assert max(ratios) < 20
