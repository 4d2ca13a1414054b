"""One exponential fitted to the mean of traces that relax to zero."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.fits.base import DOUBTFUL, law_holds

WINDOW = 8.0  # length of the fitted part of a trace, in units of 1 / (rate by eq. 4.12)
FLOOR = 0.01  # assumed grid error at every moment, as a fraction of the largest value of the trace (docs/kinetics.md)
GRID = 400  # rates that are tried, evenly spaced on a logarithmic scale

RATE_FIELDS = {
    "rate": ("1", "rate b of one exponential in t' = (t - t_0) / tau, eq. 4.5; weights 1 / variance of the mean"),
    "integral_rate": ("1", "relaxing part at t_0+ over its integral in t': a rate without a model"),
}


class Relaxation(NamedTuple):
    """One exponential fitted to a mean trace.

    Attributes
    ----------
    rate, amplitude, integral_rate : array, shape (rows,)
        Stacks. If scatter and errors do not explain the departures of the trace from one exponential, `rate` has
        additional rows at its end: rates fitted to the trace shifted by these departures, and the integral rate.
    holds : str
        Whether one exponential fits; departures are relative to the largest relaxing part.
    """

    rate: FloatArray
    amplitude: FloatArray
    integral_rate: FloatArray
    holds: str


def widths(time: FloatArray) -> FloatArray:
    """Return the weights of the trapezoidal rule."""
    step = np.diff(time)
    weights: FloatArray = 0.5 * (np.append(step, 0.0) + np.append(0.0, step))
    return weights


def point_weights(time: FloatArray, trace: FloatArray, error: FloatArray) -> FloatArray:
    """Return the weight of each moment of a mean trace: its duration over its variance.

    On a logarithmic grid the early moments are dense, and neighbours carry the same information. The weight by duration
    corrects for this.
    """
    variance = error**2 + (FLOOR * np.abs(trace).max()) ** 2
    weights: FloatArray = widths(time) / variance
    weights /= weights.sum()
    return weights


def tried_rates(time: FloatArray) -> FloatArray:
    """Return the rates that are tried for a trace; slower and faster rates cannot be resolved at these moments."""
    rates: FloatArray = np.geomspace(0.02 / time[-1], 2 / time[time > 0][0], GRID)
    return rates


def exponential(time: FloatArray, traces: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fit one exponential to each of many traces by weighted least squares.

    For each of `GRID` rates, the best amplitude follows in closed form. A parabola through the best rate and its
    neighbours then gives the rate to about 1e-4.

    Parameters
    ----------
    time : array, shape (m,)
        Moments, beginning with 0.
    traces : array, shape (n, m)
        Traces that relax to zero.
    weights : array, shape (m,)
        Weights of the squared residuals.

    Returns
    -------
    rate, amplitude : array, shape (n,)
    """
    logs = np.log(tried_rates(time))
    shapes = np.exp(-np.exp(logs)[:, None] * time)
    gain = ((weights * traces) @ shapes.T) ** 2 / (shapes**2 @ weights)
    best = 1 + np.argmax(gain[:, 1:-1], axis=1)
    left, middle, right = (gain[np.arange(len(gain)), best + k] for k in (-1, 0, 1))
    bend = left - 2 * middle + right
    shift = 0.5 * (left - right) / np.where(bend < 0, bend, -np.inf)
    rate = np.exp(logs[best] + (logs[1] - logs[0]) * np.clip(shift, -1, 1))
    curves = np.exp(-rate[:, None] * time)
    return rate, np.sum(weights * traces * curves, axis=1) / (curves**2 @ weights)


def relaxation_of(time: FloatArray, traces: FloatArray, error: FloatArray, count: int, expected: float) -> Relaxation:
    """Fit one exponential to the relaxation of a mean trace.

    Parameters
    ----------
    time : array, shape (m,)
        (t - t_0) / tau, beginning with 0.
    traces : array, shape (1 + RESAMPLES + 2 groups, m)
        Stack of mu - mu_2 over the realisations.
    error : array, shape (m,)
        Standard error of the mean.
    count : int
        Realisations.
    expected : float
        Rate by the law. It determines the fitted part of the trace, t' <= 8 / expected.
    """
    inside = time <= window(time, expected)
    t, y = time[inside], traces[:, inside]
    weights = point_weights(t, y[0], error[inside])
    rate, amplitude = exponential(t, y, weights)
    residuals = y - amplitude[:, None] * np.exp(-rate[:, None] * t)
    chance = min(bootstrap.chance(residuals * weight, count) for weight in (np.sqrt(weights), 1.0))
    integral = traces[:, 0] / (traces @ widths(time))
    slowest, fastest = tried_rates(t)[[1, -2]]
    outside = (rate < 1.001 * slowest) | (rate > 0.999 * fastest)
    if not chance >= DOUBTFUL:
        rates, amplitudes = exponential(t, bootstrap.moved(y[0], residuals[0]), weights)
        rate, amplitude = np.concatenate([rate, rates, integral[:1], rate[:1]]), np.concatenate([amplitude, amplitudes])
    if outside[0] or outside.mean() > bootstrap.TAILS[0]:  # a rate at an end of the tried range is no estimate
        rate = np.full_like(rate, np.nan)
    relative = residuals / np.abs(y[0]).max()
    holds = law_holds(relative[0], chance, 2, scatter=bootstrap.scatter(relative, count))
    return Relaxation(rate, amplitude, integral, holds)


def window(time: FloatArray, expected: float) -> float:
    """Return the last moment of the fit, which includes at least eight moments after the first."""
    return float(time[time <= max(WINDOW / expected, time[min(8, time.size - 1)])][-1])
