"""Histories of velocity and load, compared with slow independent integrations by scipy."""

from collections.abc import Callable

import numpy as np
import pytest
from schemes import KELVIN
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces.cubic_line import CubicLine, indented_line, periodic_line, without_kinks
from mdr_dask.physics.surfaces.shapes import PowerLaw
from mdr_dask.physics.transients.elements.foundation import Foundation, foundation
from mdr_dask.physics.transients.elements.loading_history import Response, follow_line, steady_start
from mdr_dask.physics.transients.elements.steps import Schedule

Array = np.ndarray
STANDARD = foundation([3.0], [0.25], 0.0)
TWO_TERMS = foundation([3.0, 1.5], [0.25, 0.05], 0.0)
LOAD, LAST = 0.05, 2.0
SECOND, FIRST = 1.8, 0.9  # orders, less what edges that cross elements add; a cone's kink is rounded over a cell
TIMES = np.geomspace(0.02, 0.95 * LAST, 14)


def deborah(time: Array) -> Array:
    """Return a speed that jumps at 0 and grows smoothly."""
    return 0.06 + 0.02 * time / LAST


def travel(time: Array) -> Array:
    return 0.06 * time + 0.01 * time**2 / LAST


def load(time: Array) -> Array:
    return LOAD * (1 + 0.5 * time / LAST)


def followed(line: CubicLine, solid: Foundation, before: float, cells: float = 0.5) -> tuple[Array, Response]:
    """Follow the course above from a steady state, in steps that begin finely."""
    state, depth, status = steady_start(line, solid, before, LOAD)
    assert status == Outcome.CONVERGED
    step = cells / (line.height.size - 1) / 0.08
    grown = np.concatenate([[0.0], np.cumsum(np.geomspace(1e-3, 1, 20) * step)])
    moments = np.concatenate([grown, np.linspace(grown[-1], LAST, int((LAST - grown[-1]) / step) + 2), TIMES])
    moments = np.unique(moments)
    found = follow_line(line, solid, Schedule(moments, travel(moments), deborah(moments), load(moments)), state, depth)
    assert found.status == Outcome.CONVERGED
    return moments, found


def order(errors: list[float], refinement: float) -> float:
    return float(np.log(errors[0] / errors[-1]) / np.log(refinement))


def at_rest_then_slide(
    solid: Foundation, elements: int, height: Callable[[Array], Array], span: float
) -> tuple[Array, Array]:
    """Integrate the Prony terms of elements over a span of the body from rest on; return drag and depth at `TIMES`.

    Without a dashpot u = max(w, rest), where rest is the displacement without force, and the Prony terms follow u.
    """
    g, tau = solid.moduli, solid.times
    glass = 1 + g.sum()
    width = span / elements
    x = (np.arange(elements) + 0.5) * width - (span - 0.5)

    def place(under: Array, rest: Array, force: float) -> float:
        def excess(d: float) -> float:
            return float(glass * np.maximum(d + under - rest, 0).sum() * width - force)

        low = float((rest - under).min())
        return float(brentq(excess, low, low + 2 * force + 1, xtol=1e-15, rtol=1e-13))

    def moved(time: float, terms: Array) -> tuple[Array, Array, float]:
        under, rest = height(x + travel(time)), g @ terms / glass
        d = place(under, rest, load(time))
        return np.maximum(d + under, rest), rest, d

    def rates(time: float, state: Array) -> Array:
        terms = state.reshape(g.size, elements)
        u, _, _ = moved(time, terms)
        return ((u - terms) / tau[:, None]).ravel()

    under = height(x)
    static = brentq(lambda d: np.maximum(d + under, 0).mean() * span - LOAD, -under.max(), 20, xtol=1e-15)
    start = np.tile(np.maximum(static + under, 0), (g.size, 1)).ravel()
    solved = solve_ivp(rates, (0, LAST), start, t_eval=TIMES, rtol=1e-7, atol=1e-9, max_step=0.02)
    drags, depths = [], []
    for time, state in zip(TIMES, solved.y.T, strict=True):
        u, rest, d = moved(time, state.reshape(g.size, elements))
        ends = height(x + travel(time) + 0.5 * width), height(x + travel(time) - 0.5 * width)
        drags.append(glass * np.sum((u - rest) * (ends[0] - ends[1])))
        depths.append(d)
    return np.array(drags), np.array(depths)


