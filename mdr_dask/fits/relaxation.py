"""One exponential, and what to fit where one is not enough, to the mean of traces that relax to zero."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.fits.base import DOUBTFUL, WITHIN

Law = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]

WINDOW = 8.0  # over the expected rate
FLOOR = 0.01  # of the largest relaxing part: what the grid adds to the standard error of a moment (docs/kinetics.md)
ENOUGH = 2e-3  # share of the squared trace below which what is left may be the grid's: FLOOR at every moment
GRID = 121
ROUNDS = 6
STEPS, STEPS_ON = 25, 8  # from a guess, and from the fit to the trace itself to that of a resample
SHAPED = 200  # resamples to which more than one exponential is fitted

RATE_FIELDS = {
    "rate": ("1", "rate b of one exponential in t' = (t - t_0) / tau, eq. 4.5; weights 1 / variance of the mean"),
    "rate_unweighted": ("1", "the same with every stretch of time counting alike"),
    "amplitude": ("1", "amplitude mu* of one exponential"),
    "integral_rate": ("1", "relaxing part at t_0+ over its integral in t': a rate without a model"),
}
AMPLITUDE_FIELDS = {
    "amplitude_unweighted": ("1", "amplitude mu* with every stretch of time counting alike"),
    "two_amplitude": ("1", "amplitude of two exponentials together"),
}
SHAPE_FIELDS = {
    "stretched_rate": ("1", "rate b of exp(-(b t')^beta), where one exponential is not enough"),
    "stretched_exponent": ("1", "its exponent beta"),
    "fast_rate": ("1", "greater rate of two exponentials, where one is not enough"),
    "slow_rate": ("1", "smaller rate of two exponentials"),
    "fast_share": ("1", "share of the amplitude that relaxes at the greater rate; negative where it grows first"),
}


class Left(NamedTuple):
    """What a law leaves of a mean trace.

    Attributes
    ----------
    unexplained : float
        Weighted share of the squared trace.
    rms, largest : float
        Residual over the largest relaxing part, every moment of the log-spaced times alike.
    probability : float
        How often scatter and errors leave as much, the smaller one of both ways to weigh the moments.
    """

    unexplained: float
    rms: float
    largest: float
    probability: float


LAWS = {"one": "one exponential", "stretched": "a stretched exponential", "two": "two exponentials"}


def _left(
    residuals: FloatArray, trace: FloatArray, weights: FloatArray, count: int, draws: int = bootstrap.RESAMPLES
) -> Left:
    relative = np.abs(residuals[0]) / np.abs(trace).max()
    chances = (bootstrap.chance(residuals * weight, count, draws) for weight in (np.sqrt(weights), 1.0))
    return Left(
        float(residuals[0] ** 2 @ weights / (trace**2 @ weights)),
        float(np.sqrt(np.mean(relative**2))),
        float(relative.max()),
        min(chances),
    )


def widths(time: FloatArray) -> FloatArray:
    """Return the weights of the trapezoidal rule, so that every stretch of time counts alike."""
    step = np.diff(time)
    weights: FloatArray = 0.5 * (np.append(step, 0.0) + np.append(0.0, step))
    return weights


def point_weights(time: FloatArray, trace: FloatArray, error: FloatArray) -> FloatArray:
    """Return the weights of the points of a mean trace: its variance inverted, for every stretch of time alike.

    The points of a log-spaced grid crowd at the start, where they all say the same: each stands for its stretch.
    """
    variance = error**2 + (FLOOR * np.abs(trace).max()) ** 2
    weights: FloatArray = widths(time) / variance
    weights /= weights.sum()
    return weights


def exponential(time: FloatArray, traces: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit one exponential to each of many traces by weighted least squares, the amplitude eliminated.

    Parameters
    ----------
    time : array, shape (m,)
        From zero, or soon after, on.
    traces : array, shape (n, m)
        What relaxes to zero.
    weights : array, shape (m,)
        Of the squared residuals.

    Returns
    -------
    rate, amplitude, unexplained : array, shape (n,)
        The last one is the weighted share of the squared trace that is left.
    """
    logs = np.linspace(np.log(0.02 / time[-1]), np.log(2 / time[time > 0][0]), GRID)
    pulled = weights * traces

    def gain(shape: FloatArray, overlap: FloatArray) -> FloatArray:
        explained: FloatArray = overlap**2 / (shape**2 @ weights)
        return explained

    shape = np.exp(-np.exp(logs)[:, None] * time)
    centre = logs[1:-1][np.argmax(gain(shape, pulled @ shape.T)[:, 1:-1], axis=1)]
    step = logs[1] - logs[0]
    for _ in range(ROUNDS):
        near = np.exp(-np.exp(centre[:, None] + step * np.array([-1.0, 0.0, 1.0]))[..., None] * time)
        left, middle, right = gain(near, np.einsum("nkm,nm->nk", near, pulled)).T
        bend = left - 2 * middle + right
        with np.errstate(invalid="ignore", divide="ignore"):
            shift = np.where(bend < 0, 0.5 * (left - right) / bend, np.sign(right - left))
        centre = centre + step * np.clip(shift, -1, 1)
        step *= 0.25
    rate = np.exp(centre)
    curve = np.exp(-rate[:, None] * time)
    amplitude = np.sum(pulled * curve, axis=1) / (curve**2 @ weights)
    return rate, amplitude, _unexplained(traces, amplitude[:, None] * curve, weights)


