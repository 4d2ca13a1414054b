"""Steady sliding of the Kelvin body: identities, order of convergence, independent time stepping."""

import numpy as np
import pytest
from schemes import on_line, sampled

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces import cubic_line as profile
from mdr_dask.physics.surfaces import roughness

SCHEMES = ("hermite", "piecewise_linear", "backward_euler")
EXACT = SCHEMES[:2]


def rough(modes=100, hurst=0.7, oversampling=4, realisation=0, seed=1):
    amplitude = roughness.amplitudes(modes, hurst)
    phase = roughness.phases(seed, realisation, modes)
    nodes = 2 * modes * oversampling
    height, slope = (sampled(amplitude, phase, nodes, order) for order in (0, 1))
    return height, slope, roughness.spectral_slope(amplitude)


def friction(height, slope, deborah, load, scheme):
    deborahs, loads = np.broadcast_arrays(np.atleast_1d(deborah).astype(float), np.atleast_1d(load).astype(float))
    steady = on_line(height, slope, deborahs, loads, scheme)
    assert np.all(steady.status == Outcome.CONVERGED)
    return steady.drag / loads


def march(height, deborah, depth, periods=3):
    """Step elements through the line in time by backward Euler, without any trick of the solver."""
    n, decay = height.size, deborah * height.size / (1 + deborah * height.size)
    u = 0.0
    for _ in range(periods):
        normal = drag = 0.0
        for i in range(n):
            w, free = height[i] + depth, decay * u
            force = w + deborah * n * (w - u) if w > free else 0.0
            normal += force / n
            drag += force * (height[i] - height[i - 1])
            u = max(w, free)
    return normal, drag


@pytest.mark.parametrize(
    ("hurst", "deborah", "load"),
    [(0, 1e-5, 5.0), (0.7, 1e-5, 0.01), (0.7, 1e-3, 0.3), (0.7, 1e-1, 5.0), (1, 1e-1, 0.01)],
)
def test_backward_euler_agrees_with_time_stepping(hurst, deborah, load):
    height, _, _ = rough(50, hurst, 1)
    steady = on_line(height, None, np.array([deborah]), np.array([load]), "backward_euler")
    normal, drag = march(height, deborah, steady.depth[0], periods=3 + int(20 * deborah))
    # both do the same arithmetic in another order
    assert normal == pytest.approx(load, rel=1e-10)
    assert drag == pytest.approx(steady.drag[0], rel=1e-9)


@pytest.mark.parametrize("deborah", [1e-3, 1e-1])
@pytest.mark.parametrize("load", [0.1, 2.0])
def test_exact_sweep_agrees_with_fine_time_steps(deborah, load):
    height, slope, _ = rough(20, 0.7, 32)
    best = friction(height, slope, deborah, load, "hermite")[0]
    fine, _, _ = rough(20, 0.7, 2048)
    coarse, finer = (friction(line, None, deborah, load, "backward_euler")[0] for line in (fine[::2], fine))
    # first order: one Richardson step removes the error of the time steps but for terms of second order
    assert best == pytest.approx(2 * finer - coarse, rel=2e-3)


@pytest.mark.parametrize("hurst", [0, 1])
def test_full_contact_is_exact(hurst):
    height, slope, gradient = rough(500, hurst, 2)
    deborah = np.geomspace(1e-9, 1e-2, 8)
    load = 2 * np.max(np.abs(height)) + 2 * deborah * np.max(np.abs(slope))
    # thesis eq. 3.14: F_x / (4 G) = v tau grad^2 for a line of unit length
    expected = deborah * gradient**2 / load
    assert friction(height, slope, deborah, load, "hermite") == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("scheme", EXACT)
@pytest.mark.parametrize("load", [1e-3, 2.0])
def test_friction_has_no_floor_at_low_velocity(scheme, load):
    height, slope, _ = rough(200, 0.3)
    deborah = np.geomspace(1e-14, 1e-6, 9)
    mu = friction(height, slope, deborah, load, scheme)
    # v -> 0: mu / v tends to a constant; the slowest are 1e8 times slower than the fastest
    assert mu[:-1] / deborah[:-1] == pytest.approx(mu[0] / deborah[0], rel=1e-3)


@pytest.mark.parametrize(("scheme", "order"), [("backward_euler", 0.8), ("piecewise_linear", 1.8), ("hermite", 2.5)])
def test_order_of_convergence(scheme, order):
    lines = {factor: rough(50, 0.7, factor)[:2] for factor in (4, 16, 64)}
    deborah, load = np.geomspace(1e-4, 1e-1, 7), 0.5
    mu = {factor: friction(*line, deborah, load, scheme) for factor, line in lines.items()}
    reference = friction(*lines[64], deborah, load, "hermite")
    errors = [np.sqrt(np.mean((mu[factor] / reference - 1) ** 2)) for factor in (4, 16)]
    assert np.log(errors[0] / errors[1]) / np.log(4) > order


def test_bad_numbers_are_a_status():
    height, slope, _ = rough()
    bad = np.array([np.nan, np.inf, 0.0, -1.0])
    steady = on_line(height, slope, np.append(bad, np.ones(4)), np.append(np.ones(4), bad))
    assert np.all(steady.status == Outcome.INVALID)
    assert np.all(np.isnan(steady.drag))
    height[3] = np.nan
    assert on_line(height, slope, np.ones(1), np.ones(1)).status[0] == Outcome.INVALID


@pytest.mark.parametrize("seed", range(6))
def test_contact_begins_and_ends_several_times_in_a_cell(seed, monkeypatch):
    # such a line is not band-limited: its cells are integrated one by one
    monkeypatch.setattr(profile, "_resum", lambda slope, stretch: None)
    # cubic cells with a will of their own, against straight cells 4000 times as fine
    generator = np.random.default_rng(seed)
    n, fine = 8, 4000
    height, rise = generator.normal(size=n), 8 * generator.normal(size=n)
    x = (np.arange(n * fine) % fine) / fine
    h0, t0 = np.repeat(height, fine), np.repeat(rise, fine)
    h1, t1 = np.repeat(np.roll(height, -1), fine), np.repeat(np.roll(rise, -1), fine)
    dense = h0 * (1 + 2 * x) * (1 - x) ** 2 + h1 * x**2 * (3 - 2 * x) + t0 * x * (1 - x) ** 2 - t1 * x**2 * (1 - x)
    deborahs, loads = (grid.ravel() for grid in np.meshgrid(10.0 ** np.arange(-3, 2), [0.05, 0.5, 2.0, 5.0]))
    ours = on_line(height, rise * n, deborahs, loads)
    reference = on_line(dense, None, deborahs, loads, "piecewise_linear")
    assert np.all(ours.status == 0)
    # second order of the reference, and its shorter contacts at light loads
    assert ours.depth == pytest.approx(reference.depth, rel=1e-5, abs=1e-5)
    assert ours.contact_fraction == pytest.approx(reference.contact_fraction, abs=1e-3)
    assert ours.drag == pytest.approx(reference.drag, rel=1e-4)
