"""Every element followed through a history of velocity and load: balance of work, order, steady limits."""

import numpy as np
import pytest
from schemes import KELVIN, on_line, rough_line, velocity_jump

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces.cubic_line import CubicLine, indented_line, periodic_line
from mdr_dask.physics.surfaces.shapes import PowerLaw
from mdr_dask.physics.transients.elements.foundation import Foundation, foundation
from mdr_dask.physics.transients.elements.loading_history import Response, follow_line, steady_start
from mdr_dask.physics.transients.elements.steps import Schedule
from mdr_dask.physics.transients.velocity_jump import MarchRequest

POINTS = 50
STANDARD = foundation([3.0], [0.25], 0.0)
SERIES = foundation([3.0, 2.0, 1.0], [0.03, 0.1, 0.25], 0.01)
TIMES = np.geomspace(0.01, 1.4, 12)
SECOND = 1.8  # an order, less what edges that cross elements add


def rough(oversampling: int = 8) -> tuple[np.ndarray, np.ndarray]:
    return rough_line(POINTS, oversampling)


def bowl(nodes: int, coefficient: float = 10.0) -> CubicLine:
    """Return a smooth parabola."""
    return indented_line(np.zeros(nodes), np.zeros(nodes), PowerLaw(coefficient, 2.0))


def moments_to(last: float, deborah: float, nodes: int, cells: float = 0.5) -> np.ndarray:
    step = cells / nodes / deborah
    grown = np.concatenate([[0.0], np.cumsum(np.geomspace(1e-3, 1, 20) * step)])
    return np.unique(np.concatenate([grown, np.arange(grown[-1] + step, last, step), TIMES[last > TIMES]]))


def jump(
    line: CubicLine, solid: Foundation, deborahs: tuple[float, float], load: float, last: float, cells: float = 0.5
) -> tuple[np.ndarray, Response]:
    state, depth, status = steady_start(line, solid, deborahs[0], load)
    assert status == Outcome.CONVERGED
    moments = moments_to(last, deborahs[1], line.height.size - 1, cells)
    one = np.ones(moments.size)
    found = follow_line(
        line, solid, Schedule(moments, moments * deborahs[1], deborahs[1] * one, load * one), state, depth
    )
    assert found.status == Outcome.CONVERGED
    return moments, found


def at_times(line: CubicLine, solid: Foundation, deborahs: tuple[float, float], cells: float = 0.5) -> np.ndarray:
    """Return the drag at 0+ and at `TIMES`."""
    moments, found = jump(line, solid, deborahs, 0.3, 1.5, cells)
    return found.drag[np.append(0, np.searchsorted(moments, TIMES))]


@pytest.mark.parametrize("change", [0.2, -0.2])
def test_second_order_in_the_grid_against_the_march(change: float) -> None:
    """The solver for one jump shares nothing with this one but the line; the immediate value at its own."""
    deborahs = 0.1, 0.1 * (1 + change)
    march = velocity_jump(periodic_line(*rough(64)), 0.3, deborahs, MarchRequest(TIMES, np.pi * POINTS, 96))
    exact = np.append(march.at, march.trace)
    found = [np.abs(at_times(periodic_line(*rough(o)), KELVIN, deborahs) / exact - 1) for o in (4, 16)]
    assert found[1][0] < 2e-4
    assert found[1].max() < 2e-4
    assert found[1].max() < found[0].max() / 4**SECOND


@pytest.mark.parametrize("solid", [KELVIN, SERIES])
def test_second_order_in_the_step(solid: Foundation) -> None:
    line = periodic_line(*rough(8))
    exact = at_times(line, solid, (0.1, 0.12), 1 / 16)
    found = [np.max(np.abs(at_times(line, solid, (0.1, 0.12), cells) / exact - 1)) for cells in (2.0, 0.5)]
    assert found[1] < (5e-5 if solid is KELVIN else 1e-3)
    # without Prony terms a step leaves next to nothing
    assert found[1] < found[0] / (1 if solid is KELVIN else 4**SECOND)


