"""Velocity jumps: steady limits, order of convergence, comparison with every element followed."""

import numpy as np
import pytest
from schemes import KELVIN, on_line, rough_line, velocity_jump
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients.elements.loading_history import Piece, trace
from mdr_dask.physics.transients.limits import PreparedLine, steady_limits
from mdr_dask.physics.transients.velocity_jump import MarchRequest

POINTS, OVERSAMPLING = 100, 8
DEBORAH, LOAD = 0.1, 0.3
TIMES = np.geomspace(1e-3, 20, 30)
WAVENUMBER = np.pi * POINTS


def line(oversampling: int = OVERSAMPLING) -> tuple[np.ndarray, np.ndarray]:
    return rough_line(POINTS, oversampling)


def solved(height, slope, load, deborahs, times, per_decade=24, wavenumber=WAVENUMBER):
    request = MarchRequest(times, wavenumber, per_decade)
    return velocity_jump(periodic_line(height, slope), load, deborahs, request)


def jump(change: float = 0.2, per_decade: float = 24, oversampling: int = OVERSAMPLING):
    return solved(*line(oversampling), LOAD, (DEBORAH, DEBORAH * (1 + change)), TIMES, per_decade)


@pytest.mark.parametrize("change", [0.2, -0.2])
def test_ends_in_the_direct_steady_state(change: float) -> None:
    found = jump(change)
    height, slope = line()
    steady = on_line(height, slope, np.array([DEBORAH, DEBORAH * (1 + change)]), np.full(2, LOAD))
    assert found.outcome == Outcome.CONVERGED
    assert np.allclose([found.before, found.after], steady.drag, rtol=1e-6)
    assert found.depth[-1] == pytest.approx(steady.depth[1], rel=1e-9)
    relaxing = np.abs(found.trace - found.after)
    # exp(-20), and the last secant step of each moment
    assert relaxing[-1] < 1e-5 * relaxing.max()


@pytest.mark.parametrize(("deborah", "change", "load"), [(0.01, -0.5, 0.3), (0.1, -0.8, 0.03), (0.01, 2.0, 0.03)])
def test_a_large_jump_is_right_from_its_beginning(deborah: float, change: float, load: float) -> None:
    """Where the velocity falls, contact grows behind every patch as the root of the time, before the first step."""
    times = np.geomspace(1e-3, 2, 25)
    ends = deborah, deborah * (1 + change)
    piece = Piece(0.0, np.inf, (ends[1], ends[1]), (load, load))
    followed = trace(periodic_line(*line(oversampling=16)), KELVIN, (deborah, load), [piece], times, 12)
    found = solved(*line(oversampling=4), load, ends, times, 8)
    transient = np.max(np.abs(followed.friction - followed.after))
    assert np.max(np.abs(found.trace / load - followed.friction)) < 0.05 * transient


def test_steps_converge_faster_than_at_first_order() -> None:
    fine = jump(per_decade=192)
    errors = [np.sqrt(np.mean((jump(per_decade=n).trace - fine.trace) ** 2)) for n in (12, 48)]
    assert np.log2(errors[0] / errors[1]) / 2 > 1.2  # single asperities that enter contact converge at first order


def test_grid_converges_at_third_order_or_better() -> None:
    fine = jump(oversampling=64)
    errors = [abs(jump(oversampling=n).at - fine.at) for n in (4, 16)]
    assert np.log2(errors[0] / errors[1]) / 2 > 2.9


def smooth_bump() -> tuple[np.ndarray, np.ndarray]:
    """Return a line with one smooth hill, cos(2 pi x): its contact is one patch."""
    x = np.arange(4000) / 4000
    return np.cos(2 * np.pi * x), -2 * np.pi * np.sin(2 * np.pi * x)


def test_single_hill_against_an_independent_integration() -> None:
    """Elements enter a light contact undeformed, so that the depth follows an ordinary differential equation."""
    deborah, load = 0.01, 0.002
    height, slope = smooth_bump()
    times = np.geomspace(1e-3, 3, 20)
    found = solved(height, slope, load, (deborah, 1.2 * deborah), times, 96, wavenumber=2 * np.pi)

    def edges(d: float, rate: float, v: float) -> tuple[float, float]:
        lead = -np.arccos(min(-d, 1.0)) / (2 * np.pi)  # w = d + cos(2 pi x) = 0 where undeformed elements arrive

        def force(x: float) -> float:
            return float(d + np.cos(2 * np.pi * x) + rate - v * 2 * np.pi * np.sin(2 * np.pi * x))

        return lead, brentq(force, lead, 0.25, xtol=1e-15) if force(lead) > 0 else lead

    def forces(d: float, rate: float, v: float) -> tuple[float, float]:
        a, b = edges(d, rate, v)
        x = np.polynomial.legendre.leggauss(40)
        place, weight = 0.5 * (a + b) + 0.5 * (b - a) * x[0], 0.5 * (b - a) * x[1]
        p, dp = np.cos(2 * np.pi * place), -2 * np.pi * np.sin(2 * np.pi * place)
        f = d + p + rate + v * dp
        return float(weight @ f), float(weight @ (f * dp))

    def rate_of(d: float, v: float) -> float:
        return brentq(lambda rate: forces(d, rate, v)[0] - load, -0.5, 0.5, xtol=1e-14)

    d1 = brentq(lambda d: forces(d, 0.0, deborah)[0] - load, -1 + 1e-6, 0.0, xtol=1e-15)
    v2 = 1.2 * deborah
    truth = solve_ivp(
        lambda _, d: [rate_of(d[0], v2)], (0, 3), [d1], t_eval=times, rtol=1e-10, atol=1e-13, method="LSODA"
    )
    drag = np.array([forces(d, rate_of(d, v2), v2)[1] for d in truth.y[0]])
    at = forces(d1, rate_of(d1, v2), v2)[1]
    assert found.at == pytest.approx(at, rel=1e-8)
    # elements at the trailing edge keep the contact of the moment before: no difference for a jump upwards
    assert np.max(np.abs(found.trace / drag - 1)) < 3e-6


def test_bad_numbers_are_a_status() -> None:
    height, slope = line()
    for load, deborahs in ((np.nan, (0.1, 0.12)), (0.3, (0.1, -0.1)), (0.0, (0.1, 0.12))):
        assert solved(height, slope, load, deborahs, TIMES).outcome == Outcome.INVALID


@pytest.mark.parametrize("change", [-0.5, 0.5])
def test_full_contact_is_exact(change: float) -> None:
    """The drag is D times the mean square of the slope, and changes with the velocity at once (eq. 3.14)."""
    prepared, deborah = PreparedLine.of(periodic_line(*line())), np.array([[0.1, 0.1 * (1 + change)]])
    (found,) = steady_limits(prepared, np.array([100.0]), deborah)
    assert found.is_full
    assert found.at == pytest.approx(found.after, rel=1e-12)
    assert found.after / found.before == pytest.approx(1 + change, rel=1e-12)
