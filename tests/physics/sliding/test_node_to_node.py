"""Node-to-node sweeps: convergence to the exact sweep, and stated errors."""

from dataclasses import replace

import numpy as np
import pytest
from schemes import sampled

from mdr_dask.physics.sliding import steady as sliding
from mdr_dask.physics.sliding.cases import Cases
from mdr_dask.physics.sliding.node_to_node import NodeToNode
from mdr_dask.physics.sliding.problem import FLOORS, Request
from mdr_dask.physics.sliding.problem import solve as solve_problem
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import Waves, waves_of

POINTS, MODES = 400, 200
LOADS = np.geomspace(1e-3, 30, 7)
DEBORAH = np.geomspace(1e-6, 10, 6)


def line(hurst=0.7, oversampling=2, realisation=0):
    amplitude, phase = roughness.amplitudes(MODES, hurst), roughness.phases(3, realisation, MODES)
    height, slope = (sampled(amplitude, phase, POINTS * oversampling, order) for order in (0, 1))
    return height, slope, roughness.spectral_slope(amplitude)


def cases():
    loads, deborah = np.meshgrid(LOADS, DEBORAH)
    return deborah.ravel(), loads.ravel()


def settled(refinement, deborah, loads, height, accuracy=1e-8):
    """Return drag, depth, contact fraction and slope on a grid of 2 * refinement nodes per Nyquist point."""
    plane = RoughLine(replace(waves_of(height), points=height.size // 2))
    search, every = NodeToNode(plane, Cases(deborah, loads), accuracy), np.arange(loads.size)
    for level in 2 ** np.arange(int(np.log2(refinement)) + 2):
        found = search.solve(int(level), every)
    return np.array(found.values)


def exact_states(deborah, loads, hurst=0.7, oversampling=64):
    return sliding.steady_sliding(periodic_line(*line(hurst, oversampling)[:2]), deborah, loads)


@pytest.mark.parametrize("hurst", [0.2, 0.7])
def test_grids_converge_to_the_exact_sweep(hurst):
    deborah, loads = cases()
    height, _, _ = line(hurst)
    exact = exact_states(deborah, loads, hurst)
    many = exact.contact_fraction * POINTS > 10
    typical = []
    for refinement, most in ((1, 0.04), (2, 3e-3), (4, 5e-4)):
        state = settled(refinement, deborah, loads, height)
        drag, depth, fraction, _ = state
        error = np.abs(drag / exact.drag - 1)[many]
        typical.append(np.mean(error[error > 1e-9]))
        assert np.max(error) < most
        assert fraction[many] == pytest.approx(exact.contact_fraction[many], rel=20 * most)
        assert depth[many] == pytest.approx(exact.depth[many], abs=most, rel=most)
    # about fourth order, down to what the sums over whole blocks leave
    assert typical[1] < typical[0] / 6
    assert typical[2] < 5e-5


@pytest.mark.parametrize("count", [1, 5, 42])
def test_a_case_is_the_same_among_any_others(count):
    height, _, _ = line(0.3)
    deborah, loads = cases()

    def solve(some):
        return settled(4, deborah[some], loads[some], height, 5e-2)

    everything = solve(np.arange(loads.size))
    some = np.random.default_rng(count).permutation(loads.size)[:count]
    assert solve(some).tobytes() == everything[:, some].tobytes()


def test_a_line_that_does_not_divide_by_the_blocks():
    # 26 modes: 104 nodes, 3 blocks of 32 and 8 more
    amplitude, phase = roughness.amplitudes(26, 0.8), roughness.phases(3, 1, 26)
    height = sampled(amplitude, phase, 104)
    fine = periodic_line(*(sampled(amplitude, phase, 52 * 64, order) for order in (0, 1)))
    deborah, loads = np.array([1e-3, 1e-2]), np.array([0.3, 1.0])
    state = settled(8, deborah, loads, height)
    assert state[0] == pytest.approx(sliding.steady_sliding(fine, deborah, loads).drag, rel=0.002)


def random_line(generator, points, hurst):
    share = 0.5 * roughness.amplitudes(points // 2, hurst)
    return RoughLine(Waves(share * np.exp(2j * np.pi * generator.uniform(size=points // 2)), points), None)


def truth(surface, deborah, loads, oversampling=64):
    return sliding.steady_sliding(surface.cubic(surface.points * oversampling), deborah, loads)


def drawn(seed, lines):
    """Yield random planes, from few nodes in contact to all, from slow to fast, six cases each."""
    random = np.random.default_rng(seed)
    for _ in range(lines):
        points, hurst = 2 * int(10 ** random.uniform(1.5, 3) / 2), random.choice([0.0, random.uniform()])
        slope = roughness.spectral_slope(roughness.amplitudes(points // 2, hurst))
        deborah, loads = 10 ** random.uniform(-4, 3, 6) / slope, 10 ** random.uniform(-5.5, 0.5, 6)
        yield random_line(random, points, hurst), deborah, loads


def judged(seed, lines, accuracy):
    """Return errors over estimates and over the accuracy for drag, contact fraction and slope, shape (3, cases)."""
    ratios, shares = [], []
    for surface, deborah, loads in drawn(seed, lines):
        steady, errors = solve_problem(surface, None, deborah, loads, Request(accuracy))
        exact = truth(surface, deborah, loads).columns
        off = np.abs(steady.columns - exact)
        floors = np.array(FLOORS)[:, None]
        assert np.all(off[1] <= errors[1] + 1e-6)  # the depth converges fastest
        ratios.append((off / (errors + 1e-6 * np.maximum(exact, floors)))[[0, 2, 3]])
        met = errors <= 1.0001 * accuracy * np.maximum(np.abs(steady.columns), floors)
        shares.append(np.where(met, off / np.maximum(np.abs(exact), floors), 0.0)[[0, 2, 3]])
    return np.hstack(ratios), np.hstack(shares)


@pytest.mark.parametrize("accuracy", [0.05, 0.01])
def test_errors_are_below_their_estimates(accuracy):
    ratios, shares = judged(7, 15, accuracy)
    assert np.mean(ratios <= 1) >= 0.93
    assert np.mean(shares > accuracy) <= 0.02


@pytest.mark.parametrize(
    ("seed", "realisation", "points", "hurst", "load", "pace"),
    [
        (
            31337,
            0,
            74,
            0.39123252234797345,
            4.510877147649801e-06,
            5.815845327341263e-07,
        ),  # friction 23 % too small on coarse grids
        (31337, 0, 1274, 0.5221448174967009, 0.021707034745090295, 3.396670410589253e-08),  # 4 % too large
        (
            1,
            27,
            300,
            0.6,
            0.0031291346445318988,
            1e-3,
        ),  # a patch that two grids miss: contact fraction 1.4 to 3.5 % too small
        (1, 20, 100, 0.6, 0.030638870628004047, 1e-3),
        (1, 10, 300, 0.6, 0.009791483623609773, 0.1),
        (1, 18, 300, 0.6, 0.0031291346445318988, 0.01),
        (1, 28, 200, 0.5, 0.0031291346445318988, 1e-3),
    ],
)
def test_contacts_on_which_coarse_grids_agree_by_chance(seed, realisation, points, hurst, load, pace):
    """Friction and contact on grids that agree on a wrong value are within the accuracy and the stated error."""
    amplitude = roughness.amplitudes(points // 2, hurst)
    surface = RoughLine(Waves(0.5 * amplitude * roughness.phase_factors(seed, realisation, points // 2), points), None)
    scale = 1.0 if seed == 31337 else roughness.spectral_slope(amplitude)
    deborah, loads = np.array([pace / scale]), np.array([load])
    exact = truth(surface, deborah, loads)
    for accuracy in (0.05, 0.01, 0.002):
        steady, errors = solve_problem(surface, None, deborah, loads, Request(accuracy))
        allowed = accuracy * np.maximum(np.abs(steady.columns), np.array(FLOORS)[:, None])
        assert np.all(np.abs(steady.columns - exact.columns) <= allowed)
        assert np.all(errors <= allowed)


@pytest.mark.parametrize("scheme", ["hermite", "backward_euler"])
@pytest.mark.parametrize("oversampling", [1, 8])
def test_errors_on_a_given_grid(scheme, oversampling):
    ratios = []
    for surface, deborah, loads in drawn(3, 8):
        steady, errors = solve_problem(surface, None, deborah, loads, Request(0.01, oversampling, scheme))
        without, _ = solve_problem(surface, None, deborah, loads, Request(0.01, oversampling, scheme, False))
        assert np.array_equal(steady.drag, without.drag, equal_nan=True)
        ratios.append(np.abs(steady.drag - truth(surface, deborah, loads).drag) / errors[0])
    known = np.concatenate(ratios)
    assert np.mean(known[np.isfinite(known)] <= 1.01) >= 0.9
    assert np.mean(np.isfinite(known)) > 0.6
