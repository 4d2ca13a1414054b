"""Measured lines: conversion of recorded positions and heights to a periodic line on a regular grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError

Detrend = Literal["none", "mean", "line", "parabola"]

ORDERS: dict[str, int] = {"mean": 0, "line": 1, "parabola": 2}


@dataclass(frozen=True)
class MeasuredLine:
    """One period of a line: heights at equidistant points (positive towards the elastomer) and length, both in m."""

    height: FloatArray
    length: float

    @property
    def spacing(self) -> float:
        """Distance between points, m."""
        return self.length / self.height.size


def measured_line(
    position: ArrayLike,
    height: ArrayLike,
    detrend: Detrend = "mean",
    taper: float = 0.0,
    shortest: float = 0.0,
    longest: float = 0.0,
) -> MeasuredLine:
    """Turn positions and heights (in m) of a recorded line into one period of a line with uniform spacing.

    The length of the period is the number of points times the mean spacing. A trend is removed first (see `detrended`).
    At both ends, a cosine window reduces the heights towards their mean. `taper` is the fraction of the line that the
    window changes: 0.1 means 5 % of the line at each end. Waves shorter than `shortest` or longer than `longest` are
    removed; 0 means no limit. DataError is raised if there are fewer than 8 pairs or the two arrays differ in length,
    if a number is not finite, or if the positions neither ascend nor descend.
    """
    x, z = _ordered(position, height)
    length = float(x[-1] - x[0]) * x.size / (x.size - 1)
    z = detrended(np.interp(np.linspace(x[0], x[-1], x.size), x, z), detrend)
    if taper > 0:
        z = z.mean() + (z - z.mean()) * _window(z.size, taper)
    if shortest > 0 or longest > 0:
        z = band_limited(z, length, shortest, longest)
    return MeasuredLine(z, length)


def _ordered(position: ArrayLike, height: ArrayLike) -> tuple[FloatArray, FloatArray]:
    x, z = (np.asarray(a, dtype=np.float64).reshape(-1) for a in (position, height))
    if x.size != z.size or x.size < 8:
        raise DataError(f"a measured line needs 8 or more pairs x, z, got {x.size} positions and {z.size} heights")
    if not np.all(np.isfinite(x) & np.isfinite(z)):
        raise DataError("all x and z of a measured line must be finite: fill the points that the instrument left out")
    if x[0] > x[-1]:
        x, z = x[::-1], z[::-1]
    if np.any(np.diff(x) <= 0):
        raise DataError("the positions of a measured line must ascend or descend: sort them, and merge equal positions")
    return x, z


def _window(points: int, taper: float) -> FloatArray:
    edge = min(taper, 1.0) / 2
    place = (np.arange(points) + 0.5) / points
    inner = np.clip(np.minimum(place, 1 - place) / edge, 0, 1)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * inner), dtype=np.float64)


def detrended(height: FloatArray, order: Detrend) -> FloatArray:
    """Return heights minus a least-squares polynomial of degree `ORDERS[order]`, or a copy if `order` is "none"."""
    if order == "none":
        return height.copy()
    place = np.linspace(-1, 1, height.size)
    trend = np.polynomial.Polynomial.fit(place, height, ORDERS[order])
    return np.asarray(height - trend(place), dtype=np.float64)


def band_limited(height: FloatArray, length: float, shortest: float = 0.0, longest: float = 0.0) -> FloatArray:
    """Return a periodic line without waves shorter than `shortest` or longer than `longest`; 0 for no limit."""
    waves = np.fft.rfft(height)
    number = np.arange(waves.size)
    if shortest > 0:
        waves[number > length / shortest * (1 + 1e-12)] = 0
    if longest > 0:
        waves[(number > 0) & (number < length / longest * (1 - 1e-12))] = 0
    return np.asarray(np.fft.irfft(waves, height.size), dtype=np.float64)
