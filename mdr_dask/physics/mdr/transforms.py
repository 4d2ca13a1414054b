"""Transform of the profile f(r) of a body of revolution into its image g(x), with an error estimate.

The substitution r = x sin t removes the square-root singularity of the integral. The integral is split at kinks of
f(r).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad_vec
from scipy.special import gamma

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.refine import Estimate

Function = Callable[[FloatArray], FloatArray]


@lru_cache(maxsize=32)
def gauss(nodes: int) -> tuple[FloatArray, FloatArray]:
    """Return the nodes and weights of the Gauss-Legendre rule on [0, 1]."""
    abscissa, weight = np.polynomial.legendre.leggauss(nodes)
    return 0.5 * (1.0 + abscissa), 0.5 * weight


def power_factor(exponent: ArrayLike) -> FloatArray:
    """Return kappa = sqrt(pi)/2 n Gamma(n/2) / Gamma((n+1)/2). The profile c r^n has the image kappa c |x|^n."""
    n = np.asarray(exponent, dtype=float)
    return np.asarray(0.5 * np.sqrt(np.pi) * n * gamma(0.5 * n) / gamma(0.5 * (n + 1.0)))


def forward_transform(
    slope: Function, position: ArrayLike, *, breaks: Sequence[float] = (), tolerance: float = 1e-10
) -> Estimate:
    """Transform the profile f(r) with f(0) = 0 into the image g(x) by thesis eq. 2.4.

    Parameters
    ----------
    slope : callable, array -> array
        f'(r) for r >= 0.
    position : array_like, shape (m,)
        Positions x. Negative positions are allowed, because g is even.
    breaks : sequence of float
        Radii where a derivative of f jumps.
    tolerance : float
        Allowed error of g, relative to the largest value of g.

    Returns
    -------
    Estimate
        g(x) = |x| int_0^|x| f'(r) / sqrt(x^2 - r^2) dr. The estimated error is the same at all positions.

    Examples
    --------
    >>> print(forward_transform(lambda r: 2 * r, [0.5, 1.0]).value)
    [0.5 2. ]
    """
    x = np.abs(np.atleast_1d(np.asarray(position, dtype=float)))
    edges = _angles(x, breaks)
    widths = np.diff(edges, axis=1)

    def integrand(fraction: float) -> FloatArray:
        angle = edges[:, :-1] + fraction * widths
        return np.asarray(x * np.sum(widths * slope(x[:, None] * np.sin(angle)), axis=1))

    value, error = quad_vec(integrand, 0.0, 1.0, epsrel=tolerance, norm="max")
    return Estimate(value, np.full_like(value, error))


def _angles(outer: FloatArray, breaks: Sequence[float]) -> FloatArray:
    """Return the angles t at which the integrals over r = x sin t are split, shape (m, pieces + 1)."""
    columns = [np.zeros_like(outer)]
    for place in sorted(b for b in breaks if b > 0.0):
        gap = np.clip(outer - place, 0.0, None) * (outer + place)
        columns.append(np.arctan2(place, np.sqrt(gap)))
    columns.append(np.full_like(outer, 0.5 * np.pi))
    return np.stack(columns, axis=1)
