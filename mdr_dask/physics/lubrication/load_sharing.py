"""Load of a rough contact, shared between film and asperities (Johnson, Greenwood and Poon 1972).

The film carries the fraction gamma of the load w, and the asperities carry the other part. The total pressure deforms
the rollers. Therefore the film thickness equals the film thickness under the load ``gamma w`` between bodies of the
modulus ``gamma E'``: W stays the same, U becomes ``U/gamma`` and G becomes ``gamma G`` (Wear 19, 91).

The asperities are represented by the springs of the MDR. A line that is as long as its longest wave represents a square
with edges of the same length. Each spring of the line has the stiffness ``E* dx`` and carries the force ``E* dx`` times
its overlap. The contact consists of equal squares, so the mean pressure is ``E*/wavelength`` times the mean overlap of
the two lines. The lines approach until the mean gap equals the film: ``<(d - z)+> = h``. Here d is the distance between
the mean lines, z is the sum of both heights, and h is the film. If h exceeds two rms heights, d and h are nearly equal.
"""

from __future__ import annotations

from collections.abc import Callable
from math import erfc, exp, log, pi, sqrt
from typing import NamedTuple

from scipy.optimize import brentq

#: If the load share of the asperities is below this value, the load of the asperities is neglected. The relative error
#: of the film thickness is then a quarter of this value or less.
_NEGLIGIBLE = 1e-9
#: Natural logarithm of the smallest load share of the film that is tried.
_LEAST_LOGARITHM = -256.0
#: The film is accepted if the load shares add up to one within the tolerance times this factor.
_BALANCE = 100.0
#: Distance between the means of two lines, in rms heights, at which the mean gap is zero in double precision.
_CLOSED = -37.0
#: Distance between the means of two lines, in rms heights, beyond which the overlap is zero in double precision.
_APART = 9.0


def mean_overlap(distance: float) -> float:
    """Return the mean overlap ``<(z - d)+>`` of Gaussian heights z at the distance d between the means.

    Overlap, heights and distance are in units of the rms height.
    """
    return max(exp(-(distance**2) / 2) / sqrt(2 * pi) - distance * erfc(distance / sqrt(2)) / 2, 0.0)


def distance_of_means(gap: float) -> float:
    """Return the distance d between the means, in rms heights, at which the mean gap ``<(d - z)+>`` equals `gap`."""
    if gap > _APART:
        return gap
    if mean_overlap(-_CLOSED) >= gap:
        return _CLOSED
    # The mean gap at d is the mean overlap at -d. The logarithm is used because it varies slowly with d.
    return float(brentq(lambda d: log(max(mean_overlap(-d), 1e-320) / gap), _CLOSED, _APART, xtol=1e-13))


class Asperities(NamedTuple):
    """Two rough lines, represented by springs.

    Parameters
    ----------
    rms : float
        Rms of the sum of the heights of both lines, in m.
    wavelength : float
        Longest wavelength of the lines in m.
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
    """Film thickness in the unit of `film_at`, and the load shares of film and asperities."""

    film: float
    film_share: float
    asperity_share: float


def share_load(
    film_at: Callable[[float], float], asperity_share: Callable[[float], float], tolerance: float = 1e-9
) -> SharedLoad:
    """Return the film for which the load shares of film and asperities add up to one.

    Parameters
    ----------
    film_at : callable, float -> float
        Returns the film thickness for a load share of the film between 0 and 1. The film thickness falls if this share
        rises. The returned film thickness may be 0 if the film is too thin to be computed.
    asperity_share : callable, float -> float
        Returns the load share of the asperities for a film thickness; this share falls if the film thickness rises.
    tolerance : float
        Allowed relative error of the load share of the film. The relative error of the film thickness is about a
        quarter of the relative error of this share.

    Returns
    -------
    SharedLoad
        The film and the shares; if no film is found, film and film share are 0.
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
        return SharedLoad(0.0, 0.0, 1.0)  # the root is a jump of `film_at` to 0, where the load is not in balance
    return SharedLoad(film, share, min(carried, 1.0))
