"""Solve steady sliding and velocity jumps on a line given by heights and slopes at its nodes."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding import steady, viscoelastic
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import CubicLine, indented_line, periodic_line
from mdr_dask.physics.surfaces.shapes import PowerLaw
from mdr_dask.physics.transients.elements.foundation import foundation
from mdr_dask.physics.transients.limits import PreparedLine, steady_limits
from mdr_dask.physics.transients.velocity_jump import jump_between

KELVIN = foundation([], [], 1.0)


def rough_line(points, oversampling, hurst=0.7, seed=3, realisation=1):
    """Return heights and slopes of a generated line, on some nodes for each point."""
    amplitude, phase = roughness.amplitudes(points // 2, hurst), roughness.phases(seed, realisation, points // 2)
    return tuple(roughness.line(amplitude, phase, points * oversampling, order) for order in (0, 1))


def on_line(height, slope, deborah, loads, scheme="hermite", **options):
    return _solved(periodic_line(height, slope if scheme == "hermite" else None), deborah, loads, scheme, options)


def under_indenter(height, slope, coefficient, exponent, deborah, loads, scheme="hermite", **options):
    line = indented_line(height, slope if scheme == "hermite" else None, PowerLaw(coefficient, exponent))
    return _solved(line, deborah, loads, scheme, options)


def _solved(line, deborah, loads, scheme, options):
    solve = steady.stepped_sliding if scheme == "backward_euler" else steady.steady_sliding
    return solve(line, deborah, loads, **options)


@dataclass(frozen=True)
class InUnits:
    """A steady state of a general solid in units, with the relative error of its friction."""

    friction_coefficient: float
    depth: float
    contact_fraction: float
    contact_slope: float
    error: float
    status: Outcome


def material_on_line(height, spacing, solid, velocity, normal_force, periodic=True):
    """Solve any linear solid, in units: heights and spacing in m, m/s, N."""
    height = np.asarray(height, dtype=float)
    rise = np.diff(height)
    line = periodic_line(height, None) if periodic else CubicLine(height, rise, rise, False, False)
    length = line.enter.size * spacing
    pace = velocity / length
    travelling = replace(solid, times=solid.times * pace, viscosity=solid.viscosity * pace)
    load = normal_force / (4 * solid.static_modulus * length)
    found = viscoelastic.steady_viscoelastic_sliding(line, travelling, load)
    drag, depth, fraction, slope = found.values
    error = found.errors[0] / abs(drag) if drag else found.errors[0]
    return InUnits(drag / load / length, depth, fraction, slope / length, error, found.status)


def velocity_jump(line, load, deborah, request):
    """Return the steady limits and the transient of a velocity jump of a Kelvin foundation."""
    prepared, loads, numbers = PreparedLine.of(line), np.array([load]), np.array([deborah])
    (limits,) = steady_limits(prepared, loads, numbers)
    jump = jump_between(prepared, load, numbers[0], limits, request)
    return SimpleNamespace(**limits._asdict() | jump._asdict())
