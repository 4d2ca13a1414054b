"""Load of a rough contact, shared between film and asperities (Johnson, Greenwood and Poon, Wear 19, 91, 1972).

The film carries the fraction gamma of the load. The rollers are deformed by the whole load, not only by the pressure of
the film. The film is therefore as thick as in a smooth contact with gamma times the load and gamma times the modulus.
In this smooth contact, W is the same, U is replaced by ``U/gamma``, and G by ``gamma G``. The asperities of a line are
springs of the MDR with the stiffness ``E* dx``. A line whose length is the longest wavelength represents a square area
with edges of the same length.
"""

from __future__ import annotations

from collections.abc import Callable
from math import erfc, exp, log, pi, sqrt
from sys import float_info
from typing import NamedTuple

from scipy.optimize import brentq


def mean_overlap(distance: float) -> float:
    """Return the mean overlap ``<(z - d)+>`` of Gaussian heights z, in units of the rms height.

    z is the sum of the heights of two lines, and d is the distance between the mean heights of the lines.
    """
    return max(exp(-(distance**2) / 2) / sqrt(2 * pi) - distance * erfc(distance / sqrt(2)) / 2, 0.0)


def distance_of_means(gap: float) -> float:
    """Return the distance d (see `mean_overlap`) for a mean gap ``<(d - z)+>``, in units of the rms height."""
    gap = max(gap, float_info.min)
    # `mean_overlap(-d)` is the mean gap, because -z has the same distribution as z. The mean gap is at least d, and,
    # for negative d, at most exp(-d^2 / 2) / sqrt(2 pi). The logarithm of the mean gap varies slowly with d.
    least = -sqrt(max(-2 * log(gap * sqrt(2 * pi)), 0.0)) - gap
    return float(brentq(lambda d: log(max(mean_overlap(-d), float_info.min)) - log(gap), least, gap + 1))


def asperity_pressure(film: float, rms: float, wavelength: float, E_star: float) -> float:
    """Return the mean pressure in Pa on asperities at a film in m: ``E*/wavelength`` times the mean overlap.

    The film is taken as the mean gap between the lines. `rms` is the rms value of the summed heights in m, `wavelength`
    the longest wavelength in m, and `E_star` the contact modulus in Pa.
    """
    return E_star * rms / wavelength * mean_overlap(distance_of_means(film / rms))


class SharedLoad(NamedTuple):
    """Film thickness in the unit of `film_at` (see `share_load`), and the load shares of film and asperities."""

    film: float
    film_share: float
    asperity_share: float


def share_load(
    film_at: Callable[[float], float], asperity_share: Callable[[float], float], tolerance: float = 1e-9
) -> SharedLoad:
    """Return the film for which the load shares of film and asperities add up to one.

    `film_at` returns the film that carries a given load share, or 0 if the film is too thin to be computed.
    `asperity_share` returns the load share of the asperities at a given film. `film_at` and `asperity_share` are
    decreasing functions. `tolerance` is the allowed relative error of the film's load share. The relative error of the
    film thickness is about a quarter of `tolerance`, because the film varies approximately as (load share)^(-1/4). If
    the asperities carry less than `tolerance` at the film that carries the whole load, this film is returned. If no
    film balances the load, the asperities carry the whole load, and film and film share are 0.
    """

    def excess(logarithm: float) -> float:
        share = exp(logarithm)
        return asperity_share(film_at(share)) + share - 1.0

    alone = film_at(1.0)
    if asperity_share(alone) < tolerance:
        return SharedLoad(alone, 1.0, asperity_share(alone))
    lowest = -1.0
    while excess(lowest) > 0:
        lowest *= 2
        if exp(lowest) == 0:
            return SharedLoad(0.0, 0.0, 1.0)
    share = exp(float(brentq(excess, lowest, 0.0, xtol=tolerance)))
    film = film_at(share)
    carried = asperity_share(film)
    if abs(carried + share - 1.0) > sqrt(tolerance):
        return SharedLoad(0.0, 0.0, 1.0)  # `film_at` jumps to 0 at this share, and the load is not in balance
    return SharedLoad(film, share, min(carried, 1.0))
