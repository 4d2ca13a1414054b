"""Solve steady sliding and velocity jumps on a line given by heights and slopes at its nodes."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import refine
from mdr_dask.physics.sliding import steady, viscoelastic
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import CubicLine, indented_line, periodic_line
from mdr_dask.physics.surfaces.shapes import PowerLaw
from mdr_dask.physics.surfaces.waves import Waves
from mdr_dask.physics.transients.elements.foundation import foundation
from mdr_dask.physics.transients.limits import PreparedLine, steady_limits
from mdr_dask.physics.transients.velocity_jump import jump_between

KELVIN = foundation([], [], 1.0)


def sampled(amplitude, phase, nodes, derivative=0):
    """Return the heights or slopes at equidistant nodes of a line of waves."""
    waves = Waves(0.5 * amplitude * np.exp(1j * phase), 2 * amplitude.size)
    return waves.slopes(nodes) if derivative else waves.heights(nodes)


def rough_line(points, oversampling, hurst=0.7, seed=3, realisation=1):
    """Return heights and slopes of a generated line, on some nodes for each point."""
    amplitude, phase = roughness.amplitudes(points // 2, hurst), roughness.phases(seed, realisation, points // 2)
    return tuple(sampled(amplitude, phase, points * oversampling, order) for order in (0, 1))


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
    (drag, depth, fraction, slope), errors, status = viscous_state(line, travelling, load)
    error = errors[0] / abs(drag) if drag else errors[0]
    return InUnits(drag / load / length, depth, fraction, slope / length, error, status)


def viscous_state(line, solid, load):
    """Return values, errors and status of a general solid on a line, whose number of cells is a multiple of four."""
    cells = line.enter.size
    top = int(np.argmax(line.height[:cells])) if line.periodic else 0
    height = np.append(np.roll(line.height[:cells], -top), line.height[top]) if line.periodic else line.height
    case = viscoelastic.ViscoelasticCase(solid, load)
    case.on(height[::4], line.periodic)
    floors = np.array([0.0, np.std(height), 0.0, 0.0])
    found = refine(
        lambda stride, _: case.on(height[::stride], line.periodic), 1, (2, 1), np.inf, viscoelastic.ORDER, floors=floors
    )
    return np.concatenate(found.values), found.errors[:, 0], Outcome(int(found.outcome[0]))


def velocity_jump(line, load, deborah, request):
    """Return the steady limits and the transient of a velocity jump of a Kelvin foundation."""
    prepared, loads, numbers = PreparedLine.of(line), np.array([load]), np.array([deborah])
    (limits,) = steady_limits(prepared, loads, numbers)
    jump = jump_between(prepared, load, numbers[0], limits, request)
    return SimpleNamespace(**limits._asdict() | jump._asdict())
