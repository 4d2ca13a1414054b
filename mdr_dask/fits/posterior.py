"""The posterior density of a few unknowns, and which unknowns or products of unknowns it determines.

The range of each unknown, on the scale of its axis, is mapped to the interval from 0 to 1. The unit cube is divided
into cells. Cells of high density are divided further, and the other cells are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.bootstrap import CONFIDENCE
from mdr_dask.fits.base import APPROXIMATE
from mdr_dask.fits.prediction import Predicted, Prediction
from mdr_dask.physics.refine import CLOSE

#: Approximate number of cells before refinement, and smallest number of cells that a refinement divides. Chosen by
#: trial: with fewer cells, a refinement may miss a narrow maximum.
CELLS = 512
#: Largest number of cells after a refinement; limits the time.
MOST = 160_000
#: A refinement leaves out cells in which ln(density) is below its maximum by more than this value, but it keeps at
#: least `CELLS` cells. In the cells left out, the density is less than 1e-6 times the largest density.
REACH = 14.0
#: Refinement ends when ln(density) varies within a divided cell by less than this value on average. The weights of the
#: average are the probabilities of the cells. Refinement also ends when the cells are at most `CLOSE` wide. Chosen by
#: trial.
SMOOTH = 0.6
#: An end of the axis of an unknown is *open* if ln(largest posterior density / density at the end) is less than `OPEN`:
#: the 95 % interval of the likelihood-ratio test reaches this end.
OPEN = float(chdtri(1, 1 - CONFIDENCE)) / 2
#: The data determine a product if the spread of its logarithm is less than this fraction of the spread in the prior.
#: Chosen by trial.
NARROW = 0.25
#: Probability of each interval. A key is the text that follows ``_low`` and ``_high`` in the names of the ends, such as
#: ``_68`` in ``x_low_68``.
LEVELS = {"": CONFIDENCE, "_68": 0.6827}
#: `ENDS`: suffixes of the median and of the ends of the intervals. `SHARES`: cumulative probabilities of the median and
#: of the ends.
ENDS = ("", *(f"_{end}{kind}" for kind in LEVELS for end in ("low", "high")))
SHARES = (0.5, *(0.5 + sign * level / 2 for level in LEVELS.values() for sign in (-1, 1)))


class Noise(NamedTuple):
    """Possible standard deviations of the measurement errors.

    The standard deviations are `pattern`, with one value for each point, times one of the `sizes`. If `pattern` is
    None, the absolute predicted values replace `pattern`.
    """

    sizes: FloatArray
    pattern: FloatArray | None

    def variances(self, mean: FloatArray) -> FloatArray:
        """Return the variances, shape (sizes, sets, points), for predicted values of shape (sets, points)."""
        pattern = np.abs(mean) if self.pattern is None else np.broadcast_to(self.pattern, mean.shape)
        square: FloatArray = self.sizes[:, None, None] ** 2 * pattern**2
        return square


def likelihood(prediction: Prediction, values: FloatArray, noises: list[Noise]) -> Callable[[FloatArray], FloatArray]:
    """Return a function that takes points in the unit cube and returns logarithms of the likelihood of measured values.

    The points have the shape (sets, unknowns). The logarithms have the shape (sets, total number of sizes in `noises`).
    The logarithms include the prior probabilities: all items of `noises` have the same prior probability, and so have
    all sizes of one item.
    """

    def of(places: FloatArray) -> FloatArray:
        predicted = prediction(places)
        found = []
        for noise in noises:
            prior = -np.log(len(noises) * noise.sizes.size)
            for variance in noise.variances(predicted.mean):
                square, determinant = distance(values, predicted, variance)
                found.append(prior - 0.5 * (square + determinant))
        return np.stack(found, axis=1)

    step = max(1, 2**18 // values.size)  # limits the memory for the likelihood
    return lambda places: np.concatenate([of(places[k : k + step]) for k in range(0, len(places), step)])


def distance(values: FloatArray, predicted: Predicted, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return chi squared and ln(determinant of the covariance) of the measured values, both of shape (sets,).

    `noise` contains the variances of the measurement errors. The covariance is a diagonal matrix plus a few terms for
    errors common to all points. Woodbury's identity avoids the inversion of a large matrix.
    """
    variance = np.maximum(predicted.alone + noise, np.finfo(float).tiny)
    residual = values - predicted.mean
    shared = predicted.together / np.sqrt(variance)[..., None]
    scaled = residual / np.sqrt(variance)
    moved = np.swapaxes(shared, -1, -2)
    inner = moved @ shared + np.eye(shared.shape[-1])
    along = moved @ scaled[..., None]
    square = (scaled**2).sum(axis=-1) - (along * np.linalg.solve(inner, along)).sum(axis=(-1, -2))
    return square, np.log(variance).sum(axis=-1) + np.linalg.slogdet(inner)[1]


class Posterior(NamedTuple):
    """A posterior density on cells of the unit cube.

    `places` are the centres of the cells, and `weights` are the probabilities of the cells. `density` is the logarithm
    of the density up to a constant. `noise` is the probability of each size of the measurement error in each cell.
    `width` is the length of the edges of a cell.
    """

    places: FloatArray
    weights: FloatArray
    density: FloatArray
    noise: FloatArray
    width: float

    @property
    def best(self) -> int:
        """Index of the cell with the highest density."""
        return int(np.argmax(self.density))


