"""Probability density of the shifts of curves that are pieces of one smooth curve, and the gradient of this density.

Each channel c of a curve k (such as storage and loss modulus of one temperature) is

    y_c(x) = Q_c(x + h_k) - v_k + noise_c,

with a horizontal shift h_k and a vertical offset v_k common to all channels. Q_c is a cubic B-spline. The prior of the
second differences of its coefficients is a normal distribution (P. H. C. Eilers, B. D. Marx, Stat. Sci. 11 (1996) 89).
The prior of the offsets is a normal distribution too. The density is integrated over spline coefficients and offsets in
closed form. The result depends only on the shifts and a few scale parameters.
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
"""Number of spline cells along a curve of median width; five cells do not resolve sharp bends."""

MARGIN = 0.5
"""Distance by which the spline extends on each side beyond the curves after the first shift, in widths of a curve."""

ROUNDING = 1e-5
"""Smallest scatter of a curve, decades: the rounding of a table with five digits."""

STEP_MEAN, STEP_SCATTER = 1.0, 0.5
"""Prior standard deviations of the mean step between neighbouring curves, and of each step about it, in widths."""

BEND, BEND_SCATTER, BEND_DRIFT = 0.02, 3.0, 1.0
"""Prior of the bend near each curve: the standard deviation of the second differences of the spline.

The numbers are its median, in heights of a curve, and the standard deviations of its logarithm and of the change of
this logarithm from one curve to the next. The bend varies, because a master curve is bent in some places only.
"""

REACH = 0.3
"""Distance over which the bend changes from one curve to the next, in widths of a curve."""

NOISE, NOISE_SCATTER = 0.01, 2.0
"""Prior of the relative scatter of each channel: median, and standard deviation of the logarithm of the scatter."""

TREND = 10.0
"""Ratio of two prior standard deviations of drifting offsets: of the mean step, and of steps about the mean step."""

FARTHEST = 8.0
"""Largest distance of the logarithm of a scale from its prior median. This limit prevents overflow."""


@dataclass(frozen=True)
class Curves:
    """Points of all curves; abscissae are divided by the median width of a curve, ordinates are in decades.

    `member` is the index of the curve of each point, and `height` is the median height of a curve in each channel.
    `splines` is the number of spline coefficients of each channel. `offset` describes the prior of the standard
    deviation s of the vertical offsets: the median of s in decades, and the standard deviation of ln s. Without
    offsets, `offset` is None. If `drifting` is True, the offsets change from curve to curve by steps. A step is a mean
    step plus a scatter. The prior standard deviation of the mean step is `TREND` times the standard deviation of the
    scatter.
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
        """Return the abscissa at which the spline of each row begins; the spline is centred on the shifted points."""
        return np.asarray((moved.min(axis=1) + moved.max(axis=1) - (self.splines - 3) / CELLS) / 2, dtype=np.float64)

    def spline(self, channel: int, unknowns: FloatArray, shifts: FloatArray, grid: FloatArray) -> FloatArray:
        """Return the spline of a channel at the abscissae `grid`, shape (rows, grid)."""
        low = self.begin(self.x + shifts[:, self.member])[:, None]
        first, value, _ = _basis((grid - low) * CELLS, self.splines)
        places = channel * self.splines + first[..., None] + np.arange(4)
        return np.asarray(np.sum(value * unknowns[np.arange(len(unknowns))[:, None, None], places], axis=2))

    @cached_property
    def tied(self) -> FloatArray:
        """Prior precision of the vertical offsets if the standard deviation of the offsets (or of their steps) is 1."""
        if not self.drifting:
            return np.eye(self.count)
        steps = np.eye(self.count) - np.eye(self.count, k=-1)
        known = np.eye(self.count)
        known[1:, 1:] = np.linalg.inv(np.eye(self.count - 1) + TREND**2)
        return np.asarray(steps.T @ known @ steps, dtype=np.float64)

    @cached_property
    def prior(self) -> tuple[FloatArray, FloatArray]:
        """Prior mean and precision of all parameters.

        The parameters are: the shifts of all curves except the first, in widths of a curve; for each channel, the
        logarithms of the bend near each curve (see `BEND`); the logarithm of the noise of each channel; and, if there
        are offsets, the logarithm of their standard deviation.
        """
        channels = self.y.shape[0]
        drift = np.diff(np.eye(self.count), axis=0) / BEND_DRIFT
        bends = drift.T @ drift + 1 / (self.count * BEND_SCATTER) ** 2
        scales = [(NOISE / np.log(10), NOISE_SCATTER)] * channels + ([] if self.offset is None else [self.offset])
        means = [np.zeros(self.count - 1), np.repeat(np.log(BEND * self.height), self.count)]
        means.append(np.log([median for median, _ in scales]))
        widths = np.diag([width**-2.0 for _, width in scales])
        return np.concatenate(means), block_diag(step_precision(self.count), *[bends] * channels, widths)


_VALUES = BSpline(np.arange(-3.0, 5.0), np.eye(4), 3)  # the four cubic B-splines that overlap on a cell of width 1
_SLOPES = _VALUES.derivative()


@dataclass(frozen=True)
class Solved:
    """Density of the parameters, and distribution of the spline coefficients and offsets, for each row of parameters.

    `energy` is the negative logarithm of the density, up to a constant. `mean` contains the mean coefficients of the
    splines, channel by channel, then the offsets; `factors` are the Cholesky factors of the precision matrix of these
    unknowns.
    """

    energy: FloatArray
    gradient: FloatArray
    mean: FloatArray
    factors: Factors

    def unknowns(self, generator: np.random.Generator) -> FloatArray:
        """Return one draw of coefficients and offsets for each row, shape (rows, unknowns)."""
        return self.mean + drawn(self.factors, generator.standard_normal(self.mean.shape))


def solve(curves: Curves, rows: FloatArray) -> Solved:
    """Return density, gradient and spline coefficients for each row of parameters (see `Curves.prior`).

    The gradient neglects that the knots of the splines move with the curves, because this movement hardly changes the
    density.
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
    # at the mean coefficients, the exponent of the density is minus half the sum of weight * residual * ordinate
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
    """Return the first of the four splines at each position (in cells), and values and slopes of all four splines."""
    # in a diverged row, positions may be NaN or infinite; such positions must not become indices
    first = np.clip(np.nan_to_num(np.floor(place)), 0, splines - 4).astype(np.intp)
    inside = np.clip(place - first, 0.0, 1.0)
    slope = _SLOPES(inside)
    return first, _VALUES(inside) + (place - first - inside)[..., None] * slope, slope


def step_precision(count: int) -> FloatArray:
    """Return the prior precision of the shifts of all curves except the first. Shifts are in widths of a curve."""
    steps = np.eye(count - 1) - np.eye(count - 1, k=-1)
    covariance = STEP_SCATTER**2 * np.eye(count - 1) + STEP_MEAN**2
    return np.asarray(steps.T @ np.linalg.inv(covariance) @ steps, dtype=np.float64)
