"""Averages over groups of cases. All cases of a group have the same values of the chosen axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError, did_you_mean
from mdr_dask.models.base import Status
from mdr_dask.questions.columns import COUNTS

if TYPE_CHECKING:
    import xarray as xr

CASES = "cases"


def averaged(dataset: xr.Dataset, by: Sequence[str], kept: xr.DataArray | None = None) -> xr.Dataset:
    """Average every output over the cases of each group, separately for each realisation.

    Let C be the number of cases of a group that have results. Case c has n_c results x_cr, and m_c is the mean of these
    results. All cases use the same realisations, so the results of the cases are correlated. Therefore the result of
    the group in realisation r is ``m + R u_r``. Here, R is the number of realisations in which the group has results, m
    is the mean of all m_c, and u_r is the sum of ``(x_cr - m_c) / (n_c C)`` over c. The mean and the standard error of
    the R results of a group are correct even if n_c is not the same for all cases. Errors of outputs are replaced by
    their mean absolute value.

    `by` contains names of axes, or of columns of a sampled study. If `kept` is given, only cases where `kept` is true
    are included. The result has the dimension ``group`` instead of the axes, the variable ``cases`` with the number of
    cases of each group, and the variable `COUNTS` instead of ``status``.
    """
    import xarray as xr

    dims = [str(dim) for dim in dataset["status"].dims if dim != "realisation"]
    axes = [str(name) for name, axis in dataset.coords.items() if axis.ndim == 1 and axis.dims[0] in dims]
    for axis in by:
        if axis not in axes:
            raise DataError(f"expected the name of an axis for --group-by, got {axis!r}{did_you_mean(axis, axes)}")
    rows = np.arange(prod(dataset.sizes[dim] for dim in dims))
    if kept is not None:
        like = dataset["status"].isel(realisation=0, drop=True)
        rows = np.flatnonzero(kept.broadcast_like(like).transpose(*dims).to_numpy())
    codes, members = _members(dataset, by, dims, rows)
    errors = {array.attrs.get("ancillary_variables") for array in dataset.data_vars.values()}
    found: dict[str, Any] = {CASES: ("group", members.sizes, {"units": "1"})}
    for name, array in dataset.data_vars.items():
        values = array.transpose(*dims, ..., "realisation")
        shape = values.shape[len(dims) :]
        flat = values.to_numpy().reshape(-1, prod(shape[:-1]), shape[-1])
        if name == "status":
            each = [members.sums((flat == state).sum(axis=-1)[:, 0], int) for state in Status]
            found[COUNTS] = (("group", "state"), np.stack(each, axis=-1), {})
        else:
            reduced = (_errors if name in errors else _common)(flat, members).reshape(-1, *shape)
            found[str(name)] = (("group", *values.dims[len(dims) :]), reduced, array.attrs)
    coords: dict[str, Any] = {str(key): axis for key, axis in dataset.coords.items() if not {*axis.dims} & {*dims}}
    for name, labels in zip(by, codes, strict=True):
        coords[name] = ("group", labels, dataset[name].attrs)
    return xr.Dataset(found, coords, dataset.attrs)


@dataclass(frozen=True)
class _Members:
    """The indices of the cases, sorted by group. The first case of group k is ``order[starts[k]]``."""

    order: NDArray[np.intp]
    starts: NDArray[np.intp]

    @property
    def sizes(self) -> NDArray[np.intp]:
        """Number of cases of every group."""
        return np.diff(self.starts, append=self.order.size)

    def sums(self, values: NDArray[Any], dtype: type = float) -> NDArray[Any]:
        """Return the sum of `values` over the cases (first dimension) of each group."""
        if not self.order.size:
            return np.zeros((0, *values.shape[1:]), dtype)
        return np.asarray(np.add.reduceat(values[self.order], self.starts, axis=0, dtype=dtype))


def _members(
    dataset: xr.Dataset, by: Sequence[str], dims: Sequence[str], rows: NDArray[np.intp]
) -> tuple[list[NDArray[Any]], _Members]:
    """Return the values of the axes `by` for every group, and the cases of every group."""
    places = np.unravel_index(rows, [dataset.sizes[dim] for dim in dims])
    labels = [np.unique(dataset[name].to_numpy(), return_inverse=True) for name in by]
    shape = [values.size for values, _ in labels]
    along = [of[places[dims.index(str(dataset[name].dims[0]))]] for name, (_, of) in zip(by, labels, strict=True)]
    code = np.ravel_multi_index(along, shape)
    order = np.argsort(code, kind="stable")
    present, starts = np.unique(code[order], return_index=True)
    each = np.unravel_index(present, shape)
    return [values[k] for (values, _), k in zip(labels, each, strict=True)], _Members(rows[order], starts)


def _common(values: FloatArray, members: _Members) -> FloatArray:
    """Return the results of every group (see `averaged`), with the dimensions (group, ..., realisation)."""
    there = np.isfinite(values)
    number = there.sum(axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.where(there, values, 0.0).sum(axis=-1, keepdims=True) / number
        cases = members.sums(number > 0)
        level = members.sums(np.where(number > 0, means, 0.0)) / cases
        spread = members.sums(np.where(there, (values - means) / number, 0.0)) / cases
    taken = members.sums(there) > 0
    return np.where(taken, level + taken.sum(axis=-1, keepdims=True) * spread, np.nan)


def _errors(values: FloatArray, members: _Members) -> FloatArray:
    """Return the mean grid error of every group, with the same value in all realisations of the group."""
    each = _common(np.abs(values), members)
    there = np.isfinite(each)
    with np.errstate(invalid="ignore"):
        level = np.where(there, each, 0.0).sum(axis=-1, keepdims=True) / there.sum(axis=-1, keepdims=True)
    return np.where(there, level, np.nan)
