"""Follow every element of a Kelvin foundation in time, from given displacements."""

import numpy as np
from schemes import KELVIN

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients.elements.loading_history import Response, follow_line, untouched
from mdr_dask.physics.transients.elements.steps import Schedule, under_elements

TOUCHING = 1e-12  # of its height: tolerance of contact, for rounding


def follow_kelvin(
    height: FloatArray, slope: FloatArray, schedule: Schedule, displacement: FloatArray, depth: float
) -> Response:
    """Follow every element on a periodic line of unit length, from displacements and a depth; time in tau."""
    line = periodic_line(height, slope)
    under, grade = np.empty(height.size), np.empty(height.size)
    under_elements(line, float(schedule.travels[0]), under, grade)
    w = depth + under
    touching = np.abs(w - displacement) < TOUCHING * (abs(depth) + np.abs(under) + displacement)
    u = np.where(touching, w, displacement)
    state = untouched(u.size, 0)._replace(displacement=u, free=u.copy(), touching=touching)
    return follow_line(line, KELVIN, schedule, state, depth)
