"""Steady sliding of general linear solids: closed forms, energy balance, stated errors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from references.slow_friction import Body, reference, waves
from references.smooth_indenter import smooth
from schemes import material_on_line, on_line, sampled, viscous_state

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.viscoelastic import DEPTH, DRAG, FRACTION, ViscoelasticCase
from mdr_dask.physics.solids import complex_modulus, kelvin, power_law_series, prony, standard_solid
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line

LENGTH, POINTS, RMS = 0.02, 400, 5e-7


def line(oversampling=8, hurst=0.7, realisation=0):
    amplitude = RMS * roughness.amplitudes(POINTS // 2, hurst)
    phase = roughness.phases(1, realisation, POINTS // 2)
    nodes = POINTS * oversampling
    return sampled(amplitude, phase, nodes), LENGTH / nodes, amplitude


@pytest.mark.parametrize("terms", [((4.0,), (0.03,), 0.0), ((3.0, 1.0), (0.1, 1e-3), 0.02), ((), (), 0.05)])
def test_friction_is_what_one_element_loses_along_the_line(terms):
    """Moduli, times and dashpot; the reference sums up the energy lost in steps along a fine line."""
    moduli, times, dashpot = terms
    amplitude, phase = roughness.amplitudes(50, 0.7), roughness.phases(1, 0, 50)
    line = periodic_line(sampled(amplitude, phase, 1600), None)
    values, _, _ = viscous_state(line, prony(1.0, moduli, times, dashpot), 0.3)
    body = Body(np.array(moduli), np.array(times), dashpot)
    exact = reference(waves(amplitude, phase), values[DEPTH], body)
    assert 0.05 < values[FRACTION] < 0.5
    assert exact.load == pytest.approx(0.3, rel=5e-4)
    assert values[DRAG] / 0.3 == pytest.approx(exact.friction, rel=1e-3)


@pytest.mark.parametrize(("velocity", "force"), [(1e-4, 0.01), (0.05, 1.0), (5.0, 100.0), (5.0, 0.01)])
def test_kelvin_limit_is_the_kelvin_solver(velocity, force):
    height, spacing, amplitude = line(16)
    ours = material_on_line(height, spacing, kelvin(1e7, 1e-3), velocity, force)
    deborah, load = np.array([velocity * 1e-3 / LENGTH]), np.array([force / (4e7 * LENGTH)])
    slope = sampled(amplitude, roughness.phases(1, 0, POINTS // 2), height.size, 1)
    kelvin_state = on_line(height, slope, deborah, load)
    wanted = kelvin_state.drag[0] / (load[0] * LENGTH)
    assert ours.friction_coefficient == pytest.approx(wanted, rel=max(3 * ours.error, 2.5e-3))  # a few points touch
    assert ours.depth == pytest.approx(kelvin_state.depth[0], abs=2e-3 * RMS)
    assert ours.contact_fraction == pytest.approx(kelvin_state.contact_fraction[0], abs=5e-3)


@pytest.mark.parametrize(
    "solid",
    [
        kelvin(1e7, 1e-3),
        standard_solid(1e7, 1e9, 1e-3),
        power_law_series(1e7, 1e7, 1e3, 0.3, 1e-2, 1e8).solid,
        prony(1e7, np.full(50, 1e6), np.geomspace(1e-12, 1e8, 50), 10.0),
    ],
    ids=["kelvin", "standard", "power", "fifty"],
)
def test_full_contact_is_the_sum_over_waves(solid):
    """F_x = 2 L sum A_k^2 q_k G''(q_k v), exact: thesis eq. 3.14 for any rheology."""
    velocity, force = 0.03, 1e3
    height, spacing, amplitude = line(16)
    q = 2 * np.pi * np.arange(1, amplitude.size + 1) / LENGTH
    drag = 2 * LENGTH * np.sum(amplitude**2 * q * complex_modulus(solid, q * velocity).imag)
    state = material_on_line(height, spacing, solid, velocity, force)
    assert state.contact_fraction == 1
    assert state.friction_coefficient == pytest.approx(drag / force, rel=state.error + 1e-7)
    assert state.error < 0.01
    assert state.depth == pytest.approx(force / (4 * solid.static_modulus * LENGTH), rel=1e-8)


def test_friction_falls_with_velocity_without_a_floor():
    height, spacing, _ = line()
    solid = prony(1e7, [1e7, 3e7], [1e-3, 1e-2])
    low = [material_on_line(height, spacing, solid, v, 0.1).friction_coefficient / v for v in (1e-8, 1e-12)]
    assert low[0] == pytest.approx(low[1], rel=1e-5)  # next order: v tau / correlation length
    dashpot = kelvin(1e7, (1e7 * 1e-3 + 3e7 * 1e-2) / 1e7)  # fast Prony terms are a dashpot of sum G tau
    assert material_on_line(height, spacing, dashpot, 1e-8, 0.1).friction_coefficient == pytest.approx(
        low[0] * 1e-8, rel=1e-5
    )


@pytest.mark.parametrize("velocity", [1e-3, 0.1, 1.0, 10.0])
def test_smooth_parabola_is_its_closed_form(velocity):
    x = np.linspace(-0.008, 0.008, 4001)
    state = material_on_line(-(x**2) / 0.01, x[1] - x[0], kelvin(1e6, 1e-3), velocity, 1.0, periodic=False)
    load = np.array([1.0 / 4e6])
    drag, depth, _, _ = smooth(load, np.array([velocity * 1e-3]), 100.0, 2.0)[:, 0]
    assert state.status == Outcome.CONVERGED
    assert state.friction_coefficient == pytest.approx(drag / load[0], rel=state.error + 1e-5)
    assert state.depth == pytest.approx(depth, rel=3e-4)
    assert state.error < 0.02


@pytest.mark.parametrize("load", [10.0, 0.64])  # at 0.64 N, the contact leaves the line only where elements enter
def test_contact_that_leaves_the_line_is_a_status(load):
    x = np.linspace(-1e-3, 1e-3, 401)
    state = material_on_line(-(x**2) / 0.01, x[1] - x[0], kelvin(1e6, 1e-3), 0.2, load, periodic=False)
    assert state.status == Outcome.OUTSIDE_LINE
    assert np.isnan(state.friction_coefficient)


def test_flat_line_carries_load_without_friction():
    state = material_on_line(np.zeros(64), 1e-4, standard_solid(1e6, 1e7, 1e-3), 1.0, 1.0)
    assert state.status == Outcome.CONVERGED
    assert state.friction_coefficient == pytest.approx(0, abs=1e-12)
    assert state.depth == pytest.approx(1.0 / (4e6 * 64e-4), rel=1e-9)


def test_a_load_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="the load must be positive and finite, got inf"):
        ViscoelasticCase(kelvin(1e6, 1e-3), np.inf)


def test_a_wave_closes_at_the_load_at_which_it_pushes_everywhere():
    """A Kelvin solid that follows cos(x) pushes by d + cos(x) + 2 pi De sin(x): nowhere less than 0 from
    d = sqrt(1 + (2 pi De)^2) on, its load over modulus and length. Short of that the grids say less than 1, and what
    they are extrapolated to stays a part of the line.
    """
    deborah = 0.05
    phase = 2 * np.pi * np.arange(64) / 64
    wave = periodic_line(np.cos(phase), -2 * np.pi * np.sin(phase))
    closed = np.sqrt(1 + (2 * np.pi * deborah) ** 2)
    loads = closed * np.linspace(0.9, 1.1, 31)
    fractions = np.array([viscous_state(wave, kelvin(0.5, deborah), load)[0][FRACTION] for load in loads])
    assert np.all((fractions > 0.7) & (fractions <= 1.0))
    assert np.all(fractions[loads < 0.97 * closed] < 1.0)
    assert np.all(fractions[loads > 1.03 * closed] == 1.0)


@settings(max_examples=50, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    kind=st.sampled_from(["rough", "spikes", "steps", "one point"]),
    scale=st.floats(-9, 3),
    velocity=st.floats(-9, 6),
    load=st.floats(-6, 4),
    terms=st.integers(0, 20),
    viscosity=st.floats(-12, 3),
)
def test_any_line_and_any_solid_end_in_a_state_or_a_status(seed, kind, scale, velocity, load, terms, viscosity):
    """Fifteen decades of everything: the load is carried, and friction resists."""
    random = np.random.default_rng(seed)
    height = {
        "rough": np.cumsum(random.standard_normal(256)),
        "spikes": np.where(random.uniform(size=256) < 0.02, random.exponential(100, 256), 0.0),
        "steps": np.repeat(random.standard_normal(16), 16),
        "one point": np.where(np.arange(256) == seed % 256, 1.0, 0.0),
    }[kind] * 10**scale
    moduli = 10 ** random.uniform(-3, 4, terms)
    solid = prony(1.0, moduli, 10 ** random.uniform(-10, 10, terms), 10**viscosity)
    force = 4 * 256 * 10**scale * 10**load
    state = material_on_line(height, 1.0, solid, 10**velocity, force)
    if state.status == Outcome.DEPTH_NOT_FOUND:
        # the dashpot alone holds the load on a part of a cell whose depth is lost in the rounding of the heights
        assert load - velocity - viscosity < -11
        return
    assert state.status == Outcome.CONVERGED
    assert 0 < state.contact_fraction <= 1
    # friction is dissipation: rounding of the elastic part apart, it cannot be negative
    assert state.friction_coefficient >= -1e-9 * 10**scale * 100
    # scaling: heights and load by the same number leave the contact and multiply the friction by it
    twice = material_on_line(2 * height, 1.0, solid, 10**velocity, 2 * force)
    assert twice.contact_fraction == pytest.approx(state.contact_fraction, rel=1e-3)
