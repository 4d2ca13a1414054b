"""Sobol indices: the share of the variance of an output that each input of a study explains.

The output is the mean over realisations. Every index is a quotient of bilinear forms of it, and a form of means over R
realisations holds their scatter too: what one realisation gives with itself is taken out, so that only products of two
different realisations count, which know nothing of their scatter.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError, distinguishable

#: Half width of an interval that is narrow enough to tell inputs apart.
NARROW = 0.1
#: Fewest points from which an index is computed.
FEWEST = 16


def sobol_indices(dataset: xr.Dataset, output: str) -> xr.Dataset:
    """Return the Sobol indices of an output for every varied input of a sampled study.

    From Saltelli's design: first-order indices after Saltelli et al. (2010), total ones after Jansen (1999). From any
    other sampled design first-order ones alone: the variance of a local linear regression on each input, every point
    left out of its own neighbourhood.

    Parameters
    ----------
    dataset : Dataset
        A group of a study with the dimension ``case``.
    output : str
        An output without other dimensions.

    Returns
    -------
    Dataset
        Over ``parameter``: ``first`` and ``total`` with the ends of their 95 % intervals, ``<index>_low`` and
        ``<index>_high``; NaN for what a design does not hold. ``attrs`` tell cases, failed cases, realisations, and
        ``advice``: whether there were enough points.

    Raises
    ------
    FitError
        If the study is a grid, holds too few points, or the output does not vary or has dimensions of its own.

    Notes
    -----
    Failed cases are left out: of Saltelli's design, for each input, the pairs that need them. The intervals are those
    of a bootstrap over points, and over realisations, whose spread is widened for few of them. The points of a Sobol
    sequence fill space more evenly than random ones, so that the intervals are rather too wide.

    References
    ----------
    Saltelli et al., Comput. Phys. Commun. 181, 259 (2010), doi:10.1016/j.cpc.2009.09.018.
    """
    inputs = _inputs(dataset)
    values, left_out = _values(dataset, output)
    variances = _exchanged(inputs, values) or _smoothed(inputs, values)
    found = np.array([_with_interval(one, values.shape[0]) for one in variances])
    if found.shape[2] == 1:
        found = np.concatenate([found, np.full_like(found, np.nan)], axis=2)
    result = xr.Dataset(coords={"parameter": np.array(list(inputs), dtype=object)})
    for (k, name), (row, suffix) in product(enumerate(("first", "total")), enumerate(("", "_low", "_high"))):
        result[f"{name}{suffix}"] = ("parameter", found[:, row, k], {"units": "1"})
    result.attrs |= {"output": output, "cases": dataset.sizes["case"], "left_out": left_out}
    result.attrs |= {"realisations": values.shape[0]}
    result.attrs["advice"] = _advice(result)
    return result


def _inputs(dataset: xr.Dataset) -> dict[str, FloatArray]:
    if "case" not in dataset.dims:
        raise FitError(
            "indices need a sampled study, this one is a grid: sampling: {saltelli: n}, {sobol: n}, "
            "{latin_hypercube: n} or a table of cases"
        )
    varied = {name: coord for name, coord in dataset.coords.items() if coord.dims == ("case",) and name != "case"}
    words = [str(name) for name, coord in varied.items() if coord.dtype.kind not in "fiu"]
    if words:
        raise FitError(f"{words[0]}: indices need numbers, this input has words; --select one of them")
    found = {str(name): coord.to_numpy().astype(np.float64) for name, coord in varied.items()}
    return {name: column for name, column in found.items() if np.ptp(column) > 0}


def _values(dataset: xr.Dataset, output: str) -> tuple[FloatArray, int]:
    """Return the output, shape (realisations, cases), and the number of cases without a value.

    A realisation that failed alone takes the mean of the others of its case.
    """
    array = dataset[output]
    others = [str(dim) for dim in array.dims if dim not in ("case", "realisation")]
    if others:
        raise FitError(f"{output} has the dimension {others[0]} of its own: choose one with --select")
    if "realisation" not in array.dims:
        array = array.expand_dims("realisation")
    values: FloatArray = array.transpose("realisation", "case").to_numpy().astype(np.float64)
    values = np.where(np.isfinite(values), values, np.nan)
    number = np.isfinite(values).sum(axis=0)
    mean = np.nansum(values, axis=0) / np.where(number, number, np.nan)
    values = np.where(np.isnan(values), mean, values)
    known = number > 0
    if known.sum() < FEWEST:
        raise FitError(f"{output}: expected at least {FEWEST} cases with a value, got {int(known.sum())}")
    if np.ptp(mean[known]) == 0:
        raise FitError(f"{output} is the same in every case: there is nothing to explain")
    return values, int((~known).sum())


class _Variances(NamedTuple):
    """What each point adds to the variances of an index.

    Attributes
    ----------
    parts : array, shape (indices, points)
        Their mean over points is the variance that an input explains.
    responses : array, shape (indices, points)
        How that goes with the weight of a point.
    squares, centres : array, shape (points,)
        The mean of the squares less the square of the mean is the whole variance.
    missed : float
        Part of the variance not explained that may be counted as explained, or the other way round.
    """

    parts: FloatArray
    responses: FloatArray
    squares: FloatArray
    centres: FloatArray
    missed: float = 0.0


#: From weights of the realisations to what each point adds.
_Weighted = Callable[[FloatArray], _Variances]


def _between(left: FloatArray, right: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the mean over pairs of different realisations of left times right, at each point."""
    total = weights.sum()
    both: FloatArray = (weights @ left) * (weights @ right)
    pairs = total**2 - (weights**2).sum()
    if pairs < 0.5:  # one realisation: its scatter cannot be told from the rest
        return np.asarray(both / total**2)
    apart: FloatArray = (both - weights**2 @ (left * right)) / pairs
    return apart


