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
from scipy.linalg import LinAlgError, block_diag, cholesky_banded
from scipy.linalg.lapack import dtbtrs
from scipy.special import softmax

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit

ORDER = 4
"""Number of cubic B-splines that overlap at a point."""

CELLS = 8
"""Number of spline cells along a curve of median width; five cells do not resolve sharp bends."""

ROUNDING = 1e-5
"""Smallest scatter of a curve, decades: the rounding error of a table with five digits."""

STEP_MEAN, STEP_SCATTER = 1.0, 0.5
"""Prior standard deviations, in curve widths, of the mean step between shifts and of the steps about this mean."""

BEND, NOISE = 0.02, 0.01
"""Prior medians of the bend near each curve, in heights of a curve, and of the relative scatter of each channel.

The bend is the standard deviation of the second differences of the spline.
"""

SCALE_SCATTER = 3.0
"""Prior standard deviation of ln(scatter), and of the mean of ln(bend) over all curves of a channel.

Two standard deviations are a factor of 400.

The logarithm of the bend is assumed to change by about 1 from one curve to the next, because a master curve is bent in
some places only.
"""

REACH = 0.3
"""Distance over which the bend changes from one curve to the next, in widths of a curve."""

TREND = 10.0
"""Prior standard deviation of the mean step of drifting offsets, divided by that of the steps about this mean."""

FARTHEST = 8.0
"""Largest distance of ln(bend), ln(noise) or ln(offset scatter) from its prior median.

No shift exceeds this number of curve widths times the number of curves. The limits prevent overflow.
"""


