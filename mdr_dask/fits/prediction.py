"""The prediction of a study at measured points, as a function of the unknown parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import aggregation, bootstrap
from mdr_dask.arrays import SAME, FloatArray
from mdr_dask.campaign.measured import Measured, belonging, outside
from mdr_dask.errors import DataError, FitError
from mdr_dask.fits.interpolation import FEWEST, Scale, cubic, dense, left_out_error, linear
from mdr_dask.units import shown

#: Largest number of modes of the scatter that is common to all points; it limits the computing time. Chosen by trial.
MODES = 6


class Predicted(NamedTuple):
    """Predicted values of the output at the measured points, for several sets of unknowns.

    `mean` is the mean over the realisations, shape (sets, points). `together`, shape (sets, points, modes), contains
    errors common to all points: each mode is the change of all points by one standard deviation. The last mode
    represents the errors of grid and interpolation. The other modes represent the scatter of the rough lines. `alone`
    is the variance of the errors that are independent for each point.
    """

    mean: FloatArray
    together: FloatArray
    alone: FloatArray


@dataclass(frozen=True)
class Prediction:
    """The output at the measured points and the errors of the output, interpolated over the unknowns of a study.

    `unknowns` contains the computed values of each unknown, ascending. If `logarithmic` is true, the logarithm of the
    output is interpolated.
    """

    unknowns: Mapping[str, FloatArray]
    realisations: int
    logarithmic: bool
    _mean: Callable[[FloatArray], FloatArray]
    _errors: Callable[[FloatArray], FloatArray]

    @property
    def scales(self) -> list[Scale]:
        """Scale of each unknown, linear or logarithmic."""
        return [Scale.of(values) for values in self.unknowns.values()]

    def values(self, places: FloatArray) -> FloatArray:
        """Return the unknowns at points in the unit cube. The coordinates 0 and 1 are the ends of an axis."""
        found = []
        for scale, axis, place in zip(self.scales, self.unknowns.values(), places.T, strict=True):
            low, high = scale.of_values(axis[[0, -1]])
            found.append(scale.back(low + (high - low) * place))
        return np.stack(found, axis=1)

    def __call__(self, places: FloatArray) -> Predicted:
        """Return the prediction for points in the unit cube, shape (sets, unknowns)."""
        mean = self._mean(places)
        errors = self._errors(places)
        alone, systematic, modes = errors[..., 0], errors[..., 1], errors[..., 2:]
        half = systematic[..., None] / 2
        together = np.concatenate([modes, half], axis=-1)
        return Predicted(np.exp(mean) if self.logarithmic else mean, together, alone**2 + half[..., 0] ** 2)


def prediction(dataset: xr.Dataset, measured: Measured) -> Prediction:
    """Return the prediction of a study at the measured points, as a function of the unknowns.

    Raise FitError if the study is no grid, has unsuitable axes, or lacks values that the prediction needs. Raise
    DataError if a measured point lies outside the study.
    """
    output = dataset[measured.output]
    if "case" in output.dims:
        raise FitError("expected a grid, got a sampled study, whose cases have no axes")
    dataset = _at_fixed(dataset, measured)
    unknowns = _unknowns(dataset, measured)
    along = [str(dim) for dim in dataset[measured.output].dims if dim in measured.conditions]
    between = {axis: not _is_computed(dataset[axis].to_numpy(), measured.conditions[axis]) for axis in along}
    fields, logarithmic = _fields(dataset, measured.output, along, [*unknowns], between)
    at_points = np.stack(
        [
            _at_point(fields, [dataset[axis].to_numpy() for axis in along], [measured.conditions[a][k] for a in along])
            for k in range(measured.values.size)
        ],
        axis=-2,
    )
    missing = at_points[..., 1] > 0
    if missing.any():
        raise FitError(
            f"{measured.output}: {int(missing.sum())} of the {missing.size} values that are needed to compare the "
            f"study with {measured.source} are missing; finish the run, or select a complete part by --select "
            f"{next(iter(unknowns))}=..."
        )
    return _interpolators(at_points, unknowns, dataset.sizes.get("realisation", 1), logarithmic)


def _at_fixed(dataset: xr.Dataset, measured: Measured) -> xr.Dataset:
    """Remove the axes with a single value from a study; raise DataError if a measured point lies outside the study."""
    array = dataset[measured.output]
    single = [str(dim) for dim in array.dims if dim in array.coords and array.sizes[dim] == 1 and dim != "realisation"]
    dataset = dataset.squeeze(single)
    for name, wanted in measured.conditions.items():
        held = dataset[name]
        off = outside(wanted, held.to_numpy())
        if off.any():
            worst = int(np.flatnonzero(off)[0])
            unit = str(held.attrs.get("units", "1"))
            ends = dict.fromkeys([float(held.min()), float(held.max())])
            measured_at, *known = (shown(value, unit, 9) for value in (float(wanted[worst]), *ends))
            hint = "" if held.ndim else " only (delete the column to use this value)"
            what = f"{name} is {measured_at}, but this study has {' to '.join(known)}{hint}"
            raise DataError(measured.lines[worst].message(measured.source, what))
    return dataset


def _unknowns(dataset: xr.Dataset, measured: Measured) -> dict[str, FloatArray]:
    free = [str(d) for d in dataset[measured.output].dims if d != "realisation" and d not in measured.conditions]
    for name in free:
        if name not in dataset.coords or dataset[name].dtype.kind not in "fiu":
            raise FitError(f"expected numbers on the axis {name}, got words: choose one of them with --select")
        if dataset.sizes[name] < FEWEST:
            raise FitError(
                f"expected at least {FEWEST} values of the unknown {name}, got {dataset.sizes[name]}; add values to "
                f"the campaign, or a column {name} to the table if it was measured"
            )
    if not 1 <= len(free) <= 4:
        found = ", ".join(free) or "none"
        raise FitError(f"expected one to four axes of the study that are not columns of the table, got {found}")
    return {name: dataset[name].to_numpy().astype(np.float64) for name in free}


def _is_computed(axis: FloatArray, wanted: FloatArray) -> bool:
    """Return whether all `wanted` values are computed values of the axis, up to the relative difference `SAME`.

    If the axis has too few values for an interpolation, `mdr_dask.tables.AGREE` is used instead.
    """
    if axis.size < FEWEST:
        return bool(np.isfinite(belonging(wanted, axis)).all())
    nearest = np.min(np.abs(wanted[:, None] - axis), axis=1)
    return bool(np.all(nearest <= SAME * np.maximum(np.abs(wanted), np.abs(axis).max() * SAME)))


def _fields(
    dataset: xr.Dataset, output: str, along: Sequence[str], unknowns: Sequence[str], between: Mapping[str, bool]
) -> tuple[FloatArray, bool]:
    """Return the numbers to interpolate for every case, and whether logarithms replace the means.

    The last axis contains, in this order: the mean; 1 where missing cases prevent interpolation, otherwise 0; the
    scatter that is independent for each case; the error of grid and interpolation; and the modes of the scatter that is
    common to all cases.
    """
    order = [*along, *unknowns]
    array = dataset[output]
    if "realisation" not in array.dims:
        array = array.expand_dims("realisation")
    values = array.transpose(*order, "realisation").to_numpy().astype(np.float64)
    values = np.where(np.isfinite(values), values, np.nan)
    number = np.isfinite(values).sum(axis=-1)
    mean = np.nansum(values, axis=-1) / np.where(number, number, np.nan)
    companion = aggregation.companion(dataset, output)
    grid = np.zeros_like(mean)
    if companion is not None:
        spread = abs(companion).mean("realisation") if "realisation" in companion.dims else abs(companion)
        grid = np.nan_to_num(spread.transpose(*order).to_numpy())
    absent = ~np.isfinite(mean)
    mean = np.where(absent, np.mean(mean[~absent]) if not absent.all() else 0.0, mean)
    for k, axis in enumerate(along):
        absent = _and_neighbours(absent, k) if between[axis] else absent
    scale = Scale.of(mean, spread=True)
    table = scale.of_values(mean)
    between_values = np.zeros_like(mean)
    for k, axis in enumerate(order):
        if axis in unknowns or between[axis]:
            between_values += left_out_error(scale, table, _long_enough(dataset, axis), k)
    alone, modes = _scatter(values - mean[..., None], number, mean)
    return np.concatenate(
        [np.stack([table, absent, alone, grid + between_values], axis=-1), modes], axis=-1
    ), scale.logarithmic


def _and_neighbours(absent: NDArray[np.bool_], axis: int) -> NDArray[np.bool_]:
    """Mark the missing cases and their neighbours, because a cubic uses two cases on each side of a point."""
    from scipy.ndimage import maximum_filter1d

    return np.asarray(maximum_filter1d(absent.astype(np.int8), 3, axis) > 0)


def _long_enough(dataset: xr.Dataset, axis: str) -> FloatArray:
    places: FloatArray = dataset[axis].to_numpy().astype(np.float64)
    if places.size < FEWEST:
        raise FitError(
            f"expected at least {FEWEST} values of {axis}, because measured points lie between its values, got "
            f"{places.size}; add values to the campaign, such as those of the measured points"
        )
    return places


def _scatter(deviations: FloatArray, number: NDArray[np.intp], mean: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the part of the standard error that is independent for each case, and the modes of the common part.

    All cases use the same rough lines. A few modes therefore represent most of the variance of all cases. With a single
    realisation, the independent part is 0, and there are no modes.
    """
    count = deviations.shape[-1]
    if count < 2:
        return np.zeros_like(mean), np.zeros((*mean.shape, 0))
    spare = np.maximum(number * (number - 1), 1)
    few = np.maximum(number, 2)
    # quantile of Student's t distribution divided by the quantile of a normal distribution
    widened = bootstrap.widening(few) * np.sqrt((few - 1) / few)
    each = np.nan_to_num(deviations) * (widened / np.sqrt(spare))[..., None]
    size = np.where(np.abs(mean) > 0, np.abs(mean), 1.0)
    relative = np.nan_to_num(each / size[..., None]).reshape(-1, count)
    _, lines = np.linalg.eigh(relative.T @ relative)
    kept = min(MODES, count - 1)
    modes = each @ lines[:, ::-1][:, :kept]
    rest = np.maximum((each**2).sum(axis=-1) - (modes**2).sum(axis=-1), 0.0)
    return np.sqrt(rest), modes


