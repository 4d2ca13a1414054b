"""What this processor does at most: measured throughputs and latencies of operations, and of its memory."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numba import njit

from benchmarks.measures import timed

REPEATS, CALLS = 20_000, 7
WIDE = 1024  # numbers that lie in the first cache
LONG = 30_000_000  # numbers that lie in no cache


@njit(error_model="numpy")
def _additions(n, x):
    a, b, c, d, e, f, g, h = x, x, x, x, x, x, x, x
    for _ in range(n):
        a, b, c, d, e, f, g, h = a + x, b + x, c + x, d + x, e + x, f + x, g + x, h + x
    return a + b + c + d + e + f + g + h


@njit(error_model="numpy")
def _products(n, x):
    a, b, c, d, e, f, g, h = x, x, x, x, x, x, x, x
    for _ in range(n):
        a, b, c, d, e, f, g, h = a * x, b * x, c * x, d * x, e * x, f * x, g * x, h * x
    return a + b + c + d + e + f + g + h


@njit(error_model="numpy")
def _quotients(n, x):
    a, b, c, d = x, x + 1, x + 2, x + 3
    for _ in range(2 * n):
        a, b, c, d = x / a, x / b, x / c, x / d
    return a + b + c + d


@njit(error_model="numpy")
def _roots(n, x):
    a, b, c, d = x, x + 1, x + 2, x + 3
    for _ in range(2 * n):
        a, b, c, d = math.sqrt(a), math.sqrt(b), math.sqrt(c), math.sqrt(d)
    return a + b + c + d


@njit(error_model="numpy")
def _exponentials(n, x):
    a, b, c, d = x, x, x, x
    for _ in range(2 * n):
        a, b, c, d = math.exp(-a), math.exp(-b), math.exp(-c), math.exp(-d)
    return a + b + c + d


@njit(error_model="numpy")
def _powers(n, x):
    a, b, c, d = x, x, x, x
    for _ in range(2 * n):
        a, b, c, d = a**0.7, b**0.7, c**0.7, d**0.7
    return a + b + c + d


@njit(error_model="numpy")
def _added_in_a_row(n, x):
    a = x
    for _ in range(8 * n):
        a = a + x
    return a


@njit(error_model="numpy")
def _multiplied_in_a_row(n, x):
    a = x
    for _ in range(8 * n):
        a = a * x
    return a


@njit(error_model="numpy")
def _polynomials(n, x, y):
    for _ in range(n // 128):
        for i in range(x.size):
            z = x[i]
            y[i] = ((((z * 0.5 + 1.0) * z + 0.3) * z + 0.7) * z + 0.9) + y[i] * 0.5


@njit(error_model="numpy")
def _vector_quotients(n, x, y):
    for _ in range(n // 128):
        for i in range(x.size):
            y[i] = 0.5 / x[i]


@njit(error_model="numpy")
def _vector_roots(n, x, y):
    for _ in range(n // 128):
        for i in range(x.size):
            y[i] = math.sqrt(x[i])


@njit(fastmath=True)
def _summed(n, x):
    total = 0.0
    for _ in range(n // 128):
        for i in range(x.size):
            total += x[i]
    return total


def _seconds(function: Callable[..., object], *arguments: object) -> float:
    function(*arguments)
    return timed(function, *arguments, calls=CALLS)[1]


def roofs() -> dict[str, float]:
    """Return seconds for one operation of each kind, ``vector ...`` of a loop over arrays, for one byte."""
    many = 8 * REPEATS
    scalar = {
        "add": _additions,
        "multiply": _products,
        "divide": _quotients,
        "root": _roots,
        "function": _exponentials,
        "power": _powers,
        "add, one after the other": _added_in_a_row,
        "multiply, one after the other": _multiplied_in_a_row,
    }
    found = {name: _seconds(function, REPEATS, 1.0 + 1e-9) / many for name, function in scalar.items()}
    x, y = np.linspace(1, 2, WIDE), np.ones(WIDE)
    loops = REPEATS // 128 * WIDE
    found["vector add"] = found["vector multiply"] = _seconds(_polynomials, REPEATS, x, y) / (10 * loops)
    found["vector divide"] = _seconds(_vector_quotients, REPEATS, x, y) / loops
    found["vector root"] = _seconds(_vector_roots, REPEATS, x, y) / loops
    found["byte in cache"] = _seconds(_summed, REPEATS, x) / (8 * loops)
    long = np.ones(LONG)
    found["byte of memory"] = _seconds(np.sum, long) / (8 * LONG)
    return found
