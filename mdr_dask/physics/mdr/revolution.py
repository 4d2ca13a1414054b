"""Virgin profiles of revolution in the units of their first contact: radius a0 = 1, depth d0 = 1, so that g(1) = 1."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.profile_table import check_table
from mdr_dask.physics.mdr.transforms import forward_transform, gauss, power_factor


class Profile(Protocol):
    """A convex-enough body: f and its image g rise with the radius."""

    @property
    def largest_radius(self) -> float:
        """Radius up to which the profile is known."""

    @property
    def breaks(self) -> tuple[float, ...]:
        """Places where a derivative of the image jumps."""

    def height(self, radius: FloatArray) -> FloatArray:
        """Return f0(r)."""

    def image(self, position: FloatArray) -> FloatArray:
        """Return g0(x), x >= 0."""

    def image_slope(self, position: FloatArray) -> FloatArray:
        """Return g0'(x), x >= 0."""

    def rise(self, position: FloatArray, start: float) -> FloatArray:
        """Return g0(x) - g0(start) without cancellation."""

    def inside(self, level: float) -> float:
        """Return the position where g0 reaches a level between 0 and 1."""


@dataclass(frozen=True)
class PowerProfile:
    """g0 = x^n, f0 = r^n / kappa_n: parabola for n = 2, cone for n = 1.

    Parameters
    ----------
    exponent : float
        n > 0.
    """

    exponent: float
    largest_radius: float = np.inf
    breaks: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not (np.isfinite(self.exponent) and self.exponent > 0.0):
            raise ValueError(f"the exponent of a profile must be positive and finite, got {self.exponent!r}")

    def height(self, radius: FloatArray) -> FloatArray:
        """Return f0(r) = r^n / kappa_n."""
        return np.asarray(radius**self.exponent / power_factor(self.exponent))

    def image(self, position: FloatArray) -> FloatArray:
        """Return g0(x) = x^n."""
        return np.asarray(position**self.exponent)

    def image_slope(self, position: FloatArray) -> FloatArray:
        """Return g0'(x) = n x^(n-1)."""
        return np.asarray(self.exponent * position ** (self.exponent - 1.0))

    def rise(self, position: FloatArray, start: float) -> FloatArray:
        """Return x^n - c^n, exact to the last digits when x is close to c."""
        if start == 0.0:
            return self.image(position)
        return np.asarray(start**self.exponent * np.expm1(self.exponent * np.log1p((position - start) / start)))

    def inside(self, level: float) -> float:
        """Return the position where g0 reaches `level`."""
        return float(level ** (1.0 / self.exponent))


@dataclass(frozen=True, eq=False)
class TableProfile:
    """A measured profile, interpolated monotonically; built by `from_table`.

    Parameters
    ----------
    curve : callable
        f0(r) in units of d0, r in units of a0.
    slope : callable
        f0'(r).
    image_curve : callable
        g0(x) between 0 and `largest_radius`.
    image_slope_curve : callable
        g0'(x).
    largest_radius : float
        End of the table.
    length, height_unit : float
        a0 and d0 in the table's own units.
    """

    curve: Callable[[FloatArray], FloatArray]
    slope: Callable[[FloatArray], FloatArray]
    image_curve: Callable[[FloatArray], FloatArray]
    image_slope_curve: Callable[[FloatArray], FloatArray]
    largest_radius: float
    length: float
    height_unit: float
    breaks: tuple[float, ...] = ()

    def height(self, radius: FloatArray) -> FloatArray:
        """Return f0(r); NaN beyond the table."""
        return np.where(radius <= self.largest_radius * (1 + 1e-12), self.curve(np.asarray(radius)), np.nan)

    def image(self, position: FloatArray) -> FloatArray:
        """Return g0(x); NaN beyond the table."""
        return np.where(position <= self.largest_radius * (1 + 1e-12), self.image_curve(np.asarray(position)), np.nan)

    def image_slope(self, position: FloatArray) -> FloatArray:
        """Return g0'(x)."""
        return self.image_slope_curve(np.asarray(position))

    def rise(self, position: FloatArray, start: float) -> FloatArray:
        """Return g0(x) - g0(start), by its slope over short distances."""
        x = np.asarray(position, dtype=float)
        gap = x - start
        abscissa, weight = gauss(8)
        short = gap * (self.image_slope_curve(start + gap[..., None] * abscissa) @ weight)
        return np.where(np.abs(gap) < 0.02, short, self.image(x) - self.image(np.asarray(start)))

    def inside(self, level: float) -> float:
        """Return the position where g0 reaches `level`, by bisection."""
        return bisect(lambda x: float(self.image_curve(np.asarray(x))) - level, 0.0, 1.0)


def from_table(radius: ArrayLike, height: ArrayLike, depth: float) -> TableProfile:
    """Build the profile of a table pressed to a depth.

    Parameters
    ----------
    radius, height : array_like, shape (m,)
        r from 0 upwards and f(r), in one length unit; f(0) is taken as the origin of heights.
    depth : float
        Indentation depth d0 > 0, in the same unit.

    Returns
    -------
    TableProfile
        Scaled so that g0(1) = 1.

    Raises
    ------
    ValueError
        If the table is not finite, does not start at the axis, does not rise, or ends inside the contact.
    """
    r, f = np.asarray(radius, dtype=float), np.asarray(height, dtype=float)
    check_table(r, f)
    f = f - f[0]
    interpolant = _monotone(r, f)
    slope = interpolant.derivative()
    nodes = _refine(r)
    image = forward_transform(slope, nodes, breaks=tuple(r[1:-1]), tolerance=1e-12).value
    image_curve = _monotone(nodes, image)
    if image[-1] < depth:
        raise ValueError(
            f"the contact reaches beyond the table: its image ends at the height {image[-1]:.4g}, got depth {depth!r}; "
            "extend the table or press less deep"
        )
    a0 = bisect(lambda x: float(image_curve(x)) - depth, 0.0, float(r[-1]))
    image_slope = image_curve.derivative()
    return TableProfile(
        curve=lambda q: interpolant(q * a0) / depth,
        slope=lambda q: slope(q * a0) * a0 / depth,
        image_curve=lambda q: image_curve(q * a0) / depth,
        image_slope_curve=lambda q: image_slope(q * a0) * a0 / depth,
        largest_radius=float(r[-1] / a0),
        length=a0,
        height_unit=depth,
        breaks=(),
    )


def bisect(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the root of an increasing function, to the last digit."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if function(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


def _monotone(x: FloatArray, y: FloatArray) -> CubicSpline | PchipInterpolator:
    """Return a cubic spline if it rises everywhere, else the monotone interpolant of lower order."""
    spline = CubicSpline(x, y)
    fine = (x[:-1, None] + np.diff(x)[:, None] * np.linspace(0.0, 1.0, 9)).ravel()
    falls = np.any(spline(fine, 1) < -1e-9 * np.max(np.abs(spline(fine, 1))))
    return PchipInterpolator(x, y) if falls else spline


def _refine(radius: FloatArray) -> FloatArray:
    """Return the table's radii with seven Chebyshev points in every gap."""
    local = 0.5 * (1.0 + chebyshev.chebpts2(9)[1:])
    return np.concatenate([[0.0], (radius[:-1, None] + np.diff(radius)[:, None] * local).ravel()])