def test_kelvin_ends_in_the_direct_steady_state_at_second_order() -> None:
    errors = []
    for oversampling in (8, 32):
        height, slope = rough(oversampling)
        _, found = jump(periodic_line(height, slope), KELVIN, (0.1, 0.12), 0.3, 12.0, 1.0)
        steady = on_line(height, slope, np.array([0.12]), np.array([0.3]))
        errors.append(abs(found.drag[-1] / steady.drag[0] - 1))
    assert errors[0] < 6e-3
    assert errors[1] < errors[0] / 8


@pytest.mark.parametrize("solid", [KELVIN, SERIES])
def test_full_contact_is_exact(solid: Foundation) -> None:
    """One wave in full contact: the stretch of a Prony term is Q exp(i k s), Q' = i k V - (i k V + 1 / tau) Q."""
    nodes, k, before, after = 1000, 2 * np.pi, 0.05, 0.08
    x = np.arange(nodes) / nodes
    moments, found = jump(periodic_line(np.cos(k * x), -k * np.sin(k * x)), solid, (before, after), 20.0, 1.0)
    exact = 0.5 * solid.viscosity * after * k * k * np.ones(moments.size)
    for modulus, tau in zip(solid.moduli, solid.times, strict=True):
        first, last = (1j * k * deborah / (1j * k * deborah + 1 / tau) for deborah in (before, after))
        wave = last + (first - last) * np.exp(-(1j * k * after + 1 / tau) * moments)
        exact += 0.5 * modulus * np.real(wave * np.conj(1j * k))
    assert np.allclose(found.drag, exact, rtol=1e-5)  # chords of a wave of 1000 nodes
    assert np.allclose(found.contact, 1)


@pytest.mark.parametrize("deborah", [0.1, 10.0, 1e4])
def test_the_mean_strain_of_a_term_is_the_mean_displacement_in_steady_sliding(deborah: float) -> None:
    """The state repeats after each period, even if a term relaxes over many periods."""
    height, slope = rough(32)
    state, _, status = steady_start(periodic_line(height, slope), STANDARD, deborah, 0.3)
    assert status == Outcome.CONVERGED
    assert state.terms.mean() == pytest.approx(state.displacement.mean(), rel=5e-3)


def test_a_master_curve_over_many_decades_has_a_steady_state() -> None:
    times = np.logspace(-15, 0, 20)
    master = foundation(200 * np.exp(-((np.log10(times) + 8) ** 2) / 10), times, 0.0)
    state, _, status = steady_start(periodic_line(*rough(32)), master, 1e4, 0.3)
    assert status == Outcome.CONVERGED
    assert state.displacement.mean() == pytest.approx(0.3, rel=1e-3)


def test_contact_that_leaves_the_line_is_a_status() -> None:
    assert steady_start(bowl(100, 0.1), KELVIN, 0.05, 1.0)[2] == Outcome.OUTSIDE_LINE
    line = bowl(100)
    state, depth, status = steady_start(line, KELVIN, 0.05, 0.05)
    moments = np.linspace(0, 20, 2001)
    one = np.ones(moments.size)
    found = follow_line(
        line, KELVIN, Schedule(moments, 0.05 * moments, 0.05 * one, 0.05 * np.exp(moments)), state, depth
    )
    assert (status, found.status) == (Outcome.CONVERGED, Outcome.OUTSIDE_LINE)


def test_rest_is_static() -> None:
    """Where nothing moves, nothing changes and there is no drag on a smooth hill."""
    line = bowl(400)
    state, depth, _ = steady_start(line, STANDARD, 0.0, 0.05)
    moments = np.linspace(0, 1, 11)
    found = follow_line(line, STANDARD, Schedule(moments, 0 * moments, 0 * moments, 0.05 + 0 * moments), state, depth)
    assert np.allclose(found.depth, found.depth[0], rtol=1e-12)
    assert np.max(np.abs(found.drag)) < 1e-10
    exact = 10 * (3 * 0.05 / (4 * 10)) ** (2 / 3)  # F / (4 G) = (4 / 3) c a^3
    assert found.depth[0] == pytest.approx(exact, rel=1e-5)
    assert depth == pytest.approx(exact, rel=1e-4)  # a sum over the elements


def test_elastic_solid_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a viscoelastic solid"):
        foundation([], [], 0.0)
