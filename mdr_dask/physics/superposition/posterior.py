"""Probability of shifts, given curves that are pieces of one smooth curve: the density and its gradient.

Each channel c of a curve k (such as storage and loss modulus of one temperature) is

    y_c(x) = Q_c(x + h_k) - v_k + noise_c,

with a horizontal shift h_k and a vertical offset v_k common to all channels. Q_c is a cubic B-spline whose second
differences are normal (P. H. C. Eilers, B. D. Marx, Stat. Sci. 11 (1996) 89), the offsets are normal too. Both enter
linearly and are integrated out, so that the density depends on the shifts and on a few scales only.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import block_diag
from scipy.special import softmax

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.superposition.banded import Factors, drawn, solve_rows

CELLS = 8
"""Spline cells along a curve of median width; ten give the same factors, five are too few for sharp bends."""

MARGIN = 0.5
"""Widths of a curve by which the spline extends beyond the first guess on either side; farther off it is straight."""

ROUNDING = 1e-5
"""Scatter that no curve falls below, decades: that of a table of five digits."""

STEP_MEAN, STEP_SCATTER = 1.0, 0.5
"""Prior of the steps between neighbouring curves, in widths of a curve: standard deviations of their mean about zero,
and of each about that mean."""

BEND, BEND_SCATTER, BEND_DRIFT = 0.02, 3.0, 1.0
"""Prior of the bend (standard deviation of the second differences of the spline) near each curve: median in heights of
a curve, standard deviation of its logarithm, and of the change of this logarithm from a curve to the next, as
superposed curves are bent in some places and straight in others."""

REACH = 0.3
"""Distance over which the bend changes from that of one curve to that of the next, in widths of a curve."""

NOISE, NOISE_SCATTER = 0.01, 2.0
"""Prior of the relative scatter of each channel: median, and standard deviation of its logarithm."""

TREND = 10.0
"""Standard deviation of the mean step of drifting offsets, over that of the steps about it."""

FARTHEST = 8.0
"""Distance of the logarithm of a scale from its prior median beyond which it is cut off: a guard against overflow."""


@dataclass(frozen=True)
class Curves:
    """Points of all curves, in widths of a curve along the abscissa.

    Parameters
    ----------
    x : array, shape (points,)
        Abscissa; ``x + shift`` begins near zero.
    y : array, shape (channels, points)
        Ordinates, decades.
    member : array of int, shape (points,)
        Number of the curve of each point.
    count : int
        Number of curves.
    height : array, shape (channels,)
        Median height of a curve, decades.
    splines : int
        Number of coefficients of the spline of each channel.
    offset : tuple of float or None
        Prior of the standard deviation of the vertical offsets: median in decades, and standard deviation of its
        logarithm. None for curves without vertical offsets.
    drifting : bool
        Whether offsets drift from curve to curve by independent steps about a common mean that may be `TREND` times as
        large; otherwise they are independent of each other.
    """

    x: FloatArray
    y: FloatArray
    member: IntArray
    count: int
    height: FloatArray
    splines: int
    offset: tuple[float, float] | None = None
    drifting: bool = False

    @cached_property
    def centre(self) -> FloatArray:
        """Middle of the abscissae of each curve, shape (curves,)."""
        return np.array(
            [np.ptp(self.x[self.member == k]) / 2 + self.x[self.member == k].min() for k in range(self.count)]
        )

    def begin(self, moved: FloatArray) -> FloatArray:
        """Return where the splines begin for rows of shifted points, which they are laid about, shape (rows,)."""
        return np.asarray((moved.min(axis=1) + moved.max(axis=1) - (self.splines - 3) / CELLS) / 2, dtype=np.float64)

    def spline(self, channel: int, unknowns: FloatArray, shifts: FloatArray, grid: FloatArray) -> FloatArray:
        """Return the curve of a channel for rows of unknowns and shifts (of all curves), shape (rows, grid)."""
        low = self.begin(self.x + shifts[:, self.member])[:, None]
        first, value, _ = _basis((grid - low) * CELLS, self.splines)
        places = channel * self.splines + first[..., None] + np.arange(4)
        return np.asarray(np.sum(value * unknowns[np.arange(len(unknowns))[:, None, None], places], axis=2))

    @cached_property
    def tied(self) -> FloatArray:
        """Prior precision of the vertical offsets, times the square of their scale."""
        if not self.drifting:
            return np.eye(self.count)
        steps = np.eye(self.count) - np.eye(self.count, k=-1)
        known = np.eye(self.count)
        known[1:, 1:] = np.linalg.inv(np.eye(self.count - 1) + TREND**2)
        return np.asarray(steps.T @ known @ steps, dtype=np.float64)

    @cached_property
    def prior(self) -> tuple[FloatArray, FloatArray]:
        """Prior mean and precision of all parameters.

        They are the shifts of all curves but the first in widths; the logarithms of the bend near each curve, channel
        by channel; those of the noise of each channel; and that of the standard deviation of the offsets.
        """
        channels = self.y.shape[0]
        drift = np.diff(np.eye(self.count), axis=0) / BEND_DRIFT
        bends = drift.T @ drift + 1 / (self.count * BEND_SCATTER) ** 2
        scales = [(NOISE / np.log(10), NOISE_SCATTER)] * channels + ([] if self.offset is None else [self.offset])
        means = [np.zeros(self.count - 1), np.repeat(np.log(BEND * self.height), self.count)]
        means.append(np.log([median for median, _ in scales]))
        widths = np.diag([width**-2.0 for _, width in scales])
        return np.concatenate(means), block_diag(step_precision(self.count), *[bends] * channels, widths)


def _pieces() -> tuple[BSpline, BSpline]:
    """Return the four cubic B-splines of a cell of width one, on this cell, and their derivatives."""
    knots = np.arange(-3.0, 5.0)
    pieces = BSpline(knots, np.eye(4), 3)
    return pieces, pieces.derivative()


_VALUES, _SLOPES = _pieces()


@dataclass(frozen=True)
class Solved:
    """The linear part for rows of parameters.

    Parameters
    ----------
    energy : array, shape (rows,)
        Minus the logarithm of the probability density, up to a constant.
    gradient : array, shape (rows, parameters)
    mean : array, shape (rows, unknowns)
        Coefficients of the splines, channel by channel, then offsets.
    factors : Factors
        Cholesky factors of the precision of the coefficients and offsets.
    """

    energy: FloatArray
    gradient: FloatArray
    mean: FloatArray
    factors: Factors

    def unknowns(self, generator: np.random.Generator) -> FloatArray:
        """Return one draw of coefficients and offsets for each row, shape (rows, unknowns)."""
        return self.mean + drawn(self.factors, generator.standard_normal(self.mean.shape))


def solve(curves: Curves, rows: FloatArray) -> Solved:
    """Return density, gradient, and spline coefficients for rows of parameters, shape (rows, parameters).

    The parameters are described at `Curves.prior`. The splines are laid about the shifted curves of each row; the
    gradient leaves out that they move with them, which changes nothing but the place of their knots.
    """
    many, channels, points = rows.shape[0], curves.y.shape[0], curves.x.size
    count, splines, offsets = curves.count, curves.splines, 0 if curves.offset is None else curves.count
    lines, bends = count - 1, channels * count
    middle, known = curves.prior
    away = rows - middle
    logs = middle[lines:] + np.clip(away[:, lines:], -FARTHEST, FARTHEST)
    near = logs[:, :bends].reshape(many, channels, count)
    noise = np.exp(logs[:, bends : bends + channels])
    shifts = np.concatenate([np.zeros((many, 1)), rows[:, :lines]], axis=1)

    moved = curves.x + shifts[:, curves.member]
    low = curves.begin(moved)[:, None]
    first, value, slope = _basis((moved - low) * CELLS, splines)
    apart = (low + np.arange(splines - 2) / CELLS)[..., None] - (curves.centre + shifts)[:, None]
    share = softmax(-0.5 * (apart / REACH) ** 2, axis=2)
    bend = np.einsum("wjk,wck->wcj", share, near)
    stiffness, weight = np.exp(-2 * bend), 1 / (noise**2 + ROUNDING**2)
    tied = np.zeros((many, 0, 0))
    if offsets:
        tied = curves.tied * np.exp(-2 * logs[:, -1, None, None])
    factors, linear = solve_rows(first, value, slope, curves.member, curves.y, weight, stiffness, tied)

    left, by_bend = curves.y - linear.fitted, 1 - linear.rough * stiffness
    squares = np.sum(left**2 + linear.variance, axis=2)
    change = share[:, None] * (near[:, :, None] - bend[..., None]) * (apart / REACH**2)[:, None]
    turn = np.einsum("wc,wcp->wp", weight, linear.tilt - left * linear.slope)
    by_place = np.einsum("wcj,wcjk->wk", by_bend, change)
    # at the mean, the exponent is half the weighted residuals times the ordinates
    energy = 0.5 * linear.log_determinant + 0.5 * np.sum(weight * np.sum(left * curves.y, axis=2), axis=1)
    energy += np.sum(bend, axis=(1, 2)) - 0.5 * points * np.sum(np.log(weight), axis=1)
    gradient = np.zeros_like(rows)
    gradient[:, :lines] = (turn * CELLS @ np.eye(count)[curves.member] + by_place)[:, 1:]
    gradient[:, lines : lines + bends] = np.einsum("wcj,wjk->wck", by_bend, share).reshape(many, bends)
    gradient[:, lines + bends : lines + bends + channels] = (points / weight - squares) * (weight * noise) ** 2
    if offsets:
        found = linear.mean[:, -offsets:]
        squared = found[:, :, None] * found[:, None] + linear.offsets
        energy += offsets * logs[:, -1]
        gradient[:, -1] = offsets - np.sum(squared * tied, axis=(1, 2))
    pull = away @ known
    return Solved(energy + 0.5 * np.sum(pull * away, axis=1), gradient + pull, linear.mean, factors)


def _basis(place: FloatArray, splines: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the first of the four splines at each place in cells, their values, and their derivatives there."""
    # places that are no numbers, of rows gone astray, must not become indices; their values stay no numbers
    first = np.clip(np.nan_to_num(np.floor(place)), 0, splines - 4).astype(np.intp)
    inside = np.clip(place - first, 0.0, 1.0)
    slope = _SLOPES(inside)
    return first, _VALUES(inside) + (place - first - inside)[..., None] * slope, slope


def step_precision(count: int) -> FloatArray:
    """Return the prior precision of the shifts of all curves but the first, in widths."""
    steps = np.eye(count - 1) - np.eye(count - 1, k=-1)
    covariance = STEP_SCATTER**2 * np.eye(count - 1) + STEP_MEAN**2
    return np.asarray(steps.T @ np.linalg.inv(covariance) @ steps, dtype=np.float64)
