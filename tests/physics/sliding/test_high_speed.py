"""Region IV: the closed form of friction at very high velocity (docs/high-speed.md)."""

import numpy as np
import pytest
from scipy.optimize import brentq

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.problem import PronyTerms, Request, solve
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.shapes import PowerLaw
from mdr_dask.physics.surfaces.waves import Waves

FINE = 1024


def rough(realisation, points=64, hurst=0.7, body=None):
    factors = roughness.phase_factors(5, realisation, points // 2)
    return RoughLine(Waves(0.5 * roughness.amplitudes(points // 2, hurst) * factors, points), body)


def summit_curvature(line):
    height, cell = line.roughness.heights(line.points * FINE), 1 / (line.points * FINE)
    top = int(np.argmax(height))
    before, at, after = height[[top - 1, top, (top + 1) % height.size]]
    return (2 * at - before - after) / cell**2


def tip(line, deborah, loads):
    """Friction of a parabolic tip in units of height over length, (2/3) sqrt(kappa F_N / (2 eta v))."""
    return 2 / 3 * np.sqrt(summit_curvature(line) * 4 * loads / (2 * deborah))


@pytest.mark.parametrize("realisation", range(2))
def test_a_viscous_solid_is_in_contact_with_one_tip(realisation):
    """mu = (2/3) sqrt(kappa F / (2 eta v)), and the slope in contact is sqrt(3)/2 of it."""
    line, deborah, loads = rough(realisation), np.array([1e5, 4e5]), np.array([0.05, 0.05])
    steady, errors = solve(line, None, deborah, loads, Request(0.005))
    friction = steady.drag / loads
    assert np.all(steady.status == Outcome.CONVERGED)
    assert friction == pytest.approx(tip(line, deborah, loads), rel=0.01)
    assert friction[0] / friction[1] == pytest.approx(2.0, rel=0.005)
    assert friction / steady.contact_slope == pytest.approx(2 / np.sqrt(3), rel=0.01)
    assert np.all(errors[0] / steady.drag < 0.01)


@pytest.mark.parametrize("realisation", range(2))
def test_the_general_solver_agrees_within_its_errors(realisation):
    """Its straight cells resolve the tip up to De = 1e3 or so; beyond, the errors that it states are large."""
    line, deborah, loads = rough(realisation), np.array([3e2, 1e3, 1e5]), np.full(3, 0.05)
    steady, errors = solve(line, PronyTerms(), deborah, loads, Request(0.005))
    expected = tip(line, deborah, loads)
    assert np.all(np.abs(steady.drag / loads - expected) <= errors[0] / loads + 0.05 * expected)
    assert errors[0, 0] < 0.2 * steady.drag[0]


def glassy_limit(line, terms, load):
    """Return mu v for v to infinity of a solid with a glassy modulus: elastic contact, weakly relaxing.

    In units of the line, with tau_m v / L = D_m: mu = sum(G_m / D_m) Var(u) / (G_inf <u>).
    """
    height = line.roughness.heights(line.points * 256)
    glass = 1 + sum(terms.moduli)
    # load = <u> in units of G_inf; the glassy foundation carries it above the remaining displacement u0
    shift = brentq(lambda p: np.mean(np.maximum(p + height, 0)) * glass - load, -height.max(), load + height.max())
    displacement = load * (glass - 1) / glass + np.maximum(shift + height, 0)
    assert displacement.mean() == pytest.approx(load, rel=1e-6)
    rate = sum(g / d for g, d in zip(terms.moduli, terms.deborah, strict=True))
    return rate * displacement.var() / load


@pytest.mark.parametrize("terms", [PronyTerms((50.0,), (1.0,)), PronyTerms((5.0, 20.0), (1.0, 30.0))])
def test_a_solid_with_a_glassy_modulus_falls_faster(terms):
    """mu falls as 1/v: the contact is that of the glassy foundation and no longer depends on the velocity."""
    line, load = rough(1), np.array([0.1])
    for speed in (1e4, 1e5):
        fast = PronyTerms(terms.moduli, tuple(d * speed for d in terms.deborah))
        steady, _ = solve(line, fast, np.zeros(1), load, Request(0.005))
        friction = steady.drag[0] / load[0]
        assert friction * speed == pytest.approx(glassy_limit(line, terms, load[0]), rel=0.01)


@pytest.mark.parametrize("terms", [None, PronyTerms()])
def test_a_smooth_parabola_has_the_same_limit(terms):
    line, deborah, loads = rough(0, body=PowerLaw(20.0, 2.0)), np.array([1e6]), np.array([1e-2])
    smooth = RoughLine(Waves(np.zeros(0, complex), 64), line.body)
    steady, errors = solve(smooth, terms, deborah, loads, Request(0.005))
    expected = 2 / 3 * np.sqrt(40.0 * 4 * loads / (2 * deborah))
    assert np.all(np.abs(steady.drag / loads - expected) <= errors[0] / loads + 0.01 * expected)


@pytest.mark.parametrize("speed", [1e9, 1e11])
def test_drag_that_is_lost_to_rounding_has_a_large_error_or_a_status(speed):
    terms, load = PronyTerms((50.0,), (1.0,)), np.array([0.1])
    fast = PronyTerms(terms.moduli, tuple(d * speed for d in terms.deborah))
    steady, errors = solve(rough(1), fast, np.zeros(1), load, Request(0.005))
    if steady.status[0] == Outcome.CONVERGED:
        missed = abs(steady.drag[0] / load[0] - glassy_limit(rough(1), terms, load[0]) / speed)
        assert missed <= errors[0, 0] / load[0]