def _unexplained(traces: FloatArray, curves: FloatArray, weights: FloatArray) -> FloatArray:
    left: FloatArray = (traces - curves) ** 2 @ weights / (traces**2 @ weights)
    return left


def stretched(p: FloatArray, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return A exp(-(b t)^beta) and its derivatives by p = (A, ln b, ln beta); shapes (n, m) and (n, m, 3)."""
    amplitude, beta = p[:, :1], np.exp(p[:, 2:])
    logarithm = p[:, 1:2] + np.log(np.maximum(time, 1e-300))
    power = np.exp(np.minimum(beta * logarithm, 300.0))
    curve = np.exp(-power)
    sloped = -amplitude * curve * np.minimum(power, 700.0) * beta
    return amplitude * curve, np.stack([curve, sloped, sloped * logarithm], axis=-1)


def double(p: FloatArray, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return A exp(-a t) + B exp(-b t) and its derivatives by p = (A, B, ln a, ln b)."""
    rates = np.exp(p[:, 2:, None]) * time
    curves = np.exp(-rates)
    sloped = -p[:, :2, None] * rates * curves
    total: FloatArray = np.sum(p[:, :2, None] * curves, axis=1)
    return total, np.moveaxis(np.concatenate([curves, sloped], axis=1), 1, 2)


def least_squares(
    law: Law, time: FloatArray, traces: FloatArray, weights: FloatArray, start: FloatArray, steps: int = STEPS
) -> tuple[FloatArray, FloatArray]:
    """Fit a law to each of many traces by Levenberg and Marquardt's steps, all traces at once.

    Returns
    -------
    parameters, unexplained : array, shapes (n, k) and (n,)
    """
    p = start.copy()
    curve, sloped = law(p, time)
    cost, damping = (traces - curve) ** 2 @ weights, np.full(len(p), 1e-3)
    for _ in range(steps):
        pulled = np.swapaxes(sloped * weights[:, None], 1, 2)
        normal, pull = pulled @ sloped, pulled @ (traces - curve)[..., None]
        diagonal = np.einsum("nkk->nk", normal)
        floor = 1e-12 * diagonal.max(axis=1, keepdims=True) + 1e-300
        damped = normal + np.eye(p.shape[1]) * (damping[:, None] * diagonal + floor)[:, None, :]
        trial = np.clip(p + np.clip(np.linalg.solve(damped, pull)[..., 0], -3, 3), -14, 14)
        there, slopes_there = law(trial, time)
        cost_there = (traces - there) ** 2 @ weights
        better = cost_there < cost
        p[better], curve[better], sloped[better], cost[better] = (
            array[better] for array in (trial, there, slopes_there, cost_there)
        )
        damping = np.clip(np.where(better, damping / 5, damping * 5), 1e-9, 1e9)
    return p, cost / (traces**2 @ weights)


def _followed(
    law: Law, time: FloatArray, traces: FloatArray, weights: FloatArray, starts: FloatArray, count: int
) -> tuple[FloatArray, Left]:
    """Fit the first trace from several starts, and the others from what was found."""
    tried, left = least_squares(law, time, np.repeat(traces[:1], len(starts), axis=0), weights, starts)
    best = int(np.argmin(left))
    from_here = np.repeat(tried[best : best + 1], len(traces), axis=0)
    found, _ = least_squares(law, time, traces, weights, from_here, STEPS_ON)
    return found, _left(traces - law(found, time)[0], traces[0], weights, count, SHAPED)


def _shapes(
    time: FloatArray, traces: FloatArray, weights: FloatArray, rate: float, count: int
) -> tuple[dict[str, FloatArray], dict[str, Left]]:
    """Fit a stretched exponential and two exponentials: stacks of their constants, and what they leave."""
    scale = np.abs(traces[0]).max()
    used = np.r_[: 1 + SHAPED, 1 + bootstrap.RESAMPLES : len(traces)]
    scaled = traces[used] / scale
    b = np.log(rate)
    starts = np.array([[1.0, b, 0.0], [1, b + 0.5, -0.7], [1, b, 0.4]])
    one, left_one = _followed(stretched, time, scaled, weights, starts, count)
    starts = np.array([[0.5, 0.5, b - 0.7, b + 0.7], [0.8, 0.2, b - 0.2, b + 2], [1.2, -0.2, b + 0.2, b + 1.5]])
    two, left_two = _followed(double, time, scaled, weights, starts, count)
    two = np.where(two[:, 2:3] <= two[:, 3:], two, two[:, [1, 0, 3, 2]])
    samples = {
        "stretched_rate": np.exp(one[:, 1]),
        "stretched_exponent": np.exp(one[:, 2]),
        "fast_rate": np.exp(two[:, 3]),
        "slow_rate": np.exp(two[:, 2]),
        "fast_share": two[:, 1] / two[:, :2].sum(axis=1),
        "two_amplitude": two[:, :2].sum(axis=1) * scale,
    }
    return {name: _spread(values, used, len(traces)) for name, values in samples.items()}, {
        "stretched": left_one,
        "two": left_two,
    }


def _spread(values: FloatArray, used: NDArray[np.int64], size: int) -> FloatArray:
    """Return the rows used at their places in a stack, NaN elsewhere."""
    stack = np.full(size, np.nan)
    stack[used] = values
    return stack


def enough(left: Left) -> bool:
    """Return whether what a law leaves may be chance, or is too small to count."""
    small = left.unexplained < ENOUGH and left.rms <= WITHIN and left.largest <= 2 * WITHIN
    return bool(small or left.probability >= DOUBTFUL)


def relaxation_of(
    time: FloatArray, traces: FloatArray, error: FloatArray, count: int, expected: float, shaped: bool = False
) -> tuple[dict[str, FloatArray], dict[str, Left]]:
    """Fit the relaxation of a mean trace.

    Parameters
    ----------
    time : array, shape (m,)
        (t - t_0) / tau from zero on.
    traces : array, shape (1 + RESAMPLES + 2 groups, m)
        Stack of mu - mu_2 over the realisations.
    error : array, shape (m,)
        Standard error of the mean.
    count : int
        Realisations.
    expected : float
        Rate of the law, which fixes the window of the fit, 8 / expected.
    shaped : bool
        Whether to fit more than one exponential where one is not enough.

    Returns
    -------
    stacks : dict of array
        The entries of `RATE_FIELDS` and `AMPLITUDE_FIELDS`, and of `SHAPE_FIELDS` where one exponential is not enough.
        There the last rows of its rate are moved by what it leaves, and to the other rates.
    left : dict of Left
        Of ``one`` exponential, and of the laws ``stretched`` and ``two`` that were fitted.
    """
    inside = time <= window(time, expected)
    t, y = time[inside], traces[:, inside]
    weights = point_weights(t, y[0], error[inside])
    rate, amplitude, _ = exponential(t, y, weights)
    residuals = y - amplitude[:, None] * np.exp(-rate[:, None] * t)
    left = {"one": _left(residuals, y[0], weights, count)}
    integral = traces[:, 0] / (traces @ widths(time))
    missed = y if enough(left["one"]) else np.concatenate([y, bootstrap.moved(y[0], residuals[0])])
    rate, amplitude, _ = exponential(t, missed, weights)
    rate_alike, amplitude_alike, _ = exponential(t, missed, widths(t))
    stacks = {
        "rate": rate,
        "rate_unweighted": rate_alike,
        "amplitude": amplitude,
        "amplitude_unweighted": amplitude_alike,
        "integral_rate": integral,
    }
    if enough(left["one"]):
        return stacks, left
    for name in ("rate", "rate_unweighted", "integral_rate"):
        others = [stacks[other][0] for other in ("rate", "rate_unweighted", "integral_rate") if other != name]
        stacks[name] = np.append(stacks[name], others)
    if not shaped:
        return stacks, left
    shapes, those = _shapes(t, y, weights, float(rate[0]), count)
    return stacks | shapes, left | those


def window(time: FloatArray, expected: float) -> float:
    """Return the last time of a fit."""
    return float(time[time <= max(WINDOW / expected, time[min(8, time.size - 1)])][-1])
