"""Follow every element of a Kelvin foundation in time, from given displacements."""

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients.elements.foundation import KELVIN
from mdr_dask.physics.transients.elements.loading_history import Response, follow_line, untouched
from mdr_dask.physics.transients.elements.steps import Schedule, under_elements

TOUCHING = 1e-12  # of its height: tolerance of contact, for rounding


def follow_kelvin(
    height: FloatArray, slope: FloatArray, schedule: Schedule, displacement: FloatArray, depth: float
) -> Response:
    """Follow every element of a Kelvin foundation on a periodic line; time in tau.

    Parameters
    ----------
    height, slope : array, shape (n,)
        Profile of unit length, as in :func:`~mdr_dask.physics.surfaces.cubic_line.periodic_line`.
    schedule : Schedule
        As in :func:`follow_line`; time in tau.
    displacement : array, shape (n,)
        Of every element at the first moment; the profile stands over element j at ``x_j + travel``.
    depth : float
        Depth at the first moment.
    """
    line = periodic_line(height, slope)
    under, grade = np.empty(height.size), np.empty(height.size)
    under_elements(line, float(schedule.travels[0]), under, grade)
    w = depth + under
    touching = np.abs(w - displacement) < TOUCHING * (abs(depth) + np.abs(under) + displacement)
    u = np.where(touching, w, displacement)
    state = untouched(u.size, 0)._replace(displacement=u, free=u.copy(), touching=touching)
    return follow_line(line, KELVIN, schedule, state, depth)