def _exchanged(inputs: dict[str, FloatArray], values: FloatArray) -> list[_Weighted]:
    """Return the variances of Saltelli's design for each input; none where the cases are another design."""
    columns, period = np.array(list(inputs.values())), len(inputs) + 2
    if columns.shape[1] % period:
        return []
    points = columns.reshape(len(inputs), -1, period)
    mixed = points[:, :, :1].repeat(len(inputs), axis=2)
    for index in range(len(inputs)):
        mixed[index, :, index] = points[index, :, 1]
    if not np.array_equal(mixed, points[:, :, 2:]):
        return []
    centred = (values - np.nanmean(values)).reshape(values.shape[0], -1, period)
    return [_of_exchange(centred[:, :, [0, 1, index + 2]]) for index in range(len(inputs))]


def _of_exchange(three: FloatArray) -> _Weighted:
    """Return the variances of one input from outputs at a, b, and a with that input of b."""
    a, b, mixed = np.moveaxis(three[:, np.isfinite(three).all(axis=(0, 2))], 2, 0)
    if a.shape[1] < FEWEST:
        raise FitError(f"expected at least {FEWEST} base points without a failed case, got {a.shape[1]}")

    def variances(weights: FloatArray) -> _Variances:
        first = _between(b, mixed - a, weights)
        total = _between(a - mixed, a - mixed, weights) / 2
        parts = np.array([first, total])
        squares = (_between(a, a, weights) + _between(b, b, weights)) / 2
        return _Variances(parts, parts, squares, weights @ (a + b) / (2 * weights.sum()))

    return variances


def _smoothed(inputs: dict[str, FloatArray], values: FloatArray) -> list[_Weighted]:
    """Return the variances of first order of any design, by regression on each input for itself."""
    known = np.isfinite(values[0])
    centred = values[:, known] - values[:, known].mean()
    return [_of_regression(centred, column[known]) for column in inputs.values()]


