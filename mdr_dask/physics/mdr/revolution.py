"""Profile f0(r) and image g0(x) of an unworn body of revolution.

Lengths are divided by the contact radius a0, and heights by the depth d0, so that g0(1) = 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator, PPoly

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.transforms import forward_transform, gauss, power_factor
from mdr_dask.physics.refine import CLOSE, MOST_ITERATIONS


@dataclass(frozen=True)
class PowerProfile:
    """The power law g0 = x^n and f0 = r^n / `power_factor(n)`, with n > 0: a cone for n = 1, a parabola for n = 2."""

    exponent: float
    largest_radius: float = np.inf

    def __post_init__(self) -> None:
        if not (np.isfinite(self.exponent) and self.exponent > 0.0):
            raise ValueError(f"the exponent of a profile must be positive and finite, got {self.exponent!r}")

    def height(self, radius: FloatArray) -> FloatArray:
        """Return f0(r) = r^n / `power_factor(n)`."""
        return np.asarray(radius**self.exponent / power_factor(self.exponent))

    def image(self, position: FloatArray) -> FloatArray:
        """Return g0(x) = x^n."""
        return np.asarray(position**self.exponent)

    def image_slope(self, position: FloatArray) -> FloatArray:
        """Return g0'(x) = n x^(n-1)."""
        return np.asarray(self.exponent * position ** (self.exponent - 1.0))

    def rise(self, gap: FloatArray, start: float) -> FloatArray:
        """Return (start + gap)^n - start^n without cancellation."""
        if start == 0.0:
            return self.image(gap)
        return np.asarray(start**self.exponent * np.expm1(self.exponent * np.log1p(gap / start)))

    def inside(self, level: float) -> float:
        """Return the position where g0 reaches `level`."""
        return float(level ** (1.0 / self.exponent))


@dataclass(frozen=True, eq=False)
class TableProfile:
    """A body with piecewise cubic f0(r) and g0(x). `length` is a0 in the unit of length of the original table."""

    curve: PPoly
    image_curve: PPoly
    length: float

    @property
    def largest_radius(self) -> float:
        """Largest radius of the profile."""
        return float(self.curve.x[-1])

    @cached_property
    def image_slope_curve(self) -> PPoly:
        """g0'(x)."""
        return self.image_curve.derivative()

    def height(self, radius: FloatArray) -> FloatArray:
        """Return f0(r), or NaN beyond the largest radius."""
        return np.where(radius <= self.largest_radius * (1 + CLOSE), self.curve(np.asarray(radius)), np.nan)

    def image(self, position: FloatArray) -> FloatArray:
        """Return g0(x), or NaN beyond the largest radius."""
        return np.where(position <= self.largest_radius * (1 + CLOSE), self.image_curve(np.asarray(position)), np.nan)

    def image_slope(self, position: FloatArray) -> FloatArray:
        """Return g0'(x). Beyond the largest radius, the last cubic is continued."""
        return self.image_slope_curve(np.asarray(position))

    def rise(self, gap: FloatArray, start: float) -> FloatArray:
        """Return g0(start + gap) - g0(start). For a small gap, the slope is integrated to avoid cancellation."""
        gap = np.asarray(gap, dtype=float)
        abscissa, weight = gauss(8)
        short = gap * (self.image_slope_curve(start + gap[..., None] * abscissa) @ weight)
        return np.where(np.abs(gap) < 0.02, short, self.image(start + gap) - self.image(np.asarray(start)))

    def inside(self, level: float) -> float:
        """Return the position between 0 and 1 where g0 reaches `level`, by bisection."""
        return bisect(lambda x: float(self.image_curve(np.asarray(x))) - level, 0.0, 1.0)


Profile = PowerProfile | TableProfile


def from_table(radius: ArrayLike, height: ArrayLike, depth: float) -> TableProfile:
    """Return the profile of a body that is given by a table of radii and heights and pressed to a depth.

    All lengths have the same unit. The radii must begin at 0. The first height is subtracted from all heights. A
    ValueError is raised if the table is not a rising profile, or if the contact reaches beyond the table.
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
            f"the contact reaches beyond the table: the largest possible depth is {image[-1]:.9g}, got {depth:.9g}; "
            "extend the table or reduce the depth"
        )
    a0 = bisect(lambda x: float(image_curve(x)) - depth, 0.0, float(r[-1]))
    return TableProfile(_scaled(interpolant, a0, depth), _scaled(image_curve, a0, depth), a0)


def check_table(radius: FloatArray, height: FloatArray) -> None:
    """Raise ValueError unless the table has at least 4 finite rows, starts at radius 0, and both columns increase."""
    if radius.ndim != 1 or radius.shape != height.shape or radius.size < 4:
        raise ValueError(
            f"a profile needs two columns of at least 4 rows, got shapes {radius.shape!r} and {height.shape!r}"
        )
    if not (np.all(np.isfinite(radius)) and np.all(np.isfinite(height))):
        bad = int(np.argmin(np.isfinite(radius) & np.isfinite(height)))
        raise ValueError(
            f"a profile must be finite, got radius {float(radius[bad])!r} "
            f"and height {float(height[bad])!r} in row {bad + 1}"
        )
    if radius[0] != 0.0:
        raise ValueError(f"the radii of a profile must start at 0, got {float(radius[0])!r}")
    if np.any(np.diff(radius) <= 0.0):
        bad = int(np.argmax(np.diff(radius) <= 0.0))
        raise ValueError(
            f"the radii of a profile must increase, got {float(radius[bad + 1])!r} after {float(radius[bad])!r}"
        )
    if np.any(np.diff(height) <= 0.0):
        bad = int(np.argmax(np.diff(height) <= 0.0))
        raise ValueError(
            f"the profile must rise with the radius, got the height {height[bad + 1]:.4g} after {height[bad]:.4g} "
            f"at the radius {radius[bad + 1]:.4g}: smooth the profile, or use the parabola that fits it"
        )


def _scaled(curve: PPoly, length: float, height: float) -> PPoly:
    """Return a piecewise cubic in units of the given length and height."""
    return PPoly(curve.c * length ** np.arange(3.0, -1.0, -1.0)[:, None] / height, curve.x / length)


def bisect(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the root of an increasing function to machine precision, by bisection."""
    for _ in range(MOST_ITERATIONS):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if function(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


def _monotone(x: FloatArray, y: FloatArray) -> CubicSpline | PchipInterpolator:
    """Return the cubic spline through the points, or the monotone cubic interpolant if the spline falls somewhere."""
    spline = CubicSpline(x, y)
    fine = (x[:-1, None] + np.diff(x)[:, None] * np.linspace(0.0, 1.0, 9)).ravel()
    falls = np.any(spline(fine, 1) < -CLOSE * np.max(np.abs(spline(fine, 1))))
    return PchipInterpolator(x, y) if falls else spline


def _refine(radius: FloatArray) -> FloatArray:
    """Return the radii of the table, and seven Chebyshev points between each pair of neighbouring radii."""
    local = 0.5 * (1.0 + chebyshev.chebpts2(9)[1:])
    return np.concatenate([[0.0], (radius[:-1, None] + np.diff(radius)[:, None] * local).ravel()])
