"""The load of a rough contact, shared between its film and its asperities (Johnson, Greenwood and Poon 1972).

The film carries the share gamma of the load, the asperities the rest. The pressure of both together bends the rollers,
so the film is that of the load ``gamma w`` on bodies of the modulus ``gamma E'``: W stays, U becomes ``U/gamma`` and G
becomes ``gamma G`` (Wear 19, 91).

The asperities are the springs of the MDR: a line as long as its longest wave stands for a square of that edge, and
its springs of stiffness ``E* dx`` carry ``E* dx`` times their overlap. Squares side by side are alike, so their mean
pressure is ``E*/wavelength`` times the mean overlap of the two lines. The lines approach until the gap left between
them is the film: ``<(d - z)+> = h`` with d the distance of their means; above two rms heights d and h are the same.
Heights are Gaussian.
"""

from __future__ import annotations

from collections.abc import Callable
from math import erfc, exp, log, pi, sqrt
from typing import NamedTuple

from scipy.optimize import brentq

#: A share of the load so small that the film does not notice: it would thicken by a quarter of that.
_NEGLIGIBLE = 1e-9
#: Logarithm of the smallest share of the load on the film.
_LEAST_LOGARITHM = -256.0
#: Greatest lack of balance of the load, over the tolerance.
_BALANCE = 100.0
#: Distance of the means of two lines in rms heights at which there is no gap left in double precision.
_CLOSED = -37.0
#: Greatest number of Newton steps to a distance; five are usual.
_MOST_STEPS = 100
#: Distance beyond which lines do not overlap in double precision.
_APART = 9.0


def mean_overlap(distance: float) -> float:
    """Return ``<(z - d)+>`` of heights z, in their rms, at a distance d of the means in rms heights."""
    return max(exp(-(distance**2) / 2) / sqrt(2 * pi) - distance * erfc(distance / sqrt(2)) / 2, 0.0)


def distance_of_means(gap: float) -> float:
    """Return the distance d of the means, in rms heights, at which ``<(d - z)+>`` is the mean gap given."""
    if gap > _APART:
        return gap
    # the gap at d is the overlap at -d; its logarithm is concave in d, so Newton comes from the left without fail
    if mean_overlap(-_CLOSED) >= gap:
        return _CLOSED
    middle = mean_overlap(0.0)
    distance = gap if gap > middle else max(-sqrt(2 * log(middle / gap)), _CLOSED)
    for _ in range(_MOST_STEPS):
        left = mean_overlap(-distance)
        step = 2 * left / erfc(-distance / sqrt(2)) * log(left / gap)
        distance -= step
        if abs(step) < 1e-13 * (1 + abs(distance)):
            break
    return distance


class Asperities(NamedTuple):
    """Two rough lines as springs.

    Parameters
    ----------
    rms : float
        Rms height of both lines together in m.
    wavelength : float
        Their longest wavelength in m.
    E_star : float
        Contact modulus in Pa.
    """

    rms: float
    wavelength: float
    E_star: float

    def pressure(self, film: float) -> float:
        """Return the mean pressure in Pa on the asperities at a film thickness in m."""
        return self.E_star * self.rms / self.wavelength * mean_overlap(distance_of_means(film / self.rms))


class SharedLoad(NamedTuple):
    """Film thickness in the unit of `film_at`, and the shares of the load on film and asperities."""

    film: float
    film_share: float
    asperity_share: float


def share_load(
    film_at: Callable[[float], float], asperity_share: Callable[[float], float], tolerance: float = 1e-9
) -> SharedLoad:
    """Return the film at which film and asperities together carry the load.

    Parameters
    ----------
    film_at : callable, float -> float
        Film thickness if the film carries a share of the load between 0 and 1; it falls with that share. It may be 0
        where the film is too thin to be found.
    asperity_share : callable, float -> float
        Share of the load that the asperities carry at a film thickness; it falls with the film.
    tolerance : float
        Relative error of the film's share; the film's own is about a quarter of that.

    Returns
    -------
    SharedLoad
        The one film at which the shares add to one; 0 if none is found.
    """

    def excess(logarithm: float) -> float:
        share = exp(logarithm)
        return asperity_share(film_at(share)) + share - 1.0

    alone = film_at(1.0)
    if asperity_share(alone) < _NEGLIGIBLE:
        return SharedLoad(alone, 1.0, asperity_share(alone))
    lowest = -1.0
    while excess(lowest) > 0:
        lowest *= 2
        if lowest < _LEAST_LOGARITHM:
            return SharedLoad(0.0, 0.0, 1.0)
    share = exp(float(brentq(excess, lowest, 0.0, xtol=tolerance)))
    film = film_at(share)
    carried = asperity_share(film)
    if abs(carried + share - 1.0) > _BALANCE * tolerance:
        return SharedLoad(0.0, 0.0, 1.0)  # between a film that is found and one that is not
    return SharedLoad(film, share, min(carried, 1.0))