def posterior(likelihood: Callable[[FloatArray], FloatArray], unknowns: int) -> Posterior:
    """Return the posterior density on cells of the unit cube, for a uniform prior of the unknowns.

    The argument `likelihood` takes points, shape (cells, unknowns), and returns logarithms of the likelihood, shape
    (cells, number of sizes of the measurement error).
    """
    number = round(CELLS ** (1 / unknowns))
    width = 1.0 / number
    axis = (np.arange(number) + 0.5) * width
    places = np.stack([each.ravel() for each in np.meshgrid(*[axis] * unknowns, indexing="ij")], axis=1)
    halves = np.stack(np.meshgrid(*[[-0.25, 0.25]] * unknowns, indexing="ij"), axis=-1).reshape(-1, unknowns)
    each = likelihood(places)
    while width > CLOSE:
        kept = _kept(np.logaddexp.reduce(each, axis=1), MOST // len(halves))
        places = (places[kept, None] + width * halves).reshape(-1, unknowns)
        width /= 2
        each = likelihood(places)
        density = np.logaddexp.reduce(each, axis=1)
        if _is_smooth(density.reshape(-1, len(halves))):
            break
    weights = np.exp(density - density.max())
    noise = np.exp(each - density[:, None])
    return Posterior(places, weights / weights.sum(), density, noise, width)


def _kept(density: FloatArray, most: int) -> NDArray[np.intp]:
    """Return the indices of the cells that are divided next: all cells of high density, but at least `CELLS` cells.

    If there are more than `most` such cells, `most` of them are selected at random.
    """
    order = np.argsort(density)[::-1]
    number = max(int((density > density.max() - REACH).sum()), min(CELLS, density.size))
    if number <= most:
        return order[:number]
    generator = np.random.Generator(np.random.Philox(0))
    return order[generator.permutation(number)[:most]]


def _is_smooth(pieces: FloatArray) -> bool:
    share = np.exp(pieces - pieces.max()).sum(axis=1)
    return bool(np.sum(share * np.ptp(pieces, axis=1)) < SMOOTH * share.sum())


def at_ends(found: Posterior) -> FloatArray:
    """Return ln(density / largest density) at both ends of the axis of each unknown, shape (unknowns, 2).

    The logarithm is minus infinity if no cell lies at the end.
    """
    borders = np.stack([found.places < found.width, found.places > 1 - found.width], axis=-1)
    density = np.where(borders, found.density[:, None, None], -np.inf)
    return np.asarray(density.max(axis=0) - found.density.max())


def undetermined(found: Posterior, is_open: BoolArray) -> list[int]:
    """Return the indices of the unknowns that have an open end, or that depend on unknowns with an open end.

    An unknown depends on others if a quadratic function of the others, fitted to the unknown, explains more than the
    fraction `APPROXIMATE` of its spread.
    """
    free = np.flatnonzero(is_open.any(axis=1)).tolist()
    if not free:
        return []
    centred = found.places - found.weights @ found.places
    others = [k for k in range(len(is_open)) if k not in free]
    return sorted([*free, *(k for k in others if _reduction(centred, found.weights, k, free) > APPROXIMATE)])


def _reduction(centred: FloatArray, weights: FloatArray, k: int, by: list[int]) -> float:
    """Return the fraction of the spread of unknown `k` that a quadratic function of the unknowns `by` explains."""
    columns = centred[:, by]
    terms = np.concatenate([np.ones((len(centred), 1)), columns, columns**2], axis=1)
    root = np.sqrt(weights)
    left = root * centred[:, k]
    fitted = root[:, None] * terms
    rest = left - fitted @ np.linalg.lstsq(fitted, left)[0]
    return 1 - float(np.sqrt(rest @ rest / max(left @ left, np.finfo(float).tiny)))


class Product(NamedTuple):
    """A product of powers of unknowns, determined by the data, such as ``relaxation_time x rms_roughness^2``.

    `values` contains the value of the product in each cell of the posterior.
    """

    exponents: FloatArray
    values: FloatArray


def products(found: Posterior, values: FloatArray, free: Sequence[int]) -> list[Product]:
    """Return the products that the data determine. Their factors are powers of the undetermined unknowns `free`.

    `values` are the unknowns in SI units at the centre of each cell, shape (cells, unknowns). The list is empty if
    there are fewer than two undetermined unknowns, or if the value of such an unknown is not positive in every cell.
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
    """Return rows that span the same space; each has a 1 in a column in which all other rows are 0."""
    rows = rows.copy()
    done: list[int] = []
    for i in range(len(rows)):
        size = np.abs(rows[i]) * (~np.isin(np.arange(rows.shape[1]), done))
        lead = int(np.flatnonzero(np.round(3 * size / size.max()))[0])  # a much smaller term may be rounded to 0 later
        rows[i] /= rows[i, lead]
        for j in range(len(rows)):
            if j != i:
                rows[j] -= rows[j, lead] * rows[i]
        done.append(lead)
    return rows


def _product(found: Posterior, logarithms: FloatArray, free: Sequence[int], row: FloatArray, unknowns: int) -> Product:
    """Return the product of powers; exponents are rounded to integers, halves or thirds, or to two decimals.

    Integers are tried first. A rounding is accepted if the spread of the product then increases by at most the fraction
    `APPROXIMATE`.
    """
    best = _spread(logarithms @ row, found.weights)
    for denominator in (1, 2, 3):
        plain = np.round(row * denominator) / denominator
        if np.any(plain) and _spread(logarithms @ plain, found.weights) <= (1 + APPROXIMATE) * best:
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


def intervals(values: FloatArray, weights: FloatArray) -> dict[str, float]:
    """Return the median and the ends of the intervals of weighted values, indexed by suffix (see `ENDS`)."""
    return dict(zip(ENDS, quantiles(values, weights, SHARES).tolist(), strict=True))
