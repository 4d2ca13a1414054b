"""Sobol indices: the share of the variance of an output that each input of a study explains.

The output is the mean over realisations. The variance of this mean is computed from products of outputs of two
realisations, because products of outputs of the same realisation contain the variance of the scatter. If the study has
only one realisation, the variance includes this scatter.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import xarray as xr
from scipy.stats import t

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import short

#: A study has enough points if the half width of the interval of each index is at most this value.
NARROW = 0.1


def sobol_indices(dataset: xr.Dataset, output: str) -> xr.Dataset:
    """Return the Sobol indices of an output for every varied input of Saltelli's design, with 95 % intervals.

    First-order indices follow Saltelli et al., Comput. Phys. Commun. 181, 259 (2010), and total indices Jansen (1999).
    A base point (see `_is_saltelli`) with a case without a value is left out of the indices that need this case. Raise
    FitError if the study is no complete design of numerical inputs, if it has too few base points with values, or if
    the output has further dimensions or is the same in every case.

    The intervals follow from a jackknife over groups of points and over realisations. The intervals tend to be too
    wide, because points of a Sobol sequence fill space more evenly than random points.
    """
    inputs = _inputs(dataset)
    values, left_out = _values(dataset, output)
    values = values - np.nanmean(values)
    blocks = values.reshape(len(values), -1, len(inputs) + 2)
    found = [_with_interval(blocks[:, :, [0, 1, k + 2]], _exchanged) for k in range(len(inputs))]
    result = xr.Dataset(coords={"parameter": np.array(list(inputs), dtype=object)})
    for (k, name), (row, suffix) in product(enumerate(("first", "total")), enumerate(("", "_low", "_high"))):
        result[f"{name}{suffix}"] = ("parameter", [one[row, k] for one in found], {"units": "1"})
    result.attrs |= {"output": output, "cases": dataset.sizes["case"], "left_out": left_out}
    result.attrs |= {"realisations": len(values)}
    result.attrs["advice"] = _advice(result)
    return result


def _inputs(dataset: xr.Dataset) -> dict[str, FloatArray]:
    if "case" not in dataset.dims:
        raise FitError("expected a study with sampling: {saltelli: n}, got a grid")
    varied = {name: coord for name, coord in dataset.coords.items() if coord.dims == ("case",) and name != "case"}
    words = [str(name) for name, coord in varied.items() if coord.dtype.kind not in "fiu"]
    if words:
        raise FitError(f"expected numbers for the input {words[0]}, got words: choose one of them with --select")
    found = {str(name): coord.to_numpy().astype(np.float64) for name, coord in varied.items()}
    varying = {name: column for name, column in found.items() if np.ptp(column) > 0}
    if not varying or not _is_saltelli(np.array(list(varying.values()))):
        raise FitError("expected a study with sampling: {saltelli: n}, got another sampling, or a part of a study")
    return varying


def _values(dataset: xr.Dataset, output: str) -> tuple[FloatArray, int]:
    """Return the output, shape (realisations, cases), and the number of cases without a value.

    Failed realisations of a case are replaced by the mean of its successful realisations.
    """
    array = dataset[output]
    others = [str(dim) for dim in array.dims if dim not in ("case", "realisation")]
    if others:
        raise FitError(
            f"expected one number of {output} for each case, got values along the dimension {others[0]}: choose one "
            "with --select"
        )
    if "realisation" not in array.dims:
        array = array.expand_dims("realisation")
    values: FloatArray = array.transpose("realisation", "case").to_numpy().astype(np.float64)
    values = np.where(np.isfinite(values), values, np.nan)
    number = np.isfinite(values).sum(axis=0)
    mean = np.nansum(values, axis=0) / np.where(number, number, np.nan)
    values = np.where(np.isnan(values), mean, values)
    known = number > 0
    if not known.any():
        raise FitError(f"{output}: no case has a value")
    if np.ptp(mean[known]) == 0:
        raise FitError(f"expected an output that varies, but {output} is the same in every case")
    return values, int((~known).sum())


def _is_saltelli(columns: FloatArray) -> bool:
    """Return whether the cases form Saltelli's design.

    Each base point of this design has a group of cases: a point a, a point b and, for each input, a copy of point a in
    which this input has the value from point b.
    """
    inputs, cases = columns.shape
    if cases % (inputs + 2):
        return False
    points = columns.reshape(inputs, -1, inputs + 2)
    mixed = points[:, :, :1].repeat(inputs, axis=2)
    mixed[range(inputs), :, range(inputs)] = points[:, :, 1]
    return bool(np.array_equal(mixed, points[:, :, 2:]))


def _product(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return for each point the product of `left` and `right`, averaged over all pairs of different realisations.

    With a single realisation, return its products.
    """
    count = len(left)
    if count == 1:
        return np.asarray(left[0] * right[0])
    both = left.sum(axis=0) * right.sum(axis=0) - (left * right).sum(axis=0)
    return np.asarray(both / (count * (count - 1)))


def _exchanged(values: FloatArray) -> FloatArray:
    """Return the first-order and the total index of one input, from outputs of shape (realisations, points, 3).

    The last dimension contains the outputs at point a, at point b, and at point a with the input of point b.
    """
    a, b, mixed = np.moveaxis(values[:, np.isfinite(values).all(axis=(0, 2))], 2, 0)
    if a.shape[1] < 2:  # the jackknife leaves out one point
        raise FitError("expected at least three base points without a failed case")
    variance = (_product(a, a) + _product(b, b)).mean() / 2 - ((a.mean() + b.mean()) / 2) ** 2
    first, total = _product(b, mixed - a).mean(), _product(a - mixed, a - mixed).mean() / 2
    found: FloatArray = np.array([first, total]) / variance
    return found


def _with_interval(values: FloatArray, indices: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return the results of the function `indices`, and the ends of their jackknife intervals, shape (3, results).

    The function takes outputs of shape (realisations, points, ...).
    """
    middle, lines = indices(values), len(values)
    groups = min(bootstrap.GROUPS, values.shape[1])
    group = np.random.Generator(np.random.Philox(0)).permutation(values.shape[1]) % groups
    half = _jackknife([indices(values[:, group != k]) for k in range(groups)])
    if lines > 1:
        half = np.hypot(half, _jackknife([indices(np.delete(values, k, axis=0)) for k in range(lines)]))
    return np.array([middle, middle - half, middle + half])


def _jackknife(parts: list[FloatArray]) -> FloatArray:
    """Return the half widths of intervals from `parts`; each item was computed without one part of the data."""
    count = len(parts)
    error = np.sqrt((count - 1) / count * np.sum((np.array(parts) - np.mean(parts, axis=0)) ** 2, axis=0))
    half: FloatArray = t.ppf(bootstrap.TAILS[1], count - 1) * error
    return half


def _advice(result: xr.Dataset) -> str:
    """Return a sentence on whether the intervals are narrow enough and, if not, how many more cases are needed."""
    widest = max(((result[f"{name}_high"] - result[f"{name}_low"]) / 2).max().item() for name in ("first", "total"))
    cases = result.attrs["cases"]
    if widest <= NARROW:
        return f"enough points: every interval is narrower than +-{NARROW:g}"
    more = int(np.ceil(cases * ((widest / NARROW) ** 2 - 1)))
    return (
        f"not enough points: the widest interval is +-{widest:.3g}; about {short(more)} more cases would "
        f"narrow it to +-{NARROW:g}"
    )