def _of_regression(values: FloatArray, column: FloatArray) -> _Weighted:
    """Return the variance of a local linear regression.

    Neighbours of random points know nothing of the point left out. Neighbours in a design that fills space evenly make
    up for it: there the mean with the point is right. The value is taken half way, and the interval holds both.
    """
    matrix = _regression(column)
    missed = 0.8 / (1 + matrix.nnz / column.size)
    smooth, back = (matrix @ values.T).T, (matrix.T @ values.T).T

    def variances(weights: FloatArray) -> _Variances:
        part = _between(values, smooth, weights)
        response = part + _between(values, back, weights) - matrix.T @ part
        squares = _between(values, values, weights)
        centres = weights @ values / weights.sum()
        return _Variances(part[np.newaxis], response[np.newaxis], squares, centres, missed)

    return variances


def _regression(column: FloatArray) -> csr_array:
    """Return the matrix of a local linear regression on the rank of an input, every point left out of its own."""
    size = column.size
    reach = min(max(4, int(np.sqrt(size) / 2)), (size - 1) // 2)
    order = np.argsort(column, kind="stable")
    start = np.clip(np.arange(size) - reach, 0, size - 2 * reach - 1)
    window = start[:, np.newaxis] + np.arange(2 * reach + 1)
    away = (window - np.arange(size)[:, np.newaxis]) / (2 * reach)
    near = (away != 0) / (2 * reach)
    tilt = (near * away).sum(axis=1, keepdims=True)
    spread = (near * away**2).sum(axis=1, keepdims=True) - tilt**2
    weight = near * (1 - (away - tilt) * tilt / spread)
    rows = np.repeat(order, 2 * reach + 1)
    return csr_array((weight.ravel(), (rows, order[window].ravel())), shape=(size, size))


def _with_interval(variances: _Weighted, realisations: int) -> FloatArray:
    """Return indices and the ends of their intervals, shape (3, indices)."""
    found = variances(np.ones(realisations))
    points = found.squares.size
    value = _of_means(found)
    draws = _draws(points)
    by_points = _quotient(
        found.parts.mean(axis=1) + (draws - 1) @ found.responses.T / points,
        draws @ found.squares / points,
        draws @ found.centres / points,
    )
    spread = (np.quantile(by_points, bootstrap.TAILS, axis=0) - value) ** 2
    if realisations > 1:
        by_lines = np.array([_of_means(variances(weights)) for weights in bootstrap.weights(realisations)[1:]])
        away = bootstrap.widening(realisations) * (np.nanquantile(by_lines, bootstrap.TAILS, axis=0) - value)
        spread = spread + away**2
    missed = found.missed * np.clip(1 - value, 0.0, 1.0)
    middle = value + missed
    return np.array([middle, value - np.sqrt(spread[0]), middle + missed + np.sqrt(spread[1])])


def _of_means(found: _Variances) -> FloatArray:
    return _quotient(found.parts.mean(axis=1), np.mean(found.squares), np.mean(found.centres))


def _draws(points: int) -> FloatArray:
    generator = np.random.Generator(np.random.Philox(0))
    drawn: FloatArray = generator.multinomial(points, np.full(points, 1 / points), bootstrap.RESAMPLES).astype(float)
    return drawn


def _quotient(parts: FloatArray, squares: ArrayLike, centres: ArrayLike) -> FloatArray:
    """Return indices from the means of parts, shape (..., indices), of squares and of centres, shape (...)."""
    whole: FloatArray = np.asarray(squares) - np.asarray(centres) ** 2
    indices: FloatArray = parts / whole[..., np.newaxis]
    return indices


def _advice(result: xr.Dataset) -> str:
    """Say whether the intervals are narrow enough, and what would make them so."""
    halves = [((result[f"{name}_high"] - result[f"{name}_low"]) / 2).max().item() for name in ("first", "total")]
    widest = np.nanmax(halves)
    cases = result.attrs["cases"]
    if widest <= NARROW:
        return f"enough points: every interval is narrower than +-{NARROW:g}"
    more = int(np.ceil(cases * ((widest / NARROW) ** 2 - 1)))
    told, narrow = distinguishable(widest, NARROW, digits=2)
    return (
        f"not enough points: the widest interval is +-{told}; about {float(f'{more:.2g}'):g} cases more would "
        f"make all of them +-{narrow}"
    )