def test_terms_under_a_wave_in_partial_contact() -> None:
    solid = TWO_TERMS
    k = 2 * np.pi
    drag, depth = at_rest_then_slide(solid, 2400, lambda x: np.cos(k * x), 1.0)
    errors = []
    for nodes in (100, 400):
        x = np.arange(nodes) / nodes
        moments, found = followed(periodic_line(np.cos(k * x), -k * np.sin(k * x)), solid, 0.0)
        assert found.contact.max() < 0.5
        errors.append(np.max(np.abs(np.interp(TIMES, moments, found.drag) - drag)) / np.max(np.abs(drag)))
        off = np.max(np.abs(np.interp(TIMES, moments, found.depth) - depth))
    assert errors[-1] < 5e-4
    assert order(errors, 4) > SECOND
    assert off < 3e-5


@pytest.mark.parametrize(("coefficient", "exponent"), [(2.0, 1.0), (80.0, 4.0)])
def test_terms_under_indenters(coefficient: float, exponent: float) -> None:
    def height(x: Array) -> Array:
        return -coefficient * np.abs(x) ** exponent

    drag, depth = at_rest_then_slide(STANDARD, 2000, height, 1.25)
    errors = []
    for nodes in (200, 800):
        line = without_kinks(indented_line(np.zeros(nodes), np.zeros(nodes), PowerLaw(coefficient, exponent)))
        moments, found = followed(line, STANDARD, 0.0)
        errors.append(np.max(np.abs(np.interp(TIMES, moments, found.drag) - drag)) / np.max(np.abs(drag)))
        off = np.max(np.abs(np.interp(TIMES, moments, found.depth) / depth - 1))
    assert errors[-1] < 5e-4
    assert order(errors, 4) > SECOND
    assert off < 3e-5


@pytest.mark.parametrize(("coefficient", "exponent"), [(2.0, 1.0), (80.0, 4.0)])
def test_dashpot_under_indenters(coefficient: float, exponent: float) -> None:
    """Elements enter undeformed and leave where the force vanishes: the depth follows an ordinary equation."""
    node, weight = np.polynomial.legendre.leggauss(40)

    def slope(x: Array) -> Array:
        return -coefficient * exponent * np.sign(x) * np.abs(x) ** (exponent - 1)

    def forces(d: float, rate: float, v: float) -> tuple[float, float]:
        def force(x: Array) -> Array:
            return d - coefficient * np.abs(x) ** exponent + rate + v * slope(x)

        lead = (d / coefficient) ** (1 / exponent)
        trail = 0.0 if force(1e-12) <= 0 else brentq(force, 1e-12, 10.0, xtol=1e-15)
        load, drag = 0.0, 0.0
        for low, high in ((-lead, 0.0), (0.0, trail)):
            x, wide = 0.5 * (low + high) + 0.5 * (high - low) * node, 0.5 * (high - low) * weight
            load += float(wide @ force(x))
            drag += float(wide @ (force(x) * slope(x)))
        return load, drag

    def rate_of(d: float, v: float, force: float) -> float:
        return float(brentq(lambda rate: forces(d, rate, v)[0] - force, -2 * d, 5.0, xtol=1e-15))

    start = brentq(lambda d: forces(d, 0.0, 0.05)[0] - LOAD, 1e-3, 1, xtol=1e-15)
    solved = solve_ivp(
        lambda t, d: [rate_of(d[0], deborah(t), load(t))],
        (0, LAST),
        [start],
        t_eval=TIMES,
        rtol=1e-10,
        atol=1e-13,
        method="LSODA",
    )
    drag = [forces(d, rate_of(d, deborah(t), load(t)), deborah(t))[1] for t, d in zip(TIMES, solved.y[0], strict=True)]
    instant = forces(start, rate_of(start, deborah(0.0), LOAD), deborah(0.0))[1]
    errors, first = [], []
    for nodes in (200, 800):
        line = without_kinks(indented_line(np.zeros(nodes), np.zeros(nodes), PowerLaw(coefficient, exponent)))
        moments, found = followed(line, KELVIN, 0.05)
        errors.append(np.max(np.abs(np.interp(TIMES, moments, found.drag) / np.array(drag) - 1)))
        first.append(abs(found.drag[0] / instant - 1))
        off = np.max(np.abs(np.interp(TIMES, moments, found.depth) / solved.y[0] - 1))
    for found_errors in (errors, first):
        assert found_errors[-1] < (1e-2 if exponent == 1 else 2e-4)
        assert order(found_errors, 4) > (FIRST if exponent == 1 else SECOND)
    assert off < 3e-5