def _at_point(fields: FloatArray, axes: Sequence[FloatArray], place: Sequence[float]) -> FloatArray:
    """Interpolate the result of `_fields` to a measured point, along one condition after the other."""
    for axis, wanted in zip(axes, place, strict=True):
        nearest = int(np.argmin(np.abs(axis - wanted)))
        if _is_computed(axis, np.array([wanted])):
            fields = fields[nearest]
            continue
        cell = int(np.clip(np.searchsorted(axis, wanted) - 1, 0, axis.size - 2))
        near = slice(max(cell - 1, 0), min(cell + 3, axis.size))  # a monotone cubic depends on four values
        at = np.clip(np.array([wanted]), axis[0], axis[-1])
        scale = Scale.of(axis)
        mean = cubic(axis[near], fields[near, ..., :1], at, 0, scale)
        rest = linear(axis[near], fields[near, ..., 1:], at, 0, scale)
        fields = np.concatenate([mean, rest], axis=-1)[0]
    return fields


def _interpolators(
    at_points: FloatArray, unknowns: Mapping[str, FloatArray], count: int, logarithmic: bool
) -> Prediction:
    """Return a prediction that interpolates linearly in a dense table of means and in the table of computed errors."""
    from scipy.interpolate import RegularGridInterpolator

    scales = [Scale.of(values) for values in unknowns.values()]
    places = [scale.of_values(values) for scale, values in zip(scales, unknowns.values(), strict=True)]
    unit = [(place - place[0]) / (place[-1] - place[0]) for place in places]
    table, errors = at_points[..., 0], at_points[..., 2:]
    fine = []
    for k, (values, grid) in enumerate(zip(unknowns.values(), dense([*unknowns.values()], table.size), strict=True)):
        table = cubic(values, table, grid, k)
        fine.append((scales[k].of_values(grid) - places[k][0]) / (places[k][-1] - places[k][0]))
        fine[-1][[0, -1]] = 0.0, 1.0
    return Prediction(
        unknowns,
        count,
        logarithmic,
        RegularGridInterpolator(fine, table, bounds_error=False, fill_value=None),
        RegularGridInterpolator(unit, errors, bounds_error=False, fill_value=None),
    )
