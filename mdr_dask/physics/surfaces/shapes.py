"""Indenters: the MDR rule for power laws, and the sliding of smooth indenters over a Kelvin foundation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray

ITERATIONS = 200
ROUNDING = 1e-14  # Newton's method ends when its relative step is smaller than this


@dataclass(frozen=True)
class PowerLaw:
    """The line -c |x|^n, c > 0 and n >= 1, that represents a body of revolution according to the MDR rule."""

    coefficient: float
    exponent: float

    @classmethod
    def of_body(cls, coefficient: float, exponent: float) -> PowerLaw:
        """Return the line of a body c r^n; the factor kappa_n of the line is pi/2 for a cone and 2 for a parabola."""
        kappa = 0.5 * math.sqrt(math.pi) * exponent * math.gamma(exponent / 2) / math.gamma((exponent + 1) / 2)
        return cls(kappa * coefficient, exponent)

    def at(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the height -c |x|^n at every x, and the slopes to the left and to the right of x."""
        distance = np.abs(x)
        steepness = self.coefficient * self.exponent * distance ** (self.exponent - 1)
        left = np.where(x > 0, -steepness, steepness)
        right = np.where(x < 0, steepness, -steepness)
        return -self.coefficient * distance**self.exponent, left, right

    def scaled(self, length: float, height: float) -> PowerLaw:
        """Return the shape in other units of length and height."""
        return PowerLaw(self.coefficient * length**self.exponent / height, self.exponent)


def half_width(load: FloatArray, coefficient: float, exponent: float) -> FloatArray:
    """Return the static half-width a of the contact with a smooth line c |x|^n, for loads F_N / (4 G).

    By thesis 3.3.2, ``load = 2 n c a^(n+1) / (n + 1)``.
    """
    width: FloatArray = ((exponent + 1) * load / (2 * exponent * coefficient)) ** (1 / (exponent + 1))
    return width


class Smooth(NamedTuple):
    """Steady states of a smooth line, one entry per case; if Newton's method fails, depth and drag are NaN.

    `drag` is F_x / (4 G). `leading` and `trailing` are the distances from the tip to the two edges of the contact.
    `stretch` is the integral of the squared slope over the contact.
    """

    depth: FloatArray
    drag: FloatArray
    leading: FloatArray
    trailing: FloatArray
    stretch: FloatArray


def smooth(loads: FloatArray, deborah: FloatArray, coefficient: float, exponent: float) -> Smooth:
    """Return the steady states of a smooth line c |x|^n, n >= 1, that slides towards -x over a Kelvin foundation.

    The loads are F_N / (4 G), and `deborah` is v tau. At the depth d the contact lies between -a and b, with d = c a^n
    and d = c (b^n + n v tau b^(n-1)). If no b satisfies the second equation, b is 0. Newton's method converges, because
    the load is a convex function of d with the derivative a + b + v tau.
    """
    c, n = coefficient, exponent
    depth, active = c * half_width(loads, c, n) ** n, np.ones(loads.size, np.bool_)
    for _ in range(ITERATIONS):
        a, b = (depth / c) ** (1 / n), _trailing(depth / c, deborah, n)
        carried = depth * (a + b) - c * (a ** (n + 1) + b ** (n + 1)) / (n + 1) + deborah * (depth - c * b**n)
        step = (loads - carried) / (a + b + deborah)
        active &= ~(np.abs(step) <= ROUNDING * depth)
        if not np.any(active):
            break
        depth = np.where(active, np.maximum(depth + step, 0.25 * depth), depth)
    depth = np.where(active, np.nan, depth)
    stretch = (c * n) ** 2 * (a ** (2 * n - 1) + b ** (2 * n - 1)) / (2 * n - 1)
    return Smooth(depth, 0.5 * (depth - c * b**n) ** 2 + deborah * stretch, a, b, stretch)


def _trailing(drop: FloatArray, deborah: FloatArray, exponent: float) -> FloatArray:
    """Return the positive solution b of b^n + n deborah b^(n-1) = drop, or 0 if there is none (possible for n = 1)."""
    if exponent == 1:
        return np.maximum(drop - deborah, 0.0)
    # Newton's method for y = log b starts above the solution. The method converges from above, because the logarithm of
    # the left side is a convex, increasing function of y.
    goal = np.log(drop)
    y, active = goal / exponent, np.ones(drop.size, np.bool_)
    for _ in range(ITERATIONS):
        b = np.exp(y)
        excess = (exponent - 1) * y + np.log(b + exponent * deborah) - goal
        step = excess / (exponent - 1 + b / (b + exponent * deborah))
        active &= np.abs(step) >= ROUNDING * np.maximum(1.0, np.abs(y))
        if not np.any(active):
            break
        y = np.where(active, y - step, y)
    return np.asarray(np.exp(y))
