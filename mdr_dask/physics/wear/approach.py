"""Bound on the distance of a worn contact at constant depth from its limiting profile, in closed form.

Let s be the slip divided by its amplitude: ds/dN = p s / eta. Wear at other radii increases the pressure at a given
radius. Therefore, if s_1 <= s_2 everywhere and s_1 = s_2 at one radius, the pressure at this radius is at least as high
in the second body as in the first (maximum principle of the half-space). So a function stays below the true slip if it
starts below the virgin slip and grows no faster than its own pressure allows. One such function is the half-integral of
y = m min(y0 / y0(x_1), 1) for any x_1 > c, where y0 = (g0 - g_c) / eta, and dm/dN = m (1 - m) / (pi w), starting at m =
y0(x_1):

* its relative growth is at most (1 - m) / (pi w), with w^2 = a^2 - c^2;
* its image jumps from m to 1 at the radius a of the final scar. The pressure of this jump alone is
  (1 - m) / (pi sqrt(a^2 - r^2)), which is at least this growth.

The true slip lies between this function and the slip in the limit, (2 / pi) arccos(c / r). The force falls as the body
wears.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.wear.rules import limit
from mdr_dask.physics.wear.worn import Worn

#: `LAYER` is the decay rate of x_1 - c with respect to N / (pi w); this value is close to the best if y0 rises
#: linearly. `MOST` is the upper limit of N / (pi w), which avoids underflow.
LAYER, MOST = 2.0 / 3.0, 600.0


def nearly_limit(profile: Profile, stick_radius: float, cycles: Sequence[float], accuracy: float) -> dict[float, Worn]:
    """Return the limiting profile for every N at which it approximates the worn body with the wanted accuracy.

    The depth is constant.

    Parameters
    ----------
    profile : Profile
        The virgin body; its image must increase with the radius.
    stick_radius : float
        Stick radius c of the virgin contact, between 0 and 1.
    cycles : sequence of float
        Numbers of cycles N >= 0, in units of N0.
    accuracy : float
        Largest relative error of volume and force; the error of f, relative to the largest possible wear, is
        smaller.
    """
    c = stick_radius
    soonest = -math.pi * math.sqrt((1.0 - c) * (1.0 + c)) * math.log(accuracy) / (1.0 - LAYER)
    late = [number for number in cycles if number >= soonest]
    if not late:
        return {}
    end = limit(profile, c)
    end = replace(end, energy_volume=end.wear_volume)  # all dissipated energy has caused wear
    found = {number: replace(end, relative_error=_bound(profile, end, number)) for number in late}
    return {number: one for number, one in found.items() if one.relative_error <= accuracy}


def _bound(profile: Profile, end: Worn, cycles: float) -> float:
    """Return the largest relative error of volume and force if the limiting profile is used after N cycles."""
    c, a = end.stick_border, end.contact_radius
    eta, area = float(profile.rise(np.array(1.0 - c), c)), (a - c) * (a + c)
    decay = min(cycles / (math.pi * math.sqrt(area)), MOST)
    layer = (1.0 - c) * math.exp(-LAYER * decay)
    first, rest = float(profile.rise(np.array(layer), c)) / eta, math.exp(-decay)
    left = rest * (1.0 - first) / (first + rest * (1.0 - first))  # 1 - m
    slip = 2.0 / math.pi * (left * math.atan2(math.sqrt(area), c) + math.atan2(math.sqrt(layer * (2.0 * c + layer)), c))
    force = 2.0 * eta * (left * (a - c) + layer)
    return max(end.relative_error, math.pi * area * eta * slip / end.wear_volume, force / end.normal_force)
