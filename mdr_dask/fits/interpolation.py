"""Interpolation on linear or logarithmic scales: monotone cubics, straight lines, and the errors of interpolation."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from mdr_dask.arrays import FloatArray

#: Smallest number of values along an axis. If every second value is left out, the remaining values must still determine
#: a curve.
FEWEST = 4
#: Assumed error of interpolation with all values, divided by the error with every second value only. The ratio is 1/4
#: for an error of second order, and 1/2 at a kink.
LEFT = 0.25
#: `LARGEST`: largest number of values in a dense table; these are 16 MB. `PIECES`: largest number of steps into which
#: the interval between two computed values of an axis is divided. With 16 steps, the error of linear interpolation is
#: 256 times smaller than with one step.
LARGEST, PIECES = 2_000_000, 16


class Scale:
    """A scale on which numbers are interpolated: linear or logarithmic."""

    def __init__(self, logarithmic: bool) -> None:
        self.logarithmic = logarithmic

    @classmethod
    def of(cls, numbers: FloatArray, spread: bool = False) -> Scale:
        """Return the scale for some numbers; the scale is linear if any number is zero or negative.

        With `spread`, the scale is logarithmic if the numbers span more than a decade. Without `spread`, the numbers
        must ascend. The scale is then logarithmic if the logarithms are more evenly spaced than the numbers.
        """
        if numbers.min() <= 0:
            return cls(False)
        if spread:
            return cls(bool(numbers.max() > 10 * numbers.min()))
        steps = (np.diff(numbers), np.diff(np.log(numbers)))
        even = [np.std(step) / np.mean(step) for step in steps]
        return cls(bool(even[1] < even[0]))

    def of_values(self, values: FloatArray) -> FloatArray:
        """Return the positions of numbers on this scale: the logarithms of the numbers, or the numbers themselves."""
        return np.log(values) if self.logarithmic else np.asarray(values, dtype=np.float64)

    def back(self, values: FloatArray) -> FloatArray:
        """Return the numbers that have the given positions on this scale."""
        return np.exp(values) if self.logarithmic else values


def dense(axes: Sequence[FloatArray], size: int) -> list[FloatArray]:
    """Divide each interval between neighbouring values of an axis into equal steps; return old and new values.

    The steps are equal on the scale that `Scale.of` chooses for an axis. `size` is the number of values in the table of
    computed values.
    """
    pieces = int(np.clip((LARGEST / size) ** (1 / len(axes)), 1, PIECES))
    return [_divided(places, pieces) for places in axes]


def _divided(places: FloatArray, pieces: int) -> FloatArray:
    scale = Scale.of(places)
    cut = [np.linspace(a, b, pieces, endpoint=False) for a, b in pairwise(scale.of_values(places))]
    grid = scale.back(np.concatenate([*cut, scale.of_values(places[-1:])]))
    grid[::pieces] = places
    return grid


def cubic(
    places: FloatArray, values: FloatArray, wanted: FloatArray, axis: int, scale: Scale | None = None
) -> FloatArray:
    """Interpolate values along an axis by monotone cubics. If `scale` is None, ``Scale.of(places)`` is used."""
    from scipy.interpolate import PchipInterpolator

    scale = scale or Scale.of(places)
    curve = PchipInterpolator(scale.of_values(places), values, axis=axis)
    return np.asarray(curve(scale.of_values(wanted)))


def linear(
    places: FloatArray, values: FloatArray, wanted: FloatArray, axis: int, scale: Scale | None = None
) -> FloatArray:
    """Interpolate values linearly along an axis. If `scale` is None, ``Scale.of(places)`` is used."""
    from scipy.interpolate import make_interp_spline

    scale = scale or Scale.of(places)
    return np.asarray(make_interp_spline(scale.of_values(places), values, k=1, axis=axis)(scale.of_values(wanted)))


def left_out_error(scale: Scale, table: FloatArray, places: FloatArray, axis: int) -> FloatArray:
    """Estimate the error of interpolation at every value of an axis (`places`) by leaving out every second value.

    `table` contains numbers converted to `scale`. The result is the error of the unconverted numbers. Each error is
    `LEFT` times the largest of three deviations: at the value itself and at its two neighbours, each when it is left
    out.
    """
    values, truth = np.moveaxis(table, axis, -1), np.moveaxis(scale.back(table), axis, -1)
    most = np.zeros_like(truth)
    number = len(places)
    for first in (0, 1):
        kept = np.unique([0, *range(first, number, 2), number - 1])
        predicted = scale.back(cubic(places[kept], values[..., kept], places, -1))
        most = np.maximum(most, np.abs(predicted - truth))
    around = np.pad(most, [(0, 0)] * (most.ndim - 1) + [(1, 1)], mode="edge")
    return np.moveaxis(LEFT * _largest(around), -1, axis)


def chord_error(table: FloatArray, grid: FloatArray, axis: int) -> FloatArray:
    """Estimate the error of linear interpolation in a table by the second derivative times spacing^2 / 8."""
    values, steps = np.moveaxis(table, axis, -1), np.diff(grid)
    bend = np.abs(np.diff(np.diff(values) / steps)) / (steps[1:] + steps[:-1])
    inside = bend * np.maximum(steps[1:], steps[:-1]) ** 2 / 4
    around = np.pad(inside, [(0, 0)] * (inside.ndim - 1) + [(2, 2)], mode="edge")
    return np.moveaxis(_largest(around), -1, axis)


def _largest(padded: FloatArray) -> FloatArray:
    """Return the largest of every three neighbouring values along the last axis."""
    return np.asarray(np.max([padded[..., :-2], padded[..., 1:-1], padded[..., 2:]], axis=0))
