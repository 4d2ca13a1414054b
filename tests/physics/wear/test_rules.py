from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from mdr_dask.physics.mdr.revolution import PowerProfile, from_table
from mdr_dask.physics.wear import rules as wear

PARABOLA, CONE = PowerProfile(2.0), PowerProfile(1.0)


def test_checked_limit_of_the_parabola():
    worn = wear.limit(PARABOLA, 0.455)
    assert worn.contact_radius == pytest.approx(1.24835394, abs=5e-9)  # printed digits
    assert worn.wear_volume == pytest.approx(0.9181587, abs=5e-8)


def limit_of_a_parabola(t):
    """Return (c, a) by t = arccos(c/a)."""
    a = np.sqrt(2.0 / (1.0 + np.sinc(2.0 * t / np.pi)))
    return a * np.cos(t), a


def limit_of_a_cone(t):
    """Return (c, a) by t = arccos(c/a) (thesis eq. 6.17)."""
    return t / np.tan(t), t / np.sin(t)


@pytest.mark.parametrize("t", [0.05, 0.4, 1.0, 1.4, 1.55])
def test_limit_radius_is_the_parametric_form(t):
    for profile, form in ((PARABOLA, limit_of_a_parabola), (CONE, limit_of_a_cone)):
        c, a = form(t)
        assert wear.limit_radius(profile, float(c)) == pytest.approx(float(a), rel=1e-9)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0, 3.3, 10.0])
@pytest.mark.parametrize("c", [0.02, 0.455, 0.97])
def test_limit_leaves_no_step_and_conserves_volume(exponent, c):
    worn, profile = wear.limit(PowerProfile(exponent), c), PowerProfile(exponent)
    a = worn.contact_radius
    at_edge = worn.height(np.array([a * (1 - 1e-12)]))[0] - profile.height(np.array(a))
    assert abs(at_edge) < 1e-7 * (1 - c**exponent)  # of an infinite slope at the axis and a small c

    def ring(r):
        return 2 * np.pi * r * float(worn.height(np.array([r]))[0] - profile.height(np.array(r)))

    assert worn.wear_volume == pytest.approx(quad(ring, c, a, epsabs=1e-11)[0], rel=1e-6)  # the root at c limits quad


def test_limit_pressure_lives_on_the_stick_area_only():
    worn = wear.limit(PARABOLA, 0.455)
    p = worn.pressure(np.array([0.1, 0.3, 0.5, 0.9]))
    r = np.array([0.1, 0.3])
    exact = 2 / np.pi * np.sqrt(0.455**2 - r**2) + (1 - 0.455**2) / np.pi / np.sqrt(0.455**2 - r**2)
    np.testing.assert_allclose(p[:2], exact, rtol=1e-8)
    np.testing.assert_allclose(p[2:], 0, atol=1e-10)


@pytest.mark.parametrize("exponent", [1.0, 2.0, 3.5])
def test_fast_rule_starts_at_the_virgin_body_and_ends_at_the_limit(exponent):
    profile = PowerProfile(exponent)
    r = np.linspace(0.0, 1.5, 40)
    np.testing.assert_allclose(wear.fast(profile, 0.4, 0.0).height(r), profile.height(r), atol=1e-14)
    end, limit = wear.fast(profile, 0.4, 60.0), wear.limit(profile, 0.4)
    np.testing.assert_allclose(end.height(r), limit.height(r), atol=1e-8)
    assert end.wear_volume == pytest.approx(limit.wear_volume, rel=1e-8)


def change(x, n, c, rest):
    """g - g0 of the rule as the equations have it."""
    eta, start = 1 - c**n, (x**n - c**n) / (1 - c**n)
    inside = eta * (start / (start + (1 - start) * rest) - start)
    return inside if x <= 1 else (x**n - 1) * (rest - 1)


def quadrature(n, c, cycles, xi=0.8):
    """Scar, volume and force by a bracketed root and 80 Gauss nodes in each of many pieces of x = r cos(phi)."""
    rest = np.exp(-xi * cycles / wear.limit_radius(PowerProfile(n), c))
    node, weight = np.polynomial.legendre.leggauss(80)
    inner = [c + (1 - c) * 10.0**-k for k in range(9, -1, -1)]

    def integral(term, ends):
        return sum(
            0.5
            * (high - low)
            * sum(w * term(0.5 * (low + high + (high - low) * t)) for t, w in zip(node, weight, strict=True))
            for low, high in pairwise(ends)
        )

    def worn(r, moment):
        def term(phi):
            return change(r * np.cos(phi), n, c, rest) * (r * np.sin(phi)) ** (2 * moment)

        return integral(term, [0.0, *(np.arccos(x / r) for x in (*inner[::-1], c) if x < r)])

    limit = wear.limit_radius(PowerProfile(n), c)
    scar = brentq(lambda r: worn(r, 0), 1.0 + 1e-9, limit) if worn(limit, 0) < 0 else limit
    load = c - c ** (n + 1) / (n + 1) + integral(lambda x: 1 - x**n - change(x, n, c, rest), [c, *inner])
    return scar, 4 * worn(scar, 1), 2 * load


@pytest.mark.parametrize("exponent", [1.0, 2.0, 2.7])
@pytest.mark.parametrize("cycles", [0.3, 4.0])
@pytest.mark.parametrize("c", [0.05, 0.455, 0.9])
def test_the_fast_rule_by_quadrature(exponent, cycles, c):
    """Compiled cases and single contacts against the rule's own equations, independently integrated."""
    expected = quadrature(exponent, c, cycles)
    radius = wear.limit_cases(exponent, c)[0]
    fast = wear.fast(PowerProfile(exponent), c, cycles, 0.8)
    single = (fast.contact_radius, fast.wear_volume, fast.normal_force)
    for found in (wear.fast_cases(exponent, c, cycles, 0.8, radius), single):
        np.testing.assert_allclose([float(part) for part in found], expected, rtol=2e-6)  # the stated relative error


def test_scar_beyond_the_table():
    r = np.linspace(0, 1.1, 60)
    with pytest.raises(ValueError, match="beyond the table"):
        wear.limit(from_table(r, r**2 / 2, 1.0), 0.3)


@pytest.mark.parametrize("c", [0.0, 1.0, -0.3, np.nan])
def test_no_partial_slip(c):
    with pytest.raises(ValueError, match="gross slip"):
        wear.limit(PARABOLA, c)
