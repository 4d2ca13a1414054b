"""Smooth power-law indenters: sweeps and the solver compared with the closed form of friction."""

import numpy as np
import pytest
from references.smooth_indenter import smooth
from schemes import under_indenter
from scipy.integrate import quad

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.problem import Request, solve
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.shapes import PowerLaw
from mdr_dask.physics.surfaces.waves import Waves

SHAPES = ((0.3, 1.0), (0.2, 1.5), (0.5, 2.0), (1.0, 4.0))


@pytest.mark.parametrize("exponent", [1, 1.5, 2, 3])
def test_mapping_keeps_the_load_of_the_body(exponent):
    # the MDR rule itself: g(x) = |x| integral_0^|x| f'(r) / sqrt(x^2 - r^2) dr with f = r^n and r = x sin t
    abel, _ = quad(lambda t: exponent * np.sin(t) ** (exponent - 1), 0, np.pi / 2)
    assert PowerLaw.of_body(1.0, exponent).coefficient == pytest.approx(abel, rel=1e-10)


@pytest.mark.parametrize(("coefficient", "exponent"), [shape for shape in SHAPES if shape[1] != 1.5])
def test_sweep_agrees_with_the_closed_form(coefficient, exponent):
    nodes = 2000
    deborah = np.geomspace(1e-10, 1e2, 13)
    load = np.full(13, 0.02)
    steady = under_indenter(np.zeros(nodes), np.zeros(nodes), coefficient, exponent, deborah, load)
    exact = smooth(load, deborah, coefficient, exponent)
    assert np.all(steady.status == Outcome.CONVERGED)
    # cubic cells hold a cone and a parabola exactly; a quartic to the fourth order
    assert steady.drag == pytest.approx(exact[0], rel=1e-6)
    assert steady.depth == pytest.approx(exact[1], rel=1e-6)
    assert steady.contact_fraction == pytest.approx(exact[2], rel=1e-3)


@pytest.mark.parametrize(("coefficient", "exponent"), SHAPES)
@pytest.mark.parametrize("accuracy", [0.01, 1e-4])
def test_stated_errors_of_a_smooth_indenter_hold(coefficient, exponent, accuracy):
    load, deborah = (grid.ravel() for grid in np.meshgrid([1e-4, 0.02], np.geomspace(1e-6, 10, 8)))
    line = RoughLine(Waves(np.zeros(0, complex), 1000), PowerLaw(coefficient, exponent))
    steady, errors = solve(line, None, deborah, load, Request(accuracy))
    exact = smooth(load, deborah, coefficient, exponent)
    within = np.abs(steady.columns - exact) <= errors + 1e-9 * exact
    assert np.all(within[:2])
    assert np.mean(within) >= 0.93  # the contact of a body with the exponent 1.5 converges irregularly
    assert np.all(errors[0] <= accuracy * exact[0])


def test_time_steps_tend_to_the_closed_form():
    load, deborah = np.full(3, 0.02), np.array([1e-2, 0.1, 1.0])
    exact = smooth(load, deborah, 0.5, 2.0)[0]
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
