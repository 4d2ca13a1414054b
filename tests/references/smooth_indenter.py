"""Steady sliding of a smooth indenter over a Kelvin foundation: closed forms, and roots by bisection."""

import numpy as np
from scipy.optimize import brentq

CLOSE = {"xtol": 1e-300, "rtol": 1e-14}


def smooth(loads, deborah, c, n):
    """Return drag, depth, contact length and rms slope in contact of a line c |x|^n, n >= 1, shape (4, cases).

    The loads are F_N / (4 G), the drag is F_x / (4 G), and `deborah` is v tau. At the depth d the contact lies between
    -a and b, with d = c a^n and d = c (b^n + n v tau b^(n-1)), or b = 0 if no b satisfies the second equation.
    """
    return np.array([_state(*case, c, n) for case in zip(loads, deborah, strict=True)]).T


def _state(load, de, c, n):
    def edges(depth):
        drop = depth / c
        if n == 1:
            return drop, max(drop - de, 0.0)
        low = min((drop / 2) ** (1 / n), (drop / (2 * n * de)) ** (1 / (n - 1)))
        return drop ** (1 / n), brentq(lambda b: drop - b**n - n * de * b ** (n - 1), low, drop ** (1 / n), **CLOSE)

    def missing(depth):
        a, b = edges(depth)
        return load - depth * (a + b) + c * (a ** (n + 1) + b ** (n + 1)) / (n + 1) - de * (depth - c * b**n)

    half = ((n + 1) * load / (2 * n * c)) ** (1 / (n + 1))  # half the contact length at rest
    depth = brentq(missing, load / (2 * half + de), 1.001 * c * half**n, **CLOSE)
    a, b = edges(depth)
    stretch = (c * n) ** 2 * (a ** (2 * n - 1) + b ** (2 * n - 1)) / (2 * n - 1)
    return 0.5 * (depth - c * b**n) ** 2 + de * stretch, depth, a + b, np.sqrt(stretch / (a + b))
