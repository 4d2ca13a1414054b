"""Indenters: the MDR rule for power laws, and the sliding of smooth indenters over a Kelvin foundation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit

ITERATIONS = 200

# Indices of the columns of the results of `smooth`
DEPTH, DRAG, LEADING, TRAILING, STRETCH = range(5)
COLUMNS = 5


def mapped(exponent: float) -> float:
    """Return kappa_n of the MDR rule: a body c r^n acts like the line kappa_n c |x|^n (cone: pi/2, parabola: 2).

    Parameters
    ----------
    exponent : float
        n > 0.
    """
    return 0.5 * math.sqrt(math.pi) * exponent * math.gamma(exponent / 2) / math.gamma((exponent + 1) / 2)


class Shape(Protocol):
    """The line of an indenter, as used by the solvers."""

    def at(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the height towards the elastomer, 0 at the tip, and the slopes left and right of every x."""

    def body(self, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return height and slope of the body of revolution that corresponds to the line."""

    @property
    def breaks(self) -> tuple[float, ...]:
        """Radii at which the slope or the curvature jumps."""

    def scaled(self, length: float, height: float) -> Shape:
        """Return the shape in other units of length and height."""


@dataclass(frozen=True)
class PowerLaw:
    """The line -c |x|^n, c > 0 and n >= 1, that represents a body of revolution according to the MDR rule."""

    coefficient: float
    exponent: float

    @classmethod
    def of_body(cls, coefficient: float, exponent: float) -> PowerLaw:
        """Return the line of a body c r^n."""
        return cls(mapped(exponent) * coefficient, exponent)

    def at(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the height -c |x|^n towards the elastomer, and its slopes on the left and right side of every x."""
        distance = np.abs(x)
        steepness = self.coefficient * self.exponent * distance ** (self.exponent - 1)
        left = np.where(x > 0, -steepness, steepness)
        right = np.where(x < 0, steepness, -steepness)
        return -self.coefficient * distance**self.exponent, left, right

    @property
    def breaks(self) -> tuple[float, ...]:
        """Return an empty tuple, because the body is smooth except at its tip."""
        return ()

    def body(self, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return height and slope of the body of revolution that corresponds to the line."""
        height = self.coefficient / mapped(self.exponent) * r**self.exponent
        return height, np.where(r > 0.0, self.exponent * height / np.where(r > 0.0, r, 1.0), 0.0)

    def scaled(self, length: float, height: float) -> PowerLaw:
        """Return the shape in other units of length and height."""
        return PowerLaw(self.coefficient * length**self.exponent / height, self.exponent)


@dataclass(frozen=True)
class RoundedCone:
    """The line of a cone with a rounded tip.

    The body is f = s r^2 / (2 b) up to r = b, and f = s (r - b/2) beyond b. Its line is
    g = s x^2 / b up to x = b, and g = s x (x / b (1 - sqrt(1 - b^2 / x^2)) + arccos(b / x)) beyond b (Popov, Hess and
    Willert, Handbook of Contact Mechanics, 2.5.8).

    Parameters
    ----------
    steepness : float
        s, the slope of the cone.
    blend : float
        b, the radius at which the rounded tip ends and the cone begins; the slope is continuous.
    """

    steepness: float
    blend: float

    def at(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the height towards the elastomer, and its slope, which is equal on both sides."""
        place, b = np.abs(x), self.blend
        outer = np.maximum(place, b)
        root = np.sqrt((outer - b) * (outer + b))
        angle = np.arctan2(root, b)
        beyond = outer * (outer - root) / b + outer * angle
        line = np.where(place <= b, place**2 / b, beyond)
        slope = np.where(place <= b, 2.0 * place / b, 2.0 * (outer - root) / b + angle)
        falling = -self.steepness * np.sign(x) * slope
        return -self.steepness * line, falling, falling

    @property
    def breaks(self) -> tuple[float, ...]:
        """Return the end of the tip, where the curvature jumps."""
        return (self.blend,)

    def body(self, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return height and slope of the body of revolution that corresponds to the line."""
        height = np.where(r <= self.blend, 0.5 * r**2 / self.blend, r - 0.5 * self.blend)
        return self.steepness * height, self.steepness * np.minimum(r / self.blend, 1.0)

    def scaled(self, length: float, height: float) -> RoundedCone:
        """Return the shape in other units of length and height."""
        return RoundedCone(self.steepness * length / height, self.blend / length)


def half_width(load: FloatArray, coefficient: float, exponent: float) -> FloatArray:
    """Return the static half-width a of the contact with a smooth line c |x|^n.

    Parameters
    ----------
    load : array
        F_N / (4 G), so that ``load = 2 n c a^(n+1) / (n + 1)`` (thesis 3.3.2).
    coefficient, exponent : float
        Coefficient c > 0 and exponent n of the line, after the MDR rule.
    """
    width: FloatArray = ((exponent + 1) * load / (2 * exponent * coefficient)) ** (1 / (exponent + 1))
    return width


@jit
def _trailing(drop: float, deborah: float, exponent: float) -> float:
    """Return the positive solution b of b^n + n deborah b^(n-1) = drop, or 0 if there is none (possible for n = 1)."""
    if exponent == 1:
        return max(drop - deborah, 0.0)
    # the logarithm of the left side is convex and increasing in y = log b: Newton's method from the right
    y = math.log(drop) / exponent
    for _ in range(ITERATIONS):
        b = math.exp(y)
        step = ((exponent - 1) * y + math.log(b + exponent * deborah) - math.log(drop)) / (
            exponent - 1 + b / (b + exponent * deborah)
        )
        y -= step
        if abs(step) < 1e-15 * max(1.0, abs(y)):
            break
    return math.exp(y)


@jit
def _carried(depth: float, deborah: float, coefficient: float, exponent: float) -> tuple[float, float, float]:
    """Return F_N / (4 G) at a depth, and the distances of the leading and the trailing edge from the tip."""
    drop = depth / coefficient
    a = drop ** (1 / exponent)
    b = _trailing(drop, deborah, exponent)
    load = depth * (a + b) - coefficient * (a ** (exponent + 1) + b ** (exponent + 1)) / (exponent + 1)
    return load + deborah * (depth - coefficient * b**exponent), a, b


@jit
def smooth(
    loads: FloatArray, deborah: FloatArray, coefficients: FloatArray, exponents: FloatArray, results: FloatArray
) -> None:
    """Compute the steady states of smooth lines c |x|^n that slide towards -x over a Kelvin foundation.

    At the depth d the contact lies between -a and b, with d = c a^n and d = c (b^n + n v tau b^(n-1)). If the second
    equation has no positive solution, b is 0. The load is a convex function of d with the derivative a + b + v tau, so
    that Newton's method converges.

    Parameters
    ----------
    loads, deborah : array, shape (cases,)
        F_N / (4 G) and v tau, positive and finite.
    coefficients, exponents : array, shape (cases,)
        Coefficients c > 0 and exponents n >= 1 of the lines, after the MDR rule.
    results : array, shape (cases, COLUMNS)
        Output: depth, F_x / (4 G), a, b, and the integral of the squared slope over the contact. A row is NaN if no
        depth is found.
    """
    results[:] = np.nan
    for k in range(loads.size):
        load, de, c, n = loads[k], deborah[k], coefficients[k], exponents[k]
        depth = c * ((n + 1) * load / (2 * n * c)) ** (n / (n + 1))
        for _ in range(ITERATIONS):
            carried, a, b = _carried(depth, de, c, n)
            step = (load - carried) / (a + b + de)
            depth = max(depth + step, 0.25 * depth)
            if abs(step) <= 1e-14 * depth:
                carried, a, b = _carried(depth, de, c, n)
                stretch = (c * n) ** 2 * (a ** (2 * n - 1) + b ** (2 * n - 1)) / (2 * n - 1)
                results[k, DEPTH] = depth
                results[k, DRAG] = 0.5 * (depth - c * b**n) ** 2 + de * stretch
                results[k, LEADING], results[k, TRAILING], results[k, STRETCH] = a, b, stretch
                break