@dataclass(frozen=True)
class Curves:
    """Points of all curves; abscissae are divided by the median width of a curve, ordinates are in decades.

    `member` is the index of the curve of each point, and `height` is the median height of a curve in each channel.
    `splines` is the number of spline coefficients of each channel. `offset` describes the prior of the standard
    deviation s of the vertical offsets: the median of s in decades, and the standard deviation of ln s. Without
    offsets, `offset` is None. If `drifting` is True, the offsets change from curve to curve by steps. A step is the
    sum of a mean, common to all steps, and a scatter. The prior standard deviation of the mean is `TREND` times that of
    the scatter.
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
        """For each row of `moved` (shifted abscissae), return the start of a spline that is centred on the row."""
        return np.asarray((moved.min(axis=1) + moved.max(axis=1) - (self.splines - 3) / CELLS) / 2, dtype=np.float64)

    def spline(self, channel: int, unknowns: FloatArray, shifts: FloatArray, grid: FloatArray) -> FloatArray:
        """Return the spline of a channel at the abscissae `grid`, shape (rows, grid)."""
        low = self.begin(self.x + shifts[:, self.member])[:, None]
        first, value, _ = _basis((grid - low) * CELLS, self.splines)
        places = channel * self.splines + first[..., None] + np.arange(ORDER)
        return np.asarray(np.vecdot(value, unknowns[np.arange(len(unknowns))[:, None, None], places]))

    @cached_property
    def tied(self) -> FloatArray:
        """Inverse prior covariance of the vertical offsets, for offsets or steps with a standard deviation of 1."""
        if not self.drifting:
            return np.eye(self.count)
        steps = np.eye(self.count) - np.eye(self.count, k=-1)
        known = np.eye(self.count)
        known[1:, 1:] = np.linalg.inv(np.eye(self.count - 1) + TREND**2)
        return np.asarray(steps.T @ known @ steps, dtype=np.float64)

    @cached_property
    def prior(self) -> tuple[FloatArray, FloatArray]:
        """Prior mean and inverse prior covariance of all parameters.

        The parameters are: the shifts of all curves except the first, in widths of a curve; for each channel, the
        logarithms of the bend near each curve (see `BEND`); the logarithm of the noise of each channel; and, if there
        are offsets, the logarithm of their standard deviation.
        """
        channels = self.y.shape[0]
        drift = np.diff(np.eye(self.count), axis=0)
        bends = drift.T @ drift + 1 / (self.count * SCALE_SCATTER) ** 2
        scales = [(NOISE / np.log(10), SCALE_SCATTER)] * channels + ([] if self.offset is None else [self.offset])
        means = [np.zeros(self.count - 1), np.repeat(np.log(BEND * self.height), self.count)]
        means.append(np.log([median for median, _ in scales]))
        widths = np.diag([width**-2.0 for _, width in scales])
        steps = np.eye(self.count - 1) - np.eye(self.count - 1, k=-1)
        shifts = steps.T @ np.linalg.inv(step_covariance(self.count)) @ steps
        return np.concatenate(means), block_diag(shifts, *[bends] * channels, widths)


# coefficients of the four cubic B-splines that overlap on a cell; one row for each power of the position in the cell
_VALUES = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6
_SLOPES = np.arange(1, ORDER)[:, None] * _VALUES[1:]


@dataclass(frozen=True)
class Solved:
    """Density of the parameters, and distribution of the spline coefficients and offsets, for each row of parameters.

    `energy` is the negative logarithm of the density, up to a constant, and `gradient` contains its derivatives with
    respect to the parameters. `mean` contains the mean coefficients of the splines, channel by channel, then the
    offsets. `factor`, `gain` and `covariance` are U, G and C of `solve`.
    """

    energy: FloatArray
    gradient: FloatArray
    mean: FloatArray
    factor: FloatArray
    gain: FloatArray
    covariance: FloatArray

    def unknowns(self, generator: np.random.Generator) -> FloatArray:
        """Return one draw of coefficients and offsets for each row, shape (rows, unknowns)."""
        many, coefficients, _ = self.gain.shape
        normal = generator.standard_normal(self.mean.shape)
        offsets = np.linalg.cholesky(self.covariance) @ normal[:, coefficients:, None]
        free = dtbtrs(self.factor, normal[:, :coefficients].reshape(-1, 1))[0].reshape(many, -1, 1)
        return np.asarray(self.mean + np.concatenate([free - self.gain @ offsets, offsets], axis=1)[..., 0])


def solve(curves: Curves, rows: FloatArray) -> Solved:
    """Return density, gradient and spline coefficients for each row of parameters (see `Curves.prior`).

    The unknowns of a row are the spline coefficients of all channels and the offsets. Their precision matrix is

        [ A    B ]
        [ B^T  D ].

    With G = A^-1 B, the offsets have the covariance C = (D - B^T G)^-1, and the coefficients have the covariance
    A^-1 + G C G^T. Four splines overlap at a point; therefore A is banded. The matrices A of all rows are the diagonal
    blocks of one banded matrix, which is factorised into U^T U. Banded matrices M are stored by diagonals:
    ``band[d, k]`` is M[k - d, k].

    The gradient neglects that the knots of the splines move with the curves, because this movement hardly changes the
    density.
    """
    many, channels, points = rows.shape[0], curves.y.shape[0], curves.x.size
    count, splines, offsets = curves.count, curves.splines, 0 if curves.offset is None else curves.count
    lines, bends = count - 1, channels * count
    middle, known = curves.prior
    away = rows - middle
    # the limits keep all numbers finite if a chain diverges
    logs = middle[lines:] + np.clip(away[:, lines:], -FARTHEST, FARTHEST)
    shifts = np.pad(np.clip(rows[:, :lines], -FARTHEST * count, FARTHEST * count), ((0, 0), (1, 0)))
    near = logs[:, :bends].reshape(many, channels, count)
    noise = np.exp(logs[:, bends : bends + channels])
    moved = curves.x + shifts[:, curves.member]
    low = curves.begin(moved)[:, None]
    first, value, slope = _basis((moved - low) * CELLS, splines)
    apart = (low + np.arange(splines - 2) / CELLS)[..., None] - (curves.centre + shifts)[:, None]
    share = softmax(-0.5 * (apart / REACH) ** 2, axis=2)
    bend = near @ share.swapaxes(1, 2)
    weight = 1 / (noise**2 + ROUNDING**2)

    # besides its points, a channel has a datum for each second difference of its spline coefficients: the value 0
    bent = np.array([[1.0, -2.0, 1.0, 0.0]] * (splines - 3) + [[0.0, 1.0, -2.0, 1.0]])
    first = np.hstack([first, np.tile(np.minimum(np.arange(splines - 2), splines - ORDER), (many, 1))])
    value = np.concatenate([value, np.tile(bent, (many, 1, 1))], axis=1)[:, None]
    target = np.pad(curves.y, ((0, 0), (0, splines - 2)))
    precision = np.concatenate([np.repeat(weight[..., None], points, axis=2), np.exp(-2 * bend)], axis=2)
    blocks = splines * np.arange(many * channels).reshape(many, channels, 1, 1)
    at = blocks + first[:, None, :, None] + np.arange(ORDER)  # the four coefficients that determine each datum
    weighted = precision[..., None] * value

    def total(places: IntArray, values: FloatArray, columns: int = 1) -> FloatArray:
        summed = np.bincount(places.ravel(), values.ravel(), many * channels * splines * columns)
        return np.asarray(summed, dtype=np.float64)

    band = np.array([total(at[..., d:], weighted[..., d:] * value[..., : ORDER - d]) for d in range(ORDER)])
    sides = total(at, weighted * target[..., None])[:, None]
    of_offsets, tied = np.zeros((many, 0)), np.zeros((many, 0, 0))
    corner = tied
    if offsets:
        ties = (
            at[:, :, :points] * count + curves.member[:, None]
        )  # one index for each pair of a coefficient and an offset
        sides = np.hstack([sides, -total(ties, weighted[:, :, :points], count).reshape(-1, count)])
        of_offsets = -weight @ curves.y @ np.eye(count)[curves.member]
        tied = curves.tied * np.exp(-2 * logs[:, -1, None, None])
        corner = tied + np.sum(weight, axis=1)[:, None, None] * np.diag(np.bincount(curves.member))
    try:
        factor = cholesky_banded(band[::-1], check_finite=False)
    except LinAlgError:  # a chain diverges, and the matrix is not positive definite because of rounding
        band[0] *= 1 + 20 * np.finfo(np.float64).eps  # a row has 7 entries, each with 5 rounding errors of eps / 2
        factor = cholesky_banded(band[::-1], check_finite=False)
    half = dtbtrs(factor, sides, trans="T")[0]  # M = U^-T B; B^T A^-1 B, computed as M^T M, loses fewer digits
    half, solved = (each.reshape(many, channels * splines, 1 + offsets) for each in (half, dtbtrs(factor, half)[0]))
    alone, gain, border = solved[..., :1], solved[..., 1:], half[..., 1:].swapaxes(1, 2)
    corner = corner - border @ half[..., 1:]
    covariance = np.asarray(np.linalg.inv(corner), dtype=np.float64)
    found = covariance @ (of_offsets[..., None] - border @ half[..., :1])
    mean, found = (alone - gain @ found)[..., 0], found[..., 0]
    log_determinant = 2 * np.sum(np.log(factor[-1]).reshape(many, -1), axis=1) + np.linalg.slogdet(corner)[1]

    # band of the covariance of the coefficients, and the negative covariance of coefficients and offsets
    within, cross = _inverse_band(factor[::-1]).reshape(ORDER, many, -1), gain @ covariance
    for d in range(ORDER):
        within[d, :, d:] += np.vecdot(cross[:, d:], gain[:, : gain.shape[1] - d])

    # for each datum: residual and its variance; for each point: slope of the curve, covariance of slope and residual
    own, slope, inner = np.take(mean, at), slope[:, None], slice(points)
    left, steep = target - np.vecdot(value, own), np.vecdot(slope, own[:, :, inner])
    variance, tilt = np.zeros_like(left), np.zeros_like(steep)
    for d in range(ORDER):
        near_by = np.take(within[d], at[..., d:])
        one, other = value[..., d:] * near_by, value[..., : ORDER - d] * near_by
        variance += (1 + (d > 0)) * np.vecdot(one, value[..., : ORDER - d])
        tilt += np.vecdot(slope[..., d:], other[:, :, inner])
        if d:
            tilt += np.vecdot(slope[..., : ORDER - d], one[:, :, inner])
    if offsets:
        tie = np.take(cross, ties)
        left[:, :, inner] += found[:, None, curves.member]
        variance[:, :, inner] += np.diagonal(covariance, axis1=1, axis2=2)[:, None, curves.member]
        variance[:, :, inner] += 2 * np.vecdot(value[:, :, inner], tie)
        tilt += np.vecdot(slope, tie)

    # at the mean coefficients, the exponent of the density is minus half the sum of precision * residual * datum
    pull = away @ known
    energy = 0.5 * (log_determinant + np.sum(precision * left * target - np.log(precision), axis=(1, 2)))
    energy += 0.5 * np.sum(pull * away, axis=1)
    # derivative of the energy with respect to the logarithm of the standard deviation of each datum
    by_scale = 1 - precision * (left**2 + variance)
    by_bend, lever = by_scale[..., points:], share * apart / REACH**2
    turn = np.sum(weight[..., None] * (tilt - left[:, :, inner] * steep), axis=1)
    by_shift = CELLS * turn @ np.eye(count)[curves.member]
    by_shift += np.sum(near * (by_bend @ lever) - (by_bend * bend) @ lever, axis=1)
    by_noise = np.sum(by_scale[:, :, inner], axis=2) * weight * noise**2
    gradient = [by_shift[:, 1:], (by_bend @ share).reshape(many, bends), by_noise]
    if offsets:
        energy += offsets * logs[:, -1]
        squares = found[:, :, None] * found[:, None] + covariance
        gradient.append(offsets - np.sum(squares * tied, axis=(1, 2))[:, None])
    mean = np.hstack([mean, found])
    return Solved(energy, np.hstack(gradient) + pull, mean, factor, gain, covariance)


@jit
def _inverse_band(factor: FloatArray) -> FloatArray:
    """Return the band of the inverse of U^T U by the recursion of Takahashi, Fagan and Chin (1973)."""
    width, size = factor.shape
    inverse = np.zeros((width, size))
    for j in range(size - 1, -1, -1):
        last = min(j + width, size) - 1
        for i in range(last, j - 1, -1):
            rest = 1 / factor[0, j] if i == j else 0.0
            for k in range(j + 1, last + 1):
                rest -= inverse[abs(i - k), max(i, k)] * factor[k - j, k]
            inverse[i - j, i] = rest / factor[0, j]
    return inverse


def _basis(place: FloatArray, splines: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the index of the first of four splines at each position (in cells), and values and slopes of all four.

    Outside the cells, a spline is continued by its tangent.
    """
    first = np.clip(np.floor(place), 0, splines - ORDER).astype(np.intp)
    inside = np.clip(place - first, 0.0, 1.0)
    powers = np.vander(inside.ravel(), ORDER, increasing=True).reshape(*inside.shape, ORDER)
    slope = powers[..., :-1] @ _SLOPES
    return first, powers @ _VALUES + (place - first - inside)[..., None] * slope, slope


def step_covariance(count: int) -> FloatArray:
    """Return the prior covariance of the steps between neighbouring curves, in squared widths of a curve."""
    return np.asarray(STEP_SCATTER**2 * np.eye(count - 1) + STEP_MEAN**2, dtype=np.float64)
