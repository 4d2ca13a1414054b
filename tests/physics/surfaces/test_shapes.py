"""Smooth power-law indenters: closed form of friction, compared with quadrature and sweeps."""

import numpy as np
import pytest
from schemes import under_indenter
from scipy.integrate import quad
from scipy.optimize import brentq

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces import shapes as indenter

DEPTH, DRAG, LEADING, TRAILING = range(4)
SHAPES = ((0.3, 1.0), (0.2, 1.5), (0.5, 2.0), (1.0, 4.0))


def solve(load, deborah, coefficient, exponent):
    load, deborah = np.atleast_1d(load).astype(float), np.atleast_1d(deborah).astype(float)
    return np.array(indenter.smooth(load, deborah, coefficient, exponent))


@pytest.mark.parametrize("exponent", [1, 1.5, 2, 3])
def test_mapping_keeps_the_load_of_the_body(exponent):
    # the MDR rule itself: g(x) = |x| integral_0^|x| f'(r) / sqrt(x^2 - r^2) dr with f = r^n and r = x sin t
    abel, _ = quad(lambda t: exponent * np.sin(t) ** (exponent - 1), 0, np.pi / 2)
    assert indenter.PowerLaw.of_body(1.0, exponent).coefficient == pytest.approx(abel, rel=1e-10)


@pytest.mark.parametrize(("coefficient", "exponent"), SHAPES)
@pytest.mark.parametrize("deborah", [1e-4, 1e-1])
def test_closed_form_agrees_with_quadrature(coefficient, exponent, deborah):
    load = 0.02
    depth, drag, a, b, stretch = solve(load, deborah, coefficient, exponent)[:, 0]

    def slope(x):
        return -np.sign(x) * coefficient * exponent * abs(x) ** (exponent - 1)

    def force(x):
        return depth - coefficient * abs(x) ** exponent + deborah * slope(x)

    parts = [(-a, 0.0), (0.0, b)]
    integrals = [
        sum(quad(f, *part, epsabs=0, epsrel=1e-11)[0] for part in parts if part[1] > part[0])
        for f in (force, lambda x: force(x) * slope(x), lambda x: slope(x) ** 2)
    ]
    assert integrals == pytest.approx([load, drag, stretch], rel=1e-9)
    if b > 0 and force(2 * a) < 0:
        assert b == pytest.approx(brentq(force, 1e-300, 2 * a, xtol=1e-300, rtol=1e-14), rel=1e-9)


@pytest.mark.parametrize(("coefficient", "exponent"), [shape for shape in SHAPES if shape[1] != 1.5])
def test_sweep_agrees_with_the_closed_form(coefficient, exponent):
    nodes = 2000
    deborah = np.geomspace(1e-10, 1e2, 13)
    load = np.full(13, 0.02)
    steady = under_indenter(np.zeros(nodes), np.zeros(nodes), coefficient, exponent, deborah, load)
    exact = solve(load, deborah, coefficient, exponent)
    assert np.all(steady.status == Outcome.CONVERGED)
    # cubic cells hold a cone and a parabola exactly; a quartic to the fourth order
    assert steady.drag == pytest.approx(exact[DRAG], rel=1e-6)
    assert steady.depth == pytest.approx(exact[DEPTH], rel=1e-6)
    assert steady.contact_fraction == pytest.approx(exact[LEADING] + exact[TRAILING], rel=1e-3)


def test_time_steps_tend_to_the_closed_form():
    load, deborah = np.full(3, 0.02), np.array([1e-2, 0.1, 1.0])
    exact = solve(load, deborah, 0.5, 2.0)[DRAG]
    errors = [
        np.max(np.abs(under_indenter(np.zeros(n), None, 0.5, 2.0, deborah, load, "backward_euler").drag / exact - 1))
        for n in (2000, 8000)
    ]
    assert errors[1] < 0.3 * errors[0]
    assert errors[0] < 0.05


@pytest.mark.parametrize("scheme", ["hermite", "backward_euler"])
def test_a_contact_that_leaves_the_line_fails(scheme):
    zeros, load = np.zeros(200), np.array([0.005, 0.2, 2.0])
    steady = under_indenter(zeros, zeros, 0.5, 2.0, np.full(3, 1e-3), load, scheme)
    assert steady.status.tolist() == [Outcome.CONVERGED, Outcome.OUTSIDE_LINE, Outcome.OUTSIDE_LINE]


def test_low_velocity_gives_the_law():
    # thesis eq. 3.34 without roughness: mu = 4 v tau 2a <g'^2> G / F_N
    depth, drag, a, b, stretch = solve(0.02, 1e-9, 0.3, 1.0)[:, 0]
    assert a == pytest.approx(indenter.half_width(np.array(0.02), 0.3, 1.0), rel=1e-6)
    assert b == pytest.approx(a, rel=1e-6)
    assert drag == pytest.approx(1e-9 * 2 * a * 0.3**2, rel=1e-6)
    assert depth == pytest.approx(0.3 * a, rel=1e-6)
    assert stretch == pytest.approx(2 * a * 0.3**2, rel=1e-6)
