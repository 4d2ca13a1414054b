"""Transforms between the profile f(r) and the image g(x) of a body of revolution, with error estimates.

A substitution x = r sin t, r = x sin t or x = r cosh t removes the square-root singularity of each integral. The
integrals are split at kinks and jumps, and the number of Gauss nodes is doubled until two results agree.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import gamma

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.refine import Estimate

Function = Callable[[FloatArray], FloatArray]

MOST_NODES = 1024


@lru_cache(maxsize=32)
def gauss(nodes: int) -> tuple[FloatArray, FloatArray]:
    """Return the nodes and weights of the Gauss-Legendre rule on [0, 1]."""
    abscissa, weight = np.polynomial.legendre.leggauss(nodes)
    return 0.5 * (1.0 + abscissa), 0.5 * weight


def power_factor(exponent: ArrayLike) -> FloatArray:
    """Return kappa = sqrt(pi)/2 n Gamma(n/2) / Gamma((n+1)/2). The profile c r^n has the image kappa c |x|^n."""
    n = np.asarray(exponent, dtype=float)
    return np.asarray(0.5 * np.sqrt(np.pi) * n * gamma(0.5 * n) / gamma(0.5 * (n + 1.0)))


def inverse_transform(
    image: Function, radius: ArrayLike, *, breaks: Sequence[float] = (), tolerance: float = 1e-10
) -> Estimate:
    """Transform the image g(x) into the profile f(r) (thesis eq. 2.5).

    Parameters
    ----------
    image : callable, array -> array
        g(x) for x >= 0. The function is called with positions between the breaks, never with a break itself.
    radius : array_like, shape (m,)
        Radii r >= 0.
    breaks : sequence of float
        Positions where g or a derivative of g jumps.
    tolerance : float
        Allowed error of f, relative to the largest value of f.

    Returns
    -------
    Estimate
        f(r) = (2/pi) int_0^r g(x) / sqrt(r^2 - x^2) dx, with f(0) = g(0). The estimated error exceeds the tolerance if
        1024 nodes per piece are not enough.

    Examples
    --------
    The image of a parabola r^2 is 2 x^2:

    >>> print(inverse_transform(lambda x: 2 * x**2, [0.5, 1.0]).value)
    [0.25 1.  ]
    """
    r = np.atleast_1d(np.asarray(radius, dtype=float))
    edges = _angles(r, breaks)

    def integrand(angle: FloatArray) -> FloatArray:
        return image(r[:, None, None] * np.sin(angle)) * (2.0 / np.pi)

    return _integrate(integrand, edges, tolerance)


def forward_transform(
    slope: Function,
    position: ArrayLike,
    *,
    apex: float = 0.0,
    breaks: Sequence[float] = (),
    jumps: Sequence[tuple[float, float]] = (),
    tolerance: float = 1e-10,
) -> Estimate:
    """Transform the profile f(r) into the image g(x) by thesis eq. 2.4, and add the height f(0) of the apex.

    Parameters
    ----------
    slope : callable, array -> array
        f'(r) for r >= 0, without the jumps of f, which are passed in `jumps`.
    position : array_like, shape (m,)
        Positions x. Negative positions are allowed, because g is even.
    apex : float
        f(0).
    breaks : sequence of float
        Radii where a derivative of f jumps.
    jumps : sequence of (radius, height)
        Radii where f itself jumps, and the heights of the jumps.
    tolerance : float
        Allowed error of g, relative to the largest value of g without `apex` and `jumps`.

    Returns
    -------
    Estimate
        g(x) = f(0) + |x| int_0^|x| f'(r) / sqrt(x^2 - r^2) dr.

    Examples
    --------
    >>> print(forward_transform(lambda r: 2 * r, [0.5, 1.0]).value)
    [0.5 2. ]
    """
    x = np.abs(np.atleast_1d(np.asarray(position, dtype=float)))
    edges = _angles(x, breaks)

    def integrand(angle: FloatArray) -> FloatArray:
        return np.asarray(slope(x[:, None, None] * np.sin(angle)) * x[:, None, None])

    value, error = _integrate(integrand, edges, tolerance)
    value += apex
    for place, height in jumps:
        behind = x > place
        value[behind] += height * x[behind] / np.sqrt((x[behind] - place) * (x[behind] + place))
    return Estimate(value, error)


def pressure(
    image_slope: Function,
    radius: ArrayLike,
    contact_radius: float,
    *,
    edge_gap: float = 0.0,
    jumps: Sequence[tuple[float, float]] = (),
) -> Estimate:
    """Return the contact pressure divided by the effective modulus (thesis eq. 2.11).

    Unlike the equation of the thesis, this function allows jumps of the line load q = d - g, where d is the depth.

    Parameters
    ----------
    image_slope : callable, array -> array
        g'(x), without the jumps of g.
    radius : array_like, shape (m,)
        Radii r >= 0. The pressure is zero outside the contact, and infinite on the axis under a cone.
    contact_radius : float
        Half-width a of the one-dimensional contact.
    edge_gap : float
        Line load d - g just inside the contact edge. Under a flat punch, this line load is not zero.
    jumps : sequence of (position, height)
        Positions inside the contact where g itself jumps, and the heights of the jumps.

    Returns
    -------
    Estimate
        p / E*, in the unit of height divided by the unit of length.
    """
    r = np.atleast_1d(np.asarray(radius, dtype=float))
    inside = r < contact_radius
    ring = np.where(inside, np.maximum(r, 1e-12 * contact_radius), contact_radius)
    edges = np.stack([np.zeros_like(ring), np.arccosh(contact_radius / ring)], axis=1)

    def integrand(angle: FloatArray) -> FloatArray:
        return image_slope(np.minimum(ring[:, None, None] * np.cosh(angle), contact_radius)) / np.pi

    value, error = _integrate(integrand, edges)
    for place, height in [*jumps, (contact_radius, edge_gap)]:
        ahead = inside & (r < place)
        value[ahead] += height / (np.pi * np.sqrt((place - r[ahead]) * (place + r[ahead])))
    on_axis = inside & (r == 0.0)
    near, *farther = np.abs(image_slope(np.array([1e-9, 0.01, 0.5]) * contact_radius))
    if np.any(on_axis) and near > 1e-6 * max(farther):
        value[on_axis] = np.inf
    return Estimate(np.where(inside, value, 0.0), np.where(inside, error, 0.0))


def volume(image: Function, radius: float) -> Estimate:
    """Return the volume under a profile f from r = 0 to the radius R, computed from the image g.

    The volume is int_0^R 2 pi r f dr = 4 int_0^R g sqrt(R^2 - x^2) dx.
    """
    edges = _angles(np.array([radius]), ())

    def integrand(angle: FloatArray) -> FloatArray:
        return 4.0 * image(radius * np.sin(angle)) * (radius * np.cos(angle)) ** 2

    return _integrate(integrand, edges)


def _angles(outer: FloatArray, breaks: Sequence[float]) -> FloatArray:
    """Return the angles t at which the integrals over x = r sin t are split, shape (m, pieces + 1)."""
    columns = [np.zeros_like(outer)]
    for place in sorted(b for b in breaks if b > 0.0):
        gap = np.clip(outer - place, 0.0, None) * (outer + place)
        columns.append(np.arctan2(place, np.sqrt(gap)))
    columns.append(np.full_like(outer, 0.5 * np.pi))
    return np.stack(columns, axis=1)


def _integrate(integrand: Function, edges: FloatArray, tolerance: float = 1e-10) -> Estimate:
    """Return the integral over all pieces. The number of nodes is doubled until two successive results agree."""
    nodes = 8
    coarse = _gauss_sum(integrand, edges, nodes)
    while True:
        nodes *= 2
        fine = _gauss_sum(integrand, edges, nodes)
        error = np.abs(fine - coarse)
        if nodes >= MOST_NODES or np.all(error <= tolerance * np.max(np.abs(fine), initial=0.0)):
            return Estimate(fine, error)
        coarse = fine


def _gauss_sum(integrand: Function, edges: FloatArray, nodes: int) -> FloatArray:
    abscissa, weight = gauss(nodes)
    width = np.diff(edges, axis=1)
    points = edges[:, :-1, None] + width[:, :, None] * abscissa
    return np.asarray(np.einsum("mpn,n,mp->m", integrand(points), weight, width))
