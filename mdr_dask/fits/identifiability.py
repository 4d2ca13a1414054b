"""Find which unknowns of a calibration the data determine, and which products of powers of the remaining unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.fits.posterior import Posterior

#: An end of the axis of an unknown is *open* if ln(largest posterior density / density at the end) is less than `OPEN`.
#: For a normal density, an open end lies within two standard errors of the maximum.
OPEN = 2.0
#: The axis cuts off the 95 % interval of an unknown if the density at an end of the axis exceeds 5 % of the maximum.
CUT = float(np.log(20))
#: An unknown without an open end is undetermined if unknowns with an open end explain more than this share of its
#: variance.
LINKED = 0.25
#: The data determine a product if the spread of its logarithm is less than this fraction of the spread in the prior.
NARROW = 0.25
#: Exponents of a product are rounded to integers, halves or thirds if rounding increases the spread of the product by
#: at most this factor.
ROUNDED = 1.15
#: Probability of each interval. Each key is the last part of the names of the ends: nothing in ``x_low`` and
#: ``x_high``, ``_68`` in ``x_low_68`` and ``x_high_68``.
LEVELS = {"": 0.95, "_68": 0.6827}
#: `ENDS`: suffixes of the median and of the ends of the intervals. `SHARES`: cumulative probabilities of the median and
#: of the ends.
ENDS = ("", *(f"_{end}{kind}" for kind in LEVELS for end in ("low", "high")))
SHARES = (0.5, *(0.5 + sign * level / 2 for level in LEVELS.values() for sign in (-1, 1)))


def at_ends(found: Posterior) -> FloatArray:
    """Return ln(density / largest density) at both ends of the axis of each unknown, shape (unknowns, 2)."""
    borders = np.stack([found.places < found.width, found.places > 1 - found.width], axis=-1)
    density = np.where(borders, found.density[:, None, None], -np.inf)
    return np.asarray(density.max(axis=0) - found.density.max())


def undetermined(found: Posterior, is_open: BoolArray) -> list[int]:
    """Return the indices of the unknowns with an open end, and of the unknowns that depend on these (see `LINKED`)."""
    free = np.flatnonzero(is_open.any(axis=1)).tolist()
    if not free:
        return []
    centred = found.places - found.weights @ found.places
    others = [k for k in range(len(is_open)) if k not in free]
    return sorted([*free, *(k for k in others if _explained(centred, found.weights, k, free) > LINKED)])


def _explained(centred: FloatArray, weights: FloatArray, k: int, by: list[int]) -> float:
    """Return which fraction of the variance of unknown `k` a quadratic function of the unknowns `by` explains."""
    columns = centred[:, by]
    terms = np.concatenate([np.ones((len(centred), 1)), columns, columns**2], axis=1)
    root = np.sqrt(weights)
    left = root * centred[:, k]
    fitted = root[:, None] * terms
    rest = left - fitted @ np.linalg.lstsq(fitted, left)[0]
    return float(1 - rest @ rest / max(left @ left, np.finfo(float).tiny))


class Product(NamedTuple):
    """A product of powers of unknowns, determined by the data, such as ``relaxation_time x rms_roughness^2``.

    `values` contains the value of the product in each cell of the posterior.
    """

    exponents: FloatArray
    values: FloatArray


def products(found: Posterior, values: FloatArray, free: Sequence[int]) -> list[Product]:
    """Return products of powers of the undetermined unknowns `free` that the data determine.

    `values` are the unknowns in SI units at the centre of each cell, shape (cells, unknowns).
    """
    if len(free) < 2 or np.any(values[:, free] <= 0):
        return []
    logarithms = np.log(values[:, free])
    spans = np.ptp(logarithms, axis=0)
    spans = np.where(spans > 0, spans, 1.0)
    covariance = np.cov((logarithms / spans).T, aweights=found.weights, bias=True)
    variances, directions = np.linalg.eigh(covariance)
    narrow = directions[:, np.sqrt(12 * variances) < NARROW].T / spans
    if not len(narrow):
        return []
    return [_product(found, logarithms, free, row, values.shape[1]) for row in _reduced(narrow)]


def _reduced(rows: FloatArray) -> FloatArray:
    """Return rows that span the same space as `rows`, each with a leading 1 and as few other terms as possible."""
    rows = rows.copy()
    done: list[int] = []
    for i in range(len(rows)):
        size = np.abs(rows[i]) * (~np.isin(np.arange(rows.shape[1]), done))
        lead = int(np.flatnonzero(size > 0.3 * size.max())[0])
        rows[i] /= rows[i, lead]
        for j in range(len(rows)):
            if j != i:
                rows[j] -= rows[j, lead] * rows[i]
        done.append(lead)
    return rows


def _product(found: Posterior, logarithms: FloatArray, free: Sequence[int], row: FloatArray, unknowns: int) -> Product:
    """Return the product of powers; exponents are rounded to simple fractions (see `ROUNDED`) or to two decimals."""
    best = _spread(logarithms @ row, found.weights)
    for denominator in (1, 2, 3):
        plain = np.round(row * denominator) / denominator
        if np.any(plain) and _spread(logarithms @ plain, found.weights) <= ROUNDED * best:
            row = plain
            break
    else:
        row = np.round(row, 2)
    exponents = np.zeros(unknowns)
    exponents[list(free)] = row
    return Product(exponents, np.exp(logarithms @ exponents[list(free)]))


def _spread(values: FloatArray, weights: FloatArray) -> float:
    mean = weights @ values
    return float(np.sqrt(weights @ (values - mean) ** 2))


def written(names: Sequence[str], exponents: FloatArray) -> str:
    """Return a product as text: ``relaxation_time x rms_roughness^2``."""
    parts = [name + _power(power) for name, power in zip(names, exponents, strict=True) if power]
    return " x ".join(parts)


def _power(power: float) -> str:
    if power == 1:
        return ""
    simple = Fraction(power).limit_denominator(3)
    if float(simple) != power or simple.denominator == 1:
        return f"^{power:g}"
    return f"^({simple})"


def unit_of(units: Sequence[str], exponents: FloatArray) -> str:
    """Return the unit of a product, such as ``s m^2``; ``1`` for pure numbers."""
    parts = [
        f"({unit}){_power(power)}" if " " in unit or "/" in unit else unit + _power(power)
        for unit, power in zip(units, exponents, strict=True)
        if power and unit != "1"
    ]
    return " ".join(parts) or "1"


def quantiles(values: FloatArray, weights: FloatArray, shares: Sequence[float]) -> FloatArray:
    """Return the quantiles of weighted values at the cumulative probabilities `shares`, interpolated linearly."""
    places, which = np.unique(values, return_inverse=True)
    mass: FloatArray = np.bincount(which.ravel(), weights).astype(np.float64)
    below = np.cumsum(mass) - mass / 2
    return np.interp(shares, below, places)
