"""One exponential, and what to fit where one is not enough, to a trace that relaxes to zero."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

WINDOW = 8.0  # over the expected rate
ENOUGH = 0.02  # share of the squared trace that one exponential may leave
GRID = 241

Interval = Callable[[float, np.ndarray], tuple[float, float]]

RATE_FIELDS = {
    "rate": ("1", "rate b of one exponential in t' = (t - t_0) / tau, eq. 4.5"),
    "rate_low": ("1", "lower end of the 95 % interval of b"),
    "rate_high": ("1", "upper end of the 95 % interval of b"),
    "amplitude": ("1", "amplitude mu* of one exponential"),
    "integral_rate": ("1", "relaxing part at t_0+ over its integral in t': a rate without a model"),
    "integral_rate_low": ("1", "lower end of its 95 % interval"),
    "integral_rate_high": ("1", "upper end of its 95 % interval"),
    "window": ("1", "last t' of the fit"),
    "unexplained": ("1", "share of the squared relaxing part that one exponential leaves"),
    "misfit": ("1", "rms deviation of one exponential over the standard error of the trace"),
    "stretched_rate": ("1", "rate b of exp(-(b t')^beta), where one exponential is not enough"),
    "stretched_exponent": ("1", "its exponent beta"),
    "stretched_unexplained": ("1", "share that it leaves"),
    "fast_rate": ("1", "greater rate of two exponentials, where one is not enough"),
    "slow_rate": ("1", "smaller rate of two exponentials"),
    "fast_share": ("1", "share of the amplitude that relaxes at the greater rate"),
    "two_unexplained": ("1", "share that two exponentials leave"),
}


def widths(time: np.ndarray) -> np.ndarray:
    """Return the weights of the trapezoidal rule, so that every stretch of time counts alike."""
    step = np.diff(time)
    weights: np.ndarray = 0.5 * (np.append(step, 0.0) + np.append(0.0, step))
    return weights


def exponential(time: np.ndarray, trace: np.ndarray, weights: np.ndarray) -> tuple[float, float, float]:
    """Fit one exponential by weighted least squares, the rate on a grid and a parabola, the amplitude eliminated.

    Returns
    -------
    rate, amplitude, unexplained : float
        The last one is the weighted share of the squared trace that is left.
    """
    logs = np.linspace(np.log(0.02 / time[-1]), np.log(2 / time[time > 0][0]), GRID)
    for _ in range(2):
        shape = np.exp(-np.exp(logs)[:, None] * time)
        overlap = shape @ (weights * trace)
        gain = overlap**2 / (shape**2 @ weights)
        best = int(np.argmax(gain))
        inner = min(max(best, 1), logs.size - 2)
        step = logs[1] - logs[0]
        logs = np.linspace(logs[inner] - step, logs[inner] + step, 21)
    bend = gain[inner - 1] - 2 * gain[inner] + gain[inner + 1]
    shift = 0.5 * (gain[inner - 1] - gain[inner + 1]) / bend if bend < 0 else 0.0
    rate = float(np.exp(logs[10] + shift * step))
    curve = np.exp(-rate * time)
    amplitude = float((weights * trace) @ curve / (weights @ curve**2))
    left = float(weights @ (trace - amplitude * curve) ** 2 / (weights @ trace**2))
    return rate, amplitude, left


def _refined(time: np.ndarray, trace: np.ndarray, weights: np.ndarray, rate: float) -> dict[str, float]:
    """Fit a stretched exponential and two exponentials, from one exponential."""
    from scipy.optimize import least_squares

    root = np.sqrt(weights / (weights @ trace**2))

    def amplitudes(curves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        design = curves * root
        found: np.ndarray = np.linalg.lstsq(design.T, root * trace, rcond=None)[0]
        return found, root * trace - found @ design

    def stretched(p: np.ndarray) -> np.ndarray:
        return amplitudes(np.exp(-((np.exp(p[0]) * time) ** np.exp(p[1])))[None])[1]

    def curves_of(p: np.ndarray) -> np.ndarray:
        rates: np.ndarray = np.exp(p[0] + np.array([[0.0], [1.0]]) * np.exp(p[1]))
        curves: np.ndarray = np.exp(-rates * time)
        return curves

    def double(p: np.ndarray) -> np.ndarray:
        return amplitudes(curves_of(p))[1]

    one = least_squares(stretched, [np.log(rate), 0.0], bounds=([-12, -3], [14, 1.5]))
    two = least_squares(double, [np.log(rate) - 1, 0.5], bounds=([-12, -4], [14, 2.5]))
    slow, fast = np.exp(two.x[0]), np.exp(two.x[0] + np.exp(two.x[1]))
    parts = amplitudes(curves_of(two.x))[0]
    return {
        "stretched_rate": float(np.exp(one.x[0])),
        "stretched_exponent": float(np.exp(one.x[1])),
        "stretched_unexplained": float(2 * one.cost),
        "fast_rate": float(fast),
        "slow_rate": float(slow),
        "fast_share": float(parts[1] / parts.sum()) if parts.sum() != 0 else np.nan,
        "two_unexplained": float(2 * two.cost),
    }


def relaxation_of(
    time: np.ndarray, trace: np.ndarray, others: np.ndarray, error: np.ndarray, expected: float, interval: Interval
) -> dict[str, float]:
    """Fit the relaxation of a mean trace.

    Parameters
    ----------
    time : array, shape (m,)
        (t - t_0) / tau from zero on.
    trace : array, shape (m,)
        Mean of mu - mu_2.
    others : array, shape (groups, m)
        The same without one group of realisations each.
    error : array, shape (m,)
        Standard error of the trace.
    expected : float
        Rate of the law, which fixes the window of the fit, 8 / expected.
    interval : callable
        95 % interval from a value and the values without one group each.

    Returns
    -------
    dict
        The entries of `RATE_FIELDS`.
    """
    if not np.all(np.any(others[:, time <= time[min(8, time.size - 1)]] != 0, axis=1)):
        return dict.fromkeys(RATE_FIELDS, np.nan)
    inside = time <= max(WINDOW / expected, time[min(8, time.size - 1)])
    t, y, weights = time[inside], trace[inside], widths(time[inside])
    rate, amplitude, left = exponential(t, y, weights)
    low, high = interval(rate, np.array([exponential(t, other[inside], weights)[0] for other in others]))
    whole = widths(time)
    integral = trace[0] / (whole @ trace)
    integral_low, integral_high = interval(integral, np.array([other[0] / (whole @ other) for other in others]))
    off = y - amplitude * np.exp(-rate * t)
    sure = np.where(error[inside] > 0, error[inside], np.inf)  # at rest the trace has no scatter
    row = dict.fromkeys(RATE_FIELDS, np.nan) | {
        "rate": rate,
        "rate_low": low,
        "rate_high": high,
        "amplitude": amplitude,
        "integral_rate": float(integral),
        "integral_rate_low": integral_low,
        "integral_rate_high": integral_high,
        "window": float(t[-1]),
        "unexplained": left,
        "misfit": float(np.sqrt(weights @ (off / sure) ** 2 / weights.sum())),
    }
    return row | _refined(t, y, weights, rate) if left > ENOUGH else row
