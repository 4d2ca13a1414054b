"""The posterior density of a few unknowns, on cells that are divided further where the density is high.

The range of each unknown, on the scale of its axis, is mapped to the interval from 0 to 1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.fits.prediction import Predicted, Prediction

#: Number of cells along each unknown before refinement. The keys are the numbers of unknowns.
START = {1: 64, 2: 24, 3: 12, 4: 8}
#: `BEST`: a refinement divides at least this number of cells; the keys are the numbers of unknowns. `MOST`: largest
#: number of cells after a refinement.
BEST, MOST = {1: 32, 2: 256, 3: 768, 4: 1536}, 160_000
#: Cells are left out if ln(density) is below its maximum by more than this value. The total probability of these cells
#: is below 1e-5.
REACH = 14.0
#: Refinement ends when ln(density) varies within the divided cells by less than this value, on average over all cells
#: weighted with their density.
SMOOTH = 0.6
#: Largest number of refinements.
LEVELS = 16
#: Number of possible sizes of an unknown measurement error.
DEVIATIONS = 14


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
    All items of `noises` have the same prior probability. All sizes of one item have the same prior probability.
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
    """Return the posterior density on cells of the unit cube, from the result of `likelihood` and a uniform prior."""
    width = 1.0 / START[unknowns]
    axis = (np.arange(START[unknowns]) + 0.5) * width
    places = np.stack([each.ravel() for each in np.meshgrid(*[axis] * unknowns, indexing="ij")], axis=1)
    halves = np.stack(np.meshgrid(*[[-0.25, 0.25]] * unknowns, indexing="ij"), axis=-1).reshape(-1, unknowns)
    each = likelihood(places)
    for _ in range(LEVELS):
        kept = _kept(np.logaddexp.reduce(each, axis=1), BEST[unknowns], MOST // len(halves))
        places = (places[kept, None] + width * halves).reshape(-1, unknowns)
        width /= 2
        each = likelihood(places)
        density = np.logaddexp.reduce(each, axis=1)
        if _is_smooth(density.reshape(-1, len(halves))):
            break
    weights = np.exp(density - density.max())
    noise = np.exp(each - density[:, None])
    return Posterior(places, weights / weights.sum(), density, noise, width)


def _kept(density: FloatArray, fewest: int, most: int) -> NDArray[np.intp]:
    """Return the indices of the cells that are divided next: all cells of high density, but at least `fewest` cells.

    If these are more than `most` cells, `most` of these cells are selected at random.
    """
    order = np.argsort(density)[::-1]
    number = max(int((density > density.max() - REACH).sum()), min(fewest, density.size))
    if number <= most:
        return order[:number]
    generator = np.random.Generator(np.random.Philox(0))
    return order[generator.permutation(number)[:most]]


def _is_smooth(pieces: FloatArray) -> bool:
    share = np.exp(pieces - pieces.max()).sum(axis=1)
    return bool(np.sum(share * np.ptp(pieces, axis=1)) < SMOOTH * share.sum())
