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
    covariance : array, shape (rows, unknowns, unknowns)
    """

    energy: FloatArray
    gradient: FloatArray
    mean: FloatArray
    covariance: FloatArray


def solve(curves: Curves, rows: FloatArray) -> Solved:
    """Return density, gradient, and spline coefficients for rows of parameters, shape (rows, parameters).

    The parameters are described at `Curves.prior`. The splines are laid about the shifted curves of each row; the
    gradient leaves out that they move with them, which changes nothing but the place of their knots.
    """
    many, channels, points = rows.shape[0], curves.y.shape[0], curves.x.size
    count, splines, offsets = curves.count, curves.splines, 0 if curves.offset is None else curves.count
    unknowns, lines, bends = channels * splines + offsets, count - 1, channels * count
    middle, known = curves.prior
    away = rows - middle
    logs = middle[lines:] + np.clip(away[:, lines:], -FARTHEST, FARTHEST)
    near = logs[:, :bends].reshape(many, channels, count)
    noise = np.exp(logs[:, bends : bends + channels])
    shifts = np.concatenate([np.zeros((many, 1)), rows[:, :lines]], axis=1)

    moved = curves.x + shifts[:, curves.member]
    low = curves.begin(moved)[:, None]
    first, value, slope = _basis((moved - low) * CELLS, splines)
    columns = first[..., None] + np.arange(4)
    if offsets:
        columns = np.concatenate([columns, np.broadcast_to(curves.member[:, None], (many, points, 1))], axis=2)
        value = np.concatenate([value, np.full((many, points, 1), -1.0)], axis=2)
    apart = (low + np.arange(splines - 2) / CELLS)[..., None] - (curves.centre + shifts)[:, None]
    share = softmax(-0.5 * (apart / REACH) ** 2, axis=2)
    bend = np.einsum("wjk,wck->wcj", share, near)

    second = np.diff(np.eye(splines), 2, axis=0)
    base = np.arange(many)[:, None, None] * unknowns
    precision, right = np.zeros((many, unknowns, unknowns)), np.zeros((many, unknowns))
    weight = 1 / (noise**2 + ROUNDING**2)
    places = []
    for c in range(channels):
        at = np.concatenate([columns[..., :4] + c * splines, columns[..., 4:] + channels * splines], axis=2)
        places.append(at)
        weighted = weight[:, c, None, None] * value
        pairs = ((base + at)[..., :, None] * unknowns + at[..., None, :]).ravel()
        products = (weighted[..., :, None] * value[..., None, :]).ravel()
        precision += np.bincount(pairs, products, many * unknowns**2).reshape(precision.shape)
        parts = (weighted * curves.y[c, :, None]).ravel()
        right += np.bincount((base + at).ravel(), parts, many * unknowns).reshape(right.shape)
        block = slice(c * splines, (c + 1) * splines)
        precision[:, block, block] += second.T @ (second * np.exp(-2 * bend[:, c, :, None]))
    if offsets:
        precision[:, -offsets:, -offsets:] += curves.tied * np.exp(-2 * logs[:, -1, None, None])
    covariance, log_determinant = _inverse(precision, channels, splines)
    mean = (covariance @ right[..., None])[..., 0]

    energy = 0.5 * log_determinant - 0.5 * np.sum(right * mean, axis=1)
    gradient = np.zeros_like(rows)
    turn, by_place = np.zeros((many, points)), np.zeros((many, count))
    each = np.arange(many)[:, None, None]
    for c, at in enumerate(places):
        solved = mean[each, at]
        left = curves.y[c] - np.sum(value * solved, axis=2)
        spread = (covariance[each[..., None], at[..., :, None], at[..., None, :]] @ value[..., None])[..., 0]
        tilt = np.sum(slope * solved[..., :4], axis=2)
        turn += weight[:, c, None] * (np.sum(slope * spread[..., :4], axis=2) - left * tilt)
        energy += 0.5 * weight[:, c] * np.sum(curves.y[c] ** 2) - 0.5 * points * np.log(weight[:, c])
        energy += np.sum(bend[:, c], axis=1)
        squares = np.sum(left**2, axis=1) + np.sum(value * spread, axis=(1, 2))
        gradient[:, lines + bends + c] = (points / weight[:, c] - squares) * (weight[:, c] * noise[:, c]) ** 2
        block = slice(c * splines, (c + 1) * splines)
        rough = (mean[:, block] @ second.T) ** 2 + np.sum((second @ covariance[:, block, block]) * second, axis=2)
        by_bend = 1 - rough * np.exp(-2 * bend[:, c])
        gradient[:, lines + c * count : lines + (c + 1) * count] = np.einsum("wj,wjk->wk", by_bend, share)
        change = share * (near[:, c, None] - bend[:, c, :, None]) * apart / REACH**2
        by_place += np.einsum("wj,wjk->wk", by_bend, change)
    if offsets:
        own = np.sum(mean[:, -offsets:] @ curves.tied * mean[:, -offsets:], axis=1)
        own += np.sum(covariance[:, -offsets:, -offsets:] * curves.tied, axis=(1, 2))
        energy += offsets * logs[:, -1]
        gradient[:, -1] = offsets - own * np.exp(-2 * logs[:, -1])
    gradient[:, :lines] = (turn * CELLS @ np.eye(count)[curves.member] + by_place)[:, 1:]
    pull = away @ known
    return Solved(energy + 0.5 * np.sum(pull * away, axis=1), gradient + pull, mean, covariance)


def _inverse(precision: FloatArray, channels: int, splines: int) -> tuple[FloatArray, FloatArray]:
    """Return inverses and log determinants of precisions in which channels are tied by the offsets alone."""
    blocks = [slice(c * splines, (c + 1) * splines) for c in range(channels)]
    alone = [np.linalg.inv(precision[:, block, block]) for block in blocks]
    log_determinant = sum(np.linalg.slogdet(precision[:, block, block])[1] for block in blocks)
    covariance = np.zeros_like(precision)
    offsets = slice(channels * splines, None)
    if precision.shape[1] > channels * splines:
        gains = [one @ precision[:, block, offsets] for one, block in zip(alone, blocks, strict=True)]
        rest = precision[:, offsets, offsets] - sum(
            precision[:, offsets, block] @ gain for gain, block in zip(gains, blocks, strict=True)
        )
        inner = np.linalg.inv(rest)
        log_determinant = log_determinant + np.linalg.slogdet(rest)[1]
        gain = np.concatenate(gains, axis=1)
        covariance[:, : offsets.start, : offsets.start] = gain @ inner @ gain.transpose(0, 2, 1)
        covariance[:, : offsets.start, offsets] = -gain @ inner
        covariance[:, offsets, : offsets.start] = covariance[:, : offsets.start, offsets].transpose(0, 2, 1)
        covariance[:, offsets, offsets] = inner
    for one, block in zip(alone, blocks, strict=True):
        covariance[:, block, block] += one
    return covariance, np.asarray(log_determinant)


def _basis(place: FloatArray, splines: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the first of the four splines at each place in cells, their values, and their derivatives there."""
    first = np.clip(np.floor(place), 0, splines - 4).astype(np.intp)
    inside = np.clip(place - first, 0.0, 1.0)
    slope = _SLOPES(inside)
    return first, _VALUES(inside) + (place - first - inside)[..., None] * slope, slope


def step_precision(count: int) -> FloatArray:
    """Return the prior precision of the shifts of all curves but the first, in widths."""
    steps = np.eye(count - 1) - np.eye(count - 1, k=-1)
    covariance = STEP_SCATTER**2 * np.eye(count - 1) + STEP_MEAN**2
    return np.asarray(steps.T @ np.linalg.inv(covariance) @ steps, dtype=np.float64)
