"""Master curves: curves of one quantity are shifted along logarithmic axes until they form one curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.physics.superposition.posterior import BEND, ROUNDING, STEP_SCATTER, Curves, solve
from mdr_dask.physics.superposition.sampling import CHAINS, draws

EXPANSION = 6e-4
"""Coefficient of volume expansion of melts and rubbers, 1/K, for the factor b_T; typical values are 5e-4 to 7e-4."""

OFFSET = (0.02 / np.log(10), np.log(2))
"""Prior of the standard deviation s of vertical offsets: median of s in decades, and standard deviation of ln s.

Specimens are clamped again for each temperature, and their dimensions are known to about one per cent.
"""

FREE = (0.03, 1.5)
"""Like `OFFSET`, but for the steps of free vertical factors from one curve to the next."""

DETERMINED = 0.5
"""A step between neighbouring shifts is undetermined if its standard deviation exceeds this share of `STEP_SCATTER`.

A step is also undetermined if the curves are separated by a gap (see `_gaps`) in more than half of the draws.
"""

Vertical = Literal["none", "modulus", "compliance", "free"]


@dataclass(frozen=True)
class Superposition:
    """Shift factors and the merged curve; abscissa and ordinates are logarithms to the base 10.

    Parameters
    ----------
    groups : array, shape (curves,)
        Ascending values of the quantity, such as velocity or temperature, that differs from curve to curve.
    horizontal, vertical : array, shape (curves,)
        Shift factors: for each curve, the decades added to log10 x and to log10 y. At the reference the factors are
        zero.
    draws : array
        Draws of the factors from their probability density. Each row is one draw: the horizontal factors of all
        curves, then the vertical factors.
    reference : float
        Group, or value between two groups, at which the factors are zero.
    noise : array, shape (channels,)
        Standard deviation of the measured log10 y from the merged curve.
    x : array, shape (points,)
        Abscissae after shifting, ascending.
    y : array, shape (channels, points)
        Ordinates after shifting.
    member : array of int, shape (points,)
        Index of the group of each point.
    curve_x : array, shape (curve points,)
        Abscissae of the merged curves.
    curve_y, curve_error : array, shape (channels, curve points)
        The merged curves and their standard errors, at the reference.
    curve_cross : array
        Covariance of the merged curves and the factors. The axes are channel, curve point and factor.
    measured : tuple of float
        Range of log10 x of the shifted points of the group at the reference, or of the nearest group if the reference
        lies between two groups. Outside this range the merged curve depends on the shift factors, because only the
        points of other groups determine the curve there.
    undetermined : tuple of (float, float)
        First and last group of each range in which the curves do not determine the shifts, for example on a plateau or
        across a gap.
    """

    groups: FloatArray
    horizontal: FloatArray
    vertical: FloatArray
    draws: FloatArray
    reference: float
    noise: FloatArray
    x: FloatArray
    y: FloatArray
    member: NDArray[np.intp]
    curve_x: FloatArray
    curve_y: FloatArray
    curve_error: FloatArray
    curve_cross: FloatArray
    measured: tuple[float, float]
    undetermined: tuple[tuple[float, float], ...] = ()

    @property
    def covariance(self) -> FloatArray:
        """Covariance of all factors, horizontal then vertical, in decades squared."""
        return np.atleast_2d(np.cov(self.draws, rowvar=False))

    @property
    def horizontal_error(self) -> FloatArray:
        """Standard errors of the horizontal factors in decades."""
        return np.asarray(self.draws[:, : self.groups.size].std(axis=0), dtype=np.float64)

    @property
    def vertical_error(self) -> FloatArray:
        """Standard errors of the vertical factors in decades."""
        return np.asarray(self.draws[:, self.groups.size :].std(axis=0), dtype=np.float64)

    def interval(self, confidence: float = 0.95) -> FloatArray:
        """Return the confidence intervals of all factors: a row with the lower ends and a row with the upper ends."""
        ends = (0.5 - confidence / 2, 0.5 + confidence / 2)
        return np.asarray(np.quantile(self.draws, ends, axis=0), dtype=np.float64)


def superpose(
    groups: ArrayLike,
    curves: Sequence[tuple[ArrayLike, ArrayLike]],
    vertical: Vertical = "none",
    reference: float | None = None,
    seed: int = 0,
    kelvin: ArrayLike | None = None,
) -> Superposition:
    """Find the shifts for which the curves are parts of one smooth curve, and the uncertainty of these shifts.

    The shifts, the smooth curve, the scatter and the vertical offsets have a joint probability density (module
    `posterior`). Draws are taken from this density. The shift factors are means over the draws, and the merged curve is
    the most probable curve for the means of all parameters. The confidence intervals include the uncertainty of
    smoothness, scatter and offsets.

    Parameters
    ----------
    groups : array_like, shape (curves,)
        One distinct value for each curve: the quantity that differs from curve to curve.
    curves : sequence of (x, y)
        log10 of abscissa and ordinate of each curve. A curve must have at least two points. The array x has the shape
        (points,). The array y has the same shape, or the shape (channels, points) for channels that are shifted
        together, such as storage and loss modulus.
    vertical : {'none', 'modulus', 'compliance', 'free'}
        Factors along the ordinate; 'none' means that there are none. A modulus of a polymer is proportional to density
        times temperature. With 'modulus', the known factor b_T = rho0 T0 / (rho T) is therefore applied, and with
        'compliance' its inverse; the density rho is computed with `EXPANSION`. In addition, each curve has an unknown
        offset, which is the same for all channels of the curve and has the prior `OFFSET`. With 'free', the factors are
        unknown and change from curve to curve by steps with the prior `FREE`.
    reference : float, optional
        Group, or value between two groups (see `rereference`), at which the factors are zero. None means the middle
        group.
    seed : int
        Seed of the draws.
    kelvin : array_like, shape (curves,), optional
        Absolute temperatures of the groups, for b_T. None means that the groups are absolute temperatures.

    Raises
    ------
    DataError
        If there are fewer than two curves, if groups and curves or x and y differ in length, if two groups are equal,
        if a curve has fewer than two distinct points or numbers that are not finite, if all curves are constant, or if
        the reference is outside the range of the groups.

    Examples
    --------
    >>> time = np.linspace(0, 2, 9)
    >>> curves = [(time, 6 - 2 / (1 + np.exp(2 - time - shift))) for shift in (0.0, 1.0, 2.0)]
    >>> print(superpose([20.0, 40.0, 60.0], curves, reference=20.0).horizontal.round(1))
    [0. 1. 2.]
    """
    values, arrays = _sorted(groups, curves)
    absolute = values if kelvin is None else np.asarray(kelvin, dtype=np.float64)[np.argsort(np.ravel(groups))]
    rise = known_rise(absolute, vertical)
    width = float(np.median([np.ptp(x) for x, _ in arrays]))
    problem = Curves(
        x=np.concatenate([x for x, _ in arrays]) / width,
        y=np.concatenate([y + k for (_, y), k in zip(arrays, rise, strict=True)], axis=1),
        member=np.repeat(np.arange(values.size), [x.size for x, _ in arrays]),
        count=values.size,
        height=np.maximum(np.median([np.ptp(y, axis=1) for _, y in arrays], axis=0), ROUNDING / BEND),
        splines=4,
        offset={"none": None, "free": FREE}.get(vertical, OFFSET),
        drifting=vertical == "free",
    )
    generator = np.random.Generator(np.random.Philox(seed))
    problem, rows = draws(problem, generator)
    found = _merged(problem, rows, values, rise, width, generator)
    return rereference(found, values[values.size // 2] if reference is None else reference)


def known_rise(kelvin: FloatArray, vertical: Vertical) -> FloatArray:
    """Return log10(b_T) for a modulus, log10(1 / b_T) for a compliance, and 0 for other kinds of `vertical`.

    The reference temperature T0 of b_T is the first temperature.
    """
    if vertical not in ("modulus", "compliance"):
        return np.zeros(kelvin.size)
    decades = np.log10(kelvin[0] / kelvin * (1 + EXPANSION * (kelvin - kelvin[0])))
    return np.asarray(decades if vertical == "modulus" else -decades, dtype=np.float64)


def _sorted(
    groups: ArrayLike, curves: Sequence[tuple[ArrayLike, ArrayLike]]
) -> tuple[FloatArray, list[tuple[FloatArray, FloatArray]]]:
    values = np.asarray(groups, dtype=np.float64).reshape(-1)
    if values.size != len(curves) or values.size < 2 or np.unique(values).size != values.size:
        raise DataError(
            f"expected two or more curves with different groups, got {len(curves)} curves, groups {values.tolist()!r}"
        )
    arrays = []
    for place in np.argsort(values):
        x, y = np.asarray(curves[place][0], dtype=np.float64), np.atleast_2d(np.asarray(curves[place][1], np.float64))
        if x.size != y.shape[1] or x.size < 2 or np.ptp(x) == 0 or not np.all(np.isfinite(x) & np.isfinite(y)):
            raise DataError(f"the curve at {values[place]:g} needs two or more distinct points with finite logarithms")
        order = np.argsort(x, kind="stable")
        arrays.append((x[order], y[:, order]))
    if all(np.ptp(y) == 0 for _, y in arrays):
        raise DataError("expected curves that vary, got constant ones, for which shifts cannot be determined")
    return np.sort(values), arrays


def _merged(
    problem: Curves,
    rows: FloatArray,
    values: FloatArray,
    rise: FloatArray,
    width: float,
    generator: np.random.Generator,
) -> Superposition:
    """Compute master curves and shift factors from draws of all parameters. The first curve is the reference."""
    count, channels, lines = values.size, problem.y.shape[0], values.size - 1
    shifts = np.concatenate([np.zeros((len(rows), 1)), rows[:, :lines]], axis=1)
    mean = shifts.mean(axis=0)
    x = problem.x + mean[problem.member]
    grid = np.linspace(x.min(), x.max(), 201)
    parts = np.array_split(rows, len(rows) // CHAINS)
    unknowns = np.concatenate([solve(problem, part).unknowns(generator) for part in parts])
    offsets = unknowns[:, -count:] if problem.offset else np.zeros((len(rows), count))
    lifted = np.stack([problem.spline(c, unknowns, shifts, grid) for c in range(channels)], axis=1)
    lifted -= offsets[:, None, :1]
    factors = np.hstack([shifts * width, offsets - offsets[:, :1] + rise - rise[0]])
    vertical = factors[:, count:].mean(axis=0)
    # fit the curve to the points at their mean shifts; on a plateau, the mean of drawn curves would miss these points
    likeliest = solve(problem, rows.mean(axis=0)[None]).mean
    curve = np.concatenate([problem.spline(c, likeliest, mean[None], grid) for c in range(channels)])
    curve -= likeliest[:, -count:][:, :1] if problem.offset else 0.0
    centred = factors - factors.mean(axis=0)
    order = np.argsort(x, kind="stable")
    scales = rows[:, lines + channels * count : lines + channels * (count + 1)]
    own = x[problem.member == 0] * width
    apart = _gaps(problem.x, problem.member, shifts).mean(axis=0)
    loose = np.diff(shifts, axis=1).std(axis=0) > DETERMINED * STEP_SCATTER
    loose |= np.maximum(apart[1:], np.where(np.arange(lines) == 0, apart[0], 0)) > 0.5
    return Superposition(
        groups=values,
        horizontal=mean * width,
        vertical=vertical,
        draws=factors,
        reference=float(values[0]),
        noise=np.exp(scales.mean(axis=0)),
        x=x[order] * width,
        y=(problem.y + (vertical - rise + rise[0])[problem.member])[:, order] - rise[0],
        member=problem.member[order],
        curve_x=grid * width,
        curve_y=curve,
        curve_error=np.sqrt(np.mean((lifted - curve) ** 2, axis=0)),
        curve_cross=np.einsum("dcj,df->cjf", lifted - curve, centred) / (len(rows) - 1),
        measured=(float(own.min()), float(own.max())),
        undetermined=_runs(values, loose),
    )


def _runs(groups: FloatArray, steps: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    """Return the first and the last group of each run of adjacent marked steps; step k is from group k to k + 1."""
    edges = np.diff(np.concatenate([[0], steps.astype(int), [0]]))
    ends = zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)
    return tuple((float(groups[first]), float(groups[last])) for first, last in ends)


def _gaps(x: FloatArray, member: NDArray[np.intp], shifts: FloatArray) -> NDArray[np.bool_]:
    """Return, for each row of shifts, a mask of the curves that begin beyond the ends of all curves to their left."""
    ends = np.array([[x[member == k].min(), x[member == k].max()] for k in range(shifts.shape[1])])
    low, high = ends[:, 0] + shifts, ends[:, 1] + shifts
    order = np.argsort(low, axis=1)
    reach = np.maximum.accumulate(np.take_along_axis(high, order, 1), axis=1)
    apart = np.zeros(shifts.shape, dtype=bool)
    gap = np.take_along_axis(low, order, 1)[:, 1:] > reach[:, :-1]
    np.put_along_axis(apart, order[:, 1:], gap, 1)
    return apart


def rereference(
    result: Superposition,
    reference: float,
    law: FloatArray | None = None,
    at_reference: float = 0.0,
    logarithmic: bool = False,
) -> Superposition:
    """Return the same master curve for a new reference, which is a group or a value between two groups.

    The horizontal factor at the new reference is the factor of the law plus a deviation from the law. The deviation is
    interpolated linearly between the measured deviations at the two neighbouring groups. To include the error of this
    interpolation (see `interpolation_error`), a normally distributed number, with this error as standard deviation, is
    added to each draw. The vertical factor is interpolated linearly between the two groups.

    Parameters
    ----------
    reference : float
        New reference, between the lowest and the highest group.
    law : array, shape (curves,), optional
        Factors of the groups according to a law of the shifts. Without a law, the measured factors are interpolated.
    at_reference : float
        The factor of the law at the reference.
    logarithmic : bool
        Whether to interpolate over the logarithm of the groups, as is appropriate for velocities.

    Raises
    ------
    DataError
        If the reference is outside the range of the groups.
    """
    groups, size = result.groups, result.groups.size
    if not groups[0] <= reference <= groups[-1]:
        raise DataError(f"expected a reference between {groups[0]:.9g} and {groups[-1]:.9g}, got {reference:.9g}")
    place, places = (np.log(reference), np.log(groups)) if logarithmic else (reference, groups)
    share = np.array([np.interp(place, places, unit) for unit in np.eye(size)])
    known = np.zeros(size) if law is None or reference in groups else law - at_reference
    both = np.kron(np.eye(2), share)
    across, along = float(share @ (result.horizontal - known)), float(share @ result.vertical)
    zero = both @ result.draws.T  # both factors at the new reference in each draw, shape (2, draws)
    zero[0] -= share @ known
    bend = interpolation_error(places, result.horizontal - known, float(place))
    zero[0] += bend * ndtri((np.random.default_rng(0).permutation(zero.shape[1]) + 0.5) / zero.shape[1])
    drawn = result.draws - np.repeat(zero.T, size, axis=1)
    nearest = int(np.argmin(np.abs(places - place)))
    own = result.x[result.member == nearest] - across
    slope = np.gradient(result.curve_y, result.curve_x, axis=1)
    moved = slope[..., None] * both[0] - both[1]
    spread = moved @ result.covariance
    variance = result.curve_error**2 + np.sum(moved * (2 * result.curve_cross + spread), axis=2)
    variance += (slope * bend) ** 2
    change = np.eye(2 * size) - np.repeat(both, size, axis=0)
    return replace(
        result,
        horizontal=result.horizontal - across,
        vertical=result.vertical - along,
        draws=drawn,
        reference=float(reference),
        x=result.x - across,
        y=result.y - along,
        curve_x=result.curve_x - across,
        curve_y=result.curve_y - along,
        curve_error=np.sqrt(np.maximum(variance, 0)),
        curve_cross=(result.curve_cross + spread) @ change.T,
        measured=(float(own.min()), float(own.max())),
    )


def interpolation_error(places: FloatArray, factors: FloatArray, place: float) -> float:
    """Return the error ``(x - a) (b - x) |h''| / 2`` of the linear interpolation at x between the neighbours a and b.

    ``|h''|`` is the larger of the absolute second derivatives of the factors at a and b. At the first and the last
    group, where no second derivative is known, 0 is used.
    """
    after = int(np.clip(np.searchsorted(places, place), 1, places.size - 1))
    slopes = np.diff(factors) / np.diff(places)
    bends = np.diff(slopes) / ((places[2:] - places[:-2]) / 2)
    bend = np.max(np.abs(bends[max(after - 2, 0) : after]), initial=0.0)
    return float((place - places[after - 1]) * (places[after] - place) * bend / 2)
