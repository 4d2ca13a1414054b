"""Film formulas: closed forms, and constants derived independently."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from mdr_dask.physics.lubrication import film_formulas as film

W, U, G = 2.0452e-5, 1e-11, 5007.0


def test_hertz_pressure_carries_the_load():
    contact = film.hertz_line(8e4, 115.385e9, 0.025)
    # an elliptic distribution over 2a: pi/2 p0 a; its curvature: p0 = E* a/(2R)
    assert np.pi / 2 * contact.pressure * contact.half_width == pytest.approx(8e4, rel=1e-12)
    assert contact.pressure == pytest.approx(115.385e9 * contact.half_width / (2 * 0.025), rel=1e-12)


@pytest.mark.parametrize(
    "formula", [film.PAN_HAMROCK_CENTRAL, film.PAN_HAMROCK_MINIMUM, film.DOWSON_HIGGINSON_MINIMUM], ids=lambda f: f.name
)
def test_formula_is_a_power_law_and_reports_extrapolation(formula):
    point = np.array([5e-5, 5e-12, 4000.0])
    exponents = (formula.load, formula.speed, formula.material)
    for i, exponent in enumerate(exponents):
        moved = point.copy()
        moved[i] *= 2
        assert formula(*moved) / formula(*point) == pytest.approx(2**exponent, rel=1e-12)
    assert formula.outside(*point) == ""
    assert "extrapolated: W lies outside" in formula.outside(1e-6, 5e-12, 4000.0)
    assert "extrapolated: U lies outside" in formula.outside(5e-5, 1e-8, 4000.0)
    assert "extrapolated: G lies outside" in formula.outside(5e-5, 5e-12, 300.0)


def _reynolds_integral(t, c):
    """Integral of cos^2 - c cos^4 from -pi/2 to t: the pressure of a rigid parabola, x = sqrt(2 R h0) tan t."""

    def primitive(s):
        return s / 2 + np.sin(2 * s) / 4 - c * (3 * s / 8 + np.sin(2 * s) / 4 + np.sin(4 * s) / 32)

    return primitive(t) - primitive(-np.pi / 2)


def _exit_angle():
    return brentq(lambda t: _reynolds_integral(t, 1 / np.cos(t) ** 2), 0.1, 1.2, xtol=1e-15)


def test_kapitza_constant_from_the_rigid_isoviscous_solution():
    end = _exit_angle()
    c = 1 / np.cos(end) ** 2
    load, _ = quad(lambda t: _reynolds_integral(t, c) / np.cos(t) ** 2, -np.pi / 2 + 1e-8, end, epsrel=1e-10)
    assert 24 * load == pytest.approx(film.RIGID_ISOVISCOUS, rel=1e-6)


def test_blok_constant_from_the_rigid_isoviscous_solution():
    end = _exit_angle()
    highest = _reynolds_integral(-end, 1 / np.cos(end) ** 2)
    assert (12 * np.sqrt(2) * highest) ** (2 / 3) == pytest.approx(film.RIGID_PIEZOVISCOUS, rel=1e-6)


def test_limits_depend_on_two_numbers_only():
    """At constant M and L the film in Moes' units cannot change, whatever W, U, G."""
    M, L = film.moes_parameters(W, U, G)
    for factor in (1e-3, 1e2):
        speed = U * factor
        load, material = M * np.sqrt(2 * speed), L / (2 * speed) ** 0.25
        films = film.limiting_films(load, speed, material) / np.sqrt(2 * speed)
        expected = film.limiting_films(W, U, G) / np.sqrt(2 * U)
        # the fourth is a regression, whose rounded exponents keep it only roughly
        np.testing.assert_allclose(films[:3], expected[:3], rtol=1e-12)
        np.testing.assert_allclose(films[3], expected[3], rtol=0.15)
