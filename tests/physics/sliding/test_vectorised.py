import numpy as np
import pytest
from schemes import on_line

from mdr_dask.physics.sliding import nodes as sampled_nodes
from mdr_dask.physics.sliding import vectorised as sampled
from mdr_dask.physics.sliding.nodes import halved, nodes, refine, weights
from mdr_dask.physics.surfaces import roughness

POINTS, MODES = 400, 200
LOADS = np.geomspace(1e-3, 30, 7)
REACHES = np.geomspace(1e-6, 10, 6)


def line(hurst=0.7, oversampling=2, realisation=0):
    amplitude, phase = roughness.amplitudes(MODES, hurst), roughness.phases(3, realisation, MODES)
    height, slope = (roughness.line(amplitude, phase, POINTS * oversampling, order) for order in (0, 1))
    return height, slope, roughness.spectral_slope(amplitude)


def cases():
    loads, reaches = np.meshgrid(LOADS, REACHES)
    return reaches.ravel(), loads.ravel()


def settled(refinement, hurst=0.7):
    height, slope, _ = line(hurst)
    reaches, loads = cases()
    states = sampled.begin(height, slope, reaches, loads, 5e-3)
    whole = sampled.finer(height, slope)
    grid = 1
    while grid <= refinement:
        states = states[-1], sampled.settle(whole, grid, reaches, loads, states, 1e-3)
        grid *= 2
    return states[-1]


def test_grids_converge_to_the_exact_sweep():
    reaches, loads = cases()
    height, slope, _ = line(oversampling=32)
    exact = on_line(height, slope, reaches, loads)
    many = exact.contact_fraction * POINTS > 10
    errors = []
    for refinement in (1, 4):
        state = settled(refinement)
        errors.append(np.abs(state.drag / exact.drag - 1)[many])
        # the last step of the depth, up to 3 %, is taken along the tangent
        assert state.depth[many] == pytest.approx(exact.depth[many], abs=0.02, rel=0.004)
    # third order: 64 times less, and the search that may cost 1e-3; full contact is exact on both
    assert np.max(errors[0]) < 0.06
    assert np.max(errors[1]) < 0.005


def test_full_contact_is_exact_on_any_grid():
    height, slope, rms = line()
    reaches, loads = np.array([1e-4, 1e-3]), np.array([50.0, 300.0])
    _, state = sampled.begin(height, slope, reaches, loads, 5e-3)
    assert state.drag == pytest.approx(reaches * rms**2, rel=1e-11)
    assert state.contact_fraction == pytest.approx(1.0)
    assert state.contact_slope == pytest.approx(rms, rel=1e-11)
    assert state.depth == pytest.approx(loads, rel=1e-11)


def test_a_finer_grid_lies_on_the_line():
    height, slope, _ = line(oversampling=4)
    fine, fine_slope, _ = line(oversampling=16)
    top = int(np.argmax(height))
    whole = nodes(height, slope, top, 1, True)
    got_height, got_slope = np.empty(4 * 50 + 3), np.empty(4 * 50 + 3)
    refine(whole, sampled_nodes.BEFORE, 50, weights(4), got_height, got_slope)
    expected = np.arange(-1, 4 * 50 + 2) + 4 * top
    # polynomials of degree 11 over four nodes a shortest half wave
    scale = np.std(fine)
    assert got_height + whole.top == pytest.approx(np.take(fine, expected, mode="wrap"), abs=1e-9 * scale)
    assert got_slope == pytest.approx(np.take(fine_slope, expected, mode="wrap") / fine.size, abs=1e-9 * scale)


@pytest.mark.parametrize("hurst", [0.0, 0.7])
def test_cells_of_half_the_width_lie_on_the_line(hurst):
    amplitude = roughness.amplitudes(MODES, hurst)
    height, slope = halved(*line(hurst)[:2])
    fine, fine_slope, _ = line(hurst, oversampling=4)
    shortest = amplitude[-1]
    assert height == pytest.approx(fine, abs=1e-6 * shortest)
    assert slope == pytest.approx(fine_slope, abs=1e-7 * 2 * np.pi * MODES * shortest)


@pytest.mark.parametrize("count", [1, 5, 42])
def test_a_case_is_the_same_among_any_others(count):
    height, slope, _ = line(0.3)
    reaches, loads = cases()
    whole = sampled.finer(height, slope)

    def solve(some):
        states = sampled.begin(height, slope, reaches[some], loads[some], 5e-3)
        return sampled.settle(whole, 2, reaches[some], loads[some], states, 1e-3)

    everything = solve(np.arange(loads.size))
    some = np.random.default_rng(count).permutation(loads.size)[:count]
    alone = solve(some)
    for name, column in vars(alone).items():
        assert column.tobytes() == vars(everything.only(some))[name].tobytes()


def test_a_line_that_does_not_divide_by_the_blocks():
    # 26 modes: 104 and 208 nodes, 3 and 6 blocks of 32 and 8 and 16 more
    amplitude, phase = roughness.amplitudes(26, 0.8), roughness.phases(3, 1, 26)
    height, slope = (roughness.line(amplitude, phase, 104, order) for order in (0, 1))
    fine = [roughness.line(amplitude, phase, 52 * 64, order) for order in (0, 1)]
    reaches, loads = np.array([1e-3, 1e-2]), np.array([0.3, 1.0])
    states = sampled.begin(height, slope, reaches, loads, 5e-3)
    whole = sampled.finer(height, slope)
    for refinement in (1, 2, 4):
        states = states[-1], sampled.settle(whole, refinement, reaches, loads, states, 1e-3)
    assert states[-1].drag == pytest.approx(on_line(*fine, reaches, loads).drag, rel=0.005)
