"""Bound on the distance of a worn contact at constant depth from its limiting shape, in closed form.

With s the slip over its amplitude, ds/dN = p s / eta. Wear at other radii adds pressure to a radius: of two bodies
with s_1 <= s_2 everywhere and s_1 = s_2 at one radius, the second has at least the pressure of the first there (maximum
principle of the half-space). So a function that starts below the virgin slip, and grows no faster than by its own
pressure, stays below the true slip. One such function is the half-integral of y = m min(y0 / y0(x_1), 1) for any
x_1 > c, with dm/dN = m (1 - m) / (pi w) from m = y0(x_1) on:

* its relative growth is at most (1 - m) / (pi w), with w^2 = a^2 - c^2;
* its image jumps from m to 1 at the radius a of the final scar. The pressure of this jump alone is
  (1 - m) / (pi sqrt(a^2 - r^2)), which is at least that growth.

The true slip lies between it and that of the limit, (2 / pi) arccos(c / r). The force falls while the body wears.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.wear.rules import limit
from mdr_dask.physics.wear.worn import Worn

#: How fast x_1 - c decays over N / (pi w), about the best where y0 rises linearly; what N / (pi w) counts at most.
LAYER, MOST = 2.0 / 3.0, 600.0


def nearly_limit(profile: Profile, stick_radius: float, cycles: Sequence[float], accuracy: float) -> dict[float, Worn]:
    """Return the shape that ends all wear for those N after which it is right to an accuracy, at constant depth.

    Parameters
    ----------
    profile : Profile
        The virgin body, whose image rises.
    stick_radius : float
        c, between 0 and 1.
    cycles : sequence of float
        N >= 0.
    accuracy : float
        Largest relative error of volume and force; that of f, over what can wear, is less.
    """
    c = stick_radius
    soonest = -math.pi * math.sqrt((1.0 - c) * (1.0 + c)) * math.log(accuracy) / (1.0 - LAYER)
    late = [number for number in cycles if number >= soonest]
    if not late:
        return {}
    end = limit(profile, c)
    end = replace(end, energy_volume=end.wear_volume)  # all of the energy has gone into wear
    found = {number: replace(end, relative_error=_bound(profile, end, number)) for number in late}
    return {number: one for number, one in found.items() if one.relative_error <= accuracy}


def _bound(profile: Profile, end: Worn, cycles: float) -> float:
    """Return the largest relative error that the end has as volume and force after some cycles."""
    c, a = end.stick_border, end.contact_radius
    eta, area = float(profile.rise(np.array(1.0 - c), c)), (a - c) * (a + c)
    decay = min(cycles / (math.pi * math.sqrt(area)), MOST)
    layer = (1.0 - c) * math.exp(-LAYER * decay)
    first, rest = float(profile.rise(np.array(layer), c)) / eta, math.exp(-decay)
    left = rest * (1.0 - first) / (first + rest * (1.0 - first))  # 1 - m
    slip = 2.0 / math.pi * (left * math.atan2(math.sqrt(area), c) + math.atan2(math.sqrt(layer * (2.0 * c + layer)), c))
    force = 2.0 * eta * (left * (a - c) + layer)
    return max(end.relative_error, math.pi * area * eta * slip / end.wear_volume, force / end.normal_force)
