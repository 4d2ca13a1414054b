"""Master curves of a store or of any table: shift factors, the merged curve, and the laws that the factors follow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from scipy.special import stdtrit

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError, distinguishable
from mdr_dask.fits.base import Fit
from mdr_dask.fits.collapse import laws_of, with_verdict
from mdr_dask.fits.curve_tables import (
    clusters,
    columns_to_use,
    curves_of,
    finite_rows,
    frame_of,
    is_temperature,
    second_group,
)
from mdr_dask.physics.superposition import master_curve as superposition
from mdr_dask.physics.superposition import two_factors as two_shifts

SHARE_OF_BARS, CONFIDENCE = 0.6827, 0.95  # of Student's t: `_error`, and `_low` to `_high`


def master_curve(
    table: xr.Dataset | pd.DataFrame,
    abscissa: str | None = None,
    ordinate: str | None = None,
    group: str | None = None,
    vertical: bool = False,
    reference: float | None = None,
    draws: int = 0,
) -> xr.Dataset:
    """Shift curves of a table into one.

    A table that varies in velocity and in temperature gives a factor of each, added: log x + a(v) + b(T).

    Parameters
    ----------
    table : Dataset or DataFrame
        A series of a store (realisations are averaged) or columns of numbers.
    abscissa, ordinate, group : str, optional
        Columns: what curves are drawn over, their values, and what they differ in. By default the coefficient of
        friction over force by velocity (or temperature), or the modulus over frequency or time by temperature.
    vertical : bool
        Whether curves may shift along the ordinate too.
    reference : float, optional
        Where the factors are zero, between two groups by linear interpolation; the middle group by default. Of two
        groups, the nearest value of the first one.
    draws : int
        Bootstrap samples of the factors.

    Returns
    -------
    Dataset
        ``shift_factor`` and ``vertical_factor`` (decades added to the logarithms of abscissa and ordinate) over the
        group, with
        ``_error`` (68 %), ``_low`` and ``_high`` (95 %) and ``covariance``; ``point_abscissa``, ``point_ordinate``,
        ``point_group``: all
        points after shifting; ``curve_abscissa``, ``curve_ordinate``, ``curve_error``: the merged curve (the error in
        decades), with the range measured at the reference in its attrs; constants of the laws that apply. With two
        groups also ``second_factor`` (and ``second_vertical_factor``) over the second one, the constants of its laws,
        and in the attrs ``second``, ``second_reference``, ``chi_squared`` and ``probability`` of the sum.

    Raises
    ------
    DataError
        If a column is missing, not positive, or the curves do not overlap.
    """
    frame = frame_of(table)
    over, values, by = columns_to_use(frame, abscissa, ordinate, group)
    second = second_group(frame, {over, values, by})
    if isinstance(table, xr.Dataset):
        _require_no_axis_beside(table[values], {over, by, second, "realisation"})
    frame, left_out = finite_rows(frame, [over, values, by] + ([second] if second else []))
    if second is not None:
        found = _of_two_groups(frame, over, values, (by, second), vertical, reference, draws)
        return found.assign_attrs(left_out=left_out)
    groups, curves = curves_of(frame, over, values, by)
    zero = groups[groups.size // 2] if reference is None else _inside(groups, reference)
    free = superposition.superpose(groups, curves, vertical, None, draws)
    result = superposition.rereference(free, float(zero), _is_logarithmic(by, groups))
    units = frame.attrs.get("units", {})
    dataset = _dataset(result, over, values, by, units)
    return _with_laws(dataset, (result, by, units.get(by, ""))).assign_attrs(left_out=left_out, **_untold(free))


def _require_no_axis_beside(values: xr.DataArray, used: set[str | None]) -> None:
    """Refuse a study whose curves differ in more than they are shifted by."""
    for name in values.dims:
        if name not in used and name in values.coords and values.sizes[name] > 1:
            raise DataError(f"the study varies in {str(name)!r} too: keep one of its values, or group by it")


def _untold(found: superposition.Superposition) -> dict[str, str]:
    """Return a sentence about the steps that the curves do not tell, if there are any."""
    if not found.undetermined:
        return {"undetermined": ""}
    runs = ", ".join(f"between {low:.6g} and {high:.6g}" for low, high in found.undetermined)
    mean, scatter = found.usual
    return {
        "undetermined": f"not determined {runs}: the curves look alike wherever they lie there, so that steps are "
        f"taken to be as others are, {mean:.2g} with a scatter of {scatter:.2g} decades"
    }


def _of_two_groups(
    frame: pd.DataFrame,
    over: str,
    values: str,
    by: tuple[str, str],
    vertical: bool,
    reference: float | None,
    draws: int,
) -> xr.Dataset:
    """Shift curves that differ in two things; the reference is of the first."""
    keys, curves = [], []
    rows = frame[[over, values, *by]]
    first, second = (clusters(rows[name].to_numpy(dtype=np.float64)) for name in by)
    centres = [
        {label: float(rows[name].to_numpy()[labels == label].mean()) for label in np.unique(labels)}
        for name, labels in zip(by, (first, second), strict=True)
    ]
    for one, other in sorted(set(zip(first.tolist(), second.tolist(), strict=True))):
        part = rows[(first == one) & (second == other)]
        (_,), (curve,) = curves_of(part.assign(**{by[0]: centres[0][one]}), over, values, by[0])
        if np.ptp(curve[0]) == 0:
            where = f"{by[0]} = {centres[0][one]:g}, {by[1]} = {centres[1][other]:g}"
            raise DataError(f"the curve at {where} needs two or more distinct points")
        keys.append((centres[0][one], centres[1][other]))
        curves.append(curve)
    a, b = np.array(keys).T
    zero = _nearest(np.unique(a), np.unique(a)[np.unique(a).size // 2] if reference is None else reference)
    zeros = zero, float(np.unique(b)[np.unique(b).size // 2])
    found = two_shifts.superpose_twice(a, b, curves, zeros, draws, vertical=vertical)
    units = frame.attrs.get("units", {})
    dataset = _dataset(found.first, over, values, by[0], units)
    for name, along in (("point_shift", "horizontal"), ("point_rise", "vertical")):
        parts = [getattr(part, along)[part.member] for part in (found.first, found.second)]
        dataset[name] = ("point", parts[0] + parts[1], {"units": "1"})
    dataset["point_second"] = ("point", found.second.groups[found.second.member], {"units": units.get(by[1], "")})
    extra = _dataset(found.second, over, values, by[1], units)
    for part in ("", "_error", "_low", "_high", *(("_bootstrap",) if draws else ())):
        dataset[f"second_factor{part}"] = extra[f"shift_factor{part}"]
        if vertical:
            dataset[f"second_vertical_factor{part}"] = extra[f"vertical_factor{part}"]
    if draws:
        dataset["second_draws"] = extra["draws"]
    about = {"second": by[1], "second_reference": found.second.reference}
    parts = [(one, name, units.get(name, "")) for one, name in zip((found.first, found.second), by, strict=True)]
    dataset = _with_laws(dataset, *parts)
    return dataset.assign_attrs(about, chi_squared=found.chi_squared, probability=found.probability)


def _inside(groups: FloatArray, reference: float) -> float:
    """Return the reference, or the first or last group if it lies just outside: set points are met by so much."""
    margin = 0.1 * np.ptp(groups) / max(groups.size - 1, 1)
    if not groups.min() - margin <= reference <= groups.max() + margin:
        told, low, high = distinguishable(reference, groups.min(), groups.max(), digits=6)
        raise DataError(f"the reference must lie between {low} and {high}, got {told}")
    return float(np.clip(reference, groups.min(), groups.max()))


def _is_logarithmic(by: str, groups: FloatArray) -> bool:
    """Say whether factors are nearly linear in the logarithm of the group, as a power law of velocities is."""
    return bool(np.all(groups > 0)) and not is_temperature(by)


def _nearest(groups: FloatArray, reference: float) -> float:
    return float(groups[np.argmin(np.abs(groups - _inside(groups, reference)))])


def _dataset(
    result: superposition.Superposition, over: str, values: str, by: str, units: Mapping[str, str]
) -> xr.Dataset:
    size = result.groups.size
    attrs = {
        "abscissa": over,
        "ordinate": values,
        "group": by,
        "reference": result.reference,
        "noise": result.noise,
        "freedom": result.freedom,
    }
    found: dict[str, tuple[Any, ...]] = {}
    narrow, wide = (float(stdtrit(result.freedom, 0.5 + share / 2)) for share in (SHARE_OF_BARS, CONFIDENCE))
    factors = {"shift_factor": (result.horizontal, result.horizontal_error)}
    factors["vertical_factor"] = (result.vertical, result.vertical_error)
    for name, (factor, error) in factors.items():
        meaning = f"decades added to log10 of {over if name == 'shift_factor' else values}"
        found[name] = (by, factor, {"units": "1", "long_name": meaning})
        found[f"{name}_error"] = (by, narrow * error, {"units": "1", "long_name": "half width of the 68 % interval"})
        found[f"{name}_low"] = (by, factor - wide * error, {"units": "1"})
        found[f"{name}_high"] = (by, factor + wide * error, {"units": "1"})
    found["covariance"] = ((by, f"{by}_2"), result.covariance[:size, :size], {"units": "1"})
    found["vertical_covariance"] = ((by, f"{by}_2"), result.covariance[size:, size:], {"units": "1"})
    found["point_abscissa"] = ("point", 10**result.x, {"units": units.get(over, "")})
    found["point_ordinate"] = ("point", 10**result.y, {"units": units.get(values, "")})
    found["point_group"] = ("point", result.groups[result.member], {"units": units.get(by, "")})
    measured = {"measured_low": 10 ** result.measured[0], "measured_high": 10 ** result.measured[1]}
    found["curve_abscissa"] = ("curve", 10**result.curve_x, {"units": units.get(over, ""), **measured})
    found["curve_ordinate"] = ("curve", 10**result.curve_y, {"units": units.get(values, "")})
    found["curve_error"] = ("curve", result.curve_error, {"units": "1", "long_name": "standard error, decades"})
    found["curve_covariance"] = (("curve", "factor"), result.curve_cross, {"units": "1"})
    if result.draws.size:
        for name, drawn in (("shift_factor", result.draws[:, :size]), ("vertical_factor", result.draws[:, size:])):
            low, high = np.quantile(drawn, (0.5 - SHARE_OF_BARS / 2, 0.5 + SHARE_OF_BARS / 2), axis=0)
            about = {"units": "1", "long_name": "half width of 68 % of the bootstrap samples"}
            found[f"{name}_bootstrap"] = (by, (high - low) / 2, about)
        found["draws"] = (("draw", by), result.draws[:, :size], {"units": "1"})
        found["vertical_draws"] = (("draw", by), result.draws[:, size:], {"units": "1"})
    return xr.Dataset(found, {by: (by, result.groups, {"units": units.get(by, "")})}, attrs)


def _with_laws(dataset: xr.Dataset, *parts: tuple[superposition.Superposition, str, str]) -> xr.Dataset:
    """Return a master curve with the laws of its parts (what was found, its group and unit), and a verdict."""
    over = str(dataset.attrs["abscissa"])
    told: dict[str, str] = {}
    for found, by, unit in parts:
        constants, verdicts = laws_of(found, over, unit, is_temperature=is_temperature(by))
        dataset, told = dataset.assign(constants), told | verdicts
    return with_verdict(dataset, told)


def rereferenced(curve: xr.Dataset, reference: float) -> xr.Dataset:
    """Return a master curve, as `master_curve` made or a file kept it, with the factors zero at another group.

    Raises
    ------
    DataError
        If the value lies outside the groups.
    """
    by = str(curve.attrs["group"])
    over, values = str(curve.attrs["abscissa"]), str(curve.attrs["ordinate"])
    groups = curve[by].to_numpy()
    size = groups.size
    covariance = np.zeros((2 * size, 2 * size))
    covariance[:size, :size], covariance[size:, size:] = curve["covariance"], curve["vertical_covariance"]
    old = superposition.Superposition(
        groups=groups,
        horizontal=curve["shift_factor"].to_numpy(),
        vertical=curve["vertical_factor"].to_numpy(),
        covariance=covariance,
        reference=float(curve.attrs["reference"]),
        noise=float(curve.attrs["noise"]),
        freedom=float(curve.attrs["freedom"]),
        x=np.log10(curve["point_abscissa"].to_numpy()),
        y=np.log10(curve["point_ordinate"].to_numpy()),
        member=np.searchsorted(groups, curve["point_group"].to_numpy()),
        curve_x=np.log10(curve["curve_abscissa"].to_numpy()),
        curve_y=np.log10(curve["curve_ordinate"].to_numpy()),
        curve_error=curve["curve_error"].to_numpy(),
        curve_cross=curve["curve_covariance"].to_numpy(),
        measured=(0.0, 0.0),
        draws=_drawn(curve),
    )
    units = {
        by: curve[by].attrs.get("units", ""),
        over: curve["curve_abscissa"].attrs.get("units", ""),
        values: curve["curve_ordinate"].attrs.get("units", ""),
    }
    new = superposition.rereference(old, _inside(groups, reference), _is_logarithmic(by, groups))
    dataset = _with_laws(_dataset(new, over, values, by, units), (new, by, units[by]))
    for name in [name for name in curve.data_vars if name not in dataset or name == "law_holds"]:
        dataset[name] = curve[name]
    if "point_shift" in curve:
        dataset["point_shift"] = curve["point_shift"] + float(new.horizontal[0] - old.horizontal[0])
        dataset["point_rise"] = curve["point_rise"] + float(new.vertical[0] - old.vertical[0])
    return dataset.assign_attrs({name: value for name, value in curve.attrs.items() if name not in dataset.attrs})


def _drawn(curve: xr.Dataset) -> FloatArray:
    """Return the bootstrap samples of a kept result, horizontal and vertical side by side."""
    if "draws" not in curve:
        return np.empty((0, 2 * curve["shift_factor"].size))
    across = curve["draws"].to_numpy()
    along = curve["vertical_draws"].to_numpy() if "vertical_draws" in curve else np.zeros_like(across)
    return np.hstack([across, along])


def friction_of_roughness(series: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return the friction that the force master curve is about, from the series of a store.

    It is the coefficient of friction of the first rough series that varies force and velocity, averaged over
    realisations; less that of a series with the same forces and velocities and no roughness, if there is one: the
    bulk's own friction.

    Raises
    ------
    DataError
        If no series varies ``normal_force`` and ``velocity``.
    """
    wanted = {"normal_force", "velocity"}
    means = [
        (
            float(np.max(dataset.coords.get("rms_roughness", 1.0))),
            dataset["friction_coefficient"].mean("realisation", keep_attrs=True),
        )
        for dataset in series.values()
        if wanted <= set(dataset.dims) and "friction_coefficient" in dataset
    ]
    rough = [mean for height, mean in means if height > 0]
    if not rough:
        raise DataError("a force master curve needs a series with roughness that varies normal_force and velocity")
    friction = rough[0]
    for smooth in (mean for height, mean in means if height == 0):
        if all(np.array_equal(smooth[name], friction[name]) for name in wanted):
            friction = (friction - smooth.reset_coords(drop=True)).assign_attrs(friction.attrs)
    return friction.to_dataset(name="friction_coefficient")


def _of_store(series: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return the factors and the constants of their law; the merged curve is what ``mdr-dask master-curve`` is for."""
    curve = master_curve(friction_of_roughness(series))
    groups = curve.attrs["group"], curve.attrs.get("second", curve.attrs["group"])
    return curve[
        [name for name, values in curve.data_vars.items() if not values.dims or values.dims[0] in groups]
    ].drop_vars(["covariance", "vertical_covariance"])


FITS = (
    Fit(
        "master_curve",
        ("sliding_friction",),
        "mu(F_N, v) = Q(log F_N + shift(v)), shift = exponent log v (thesis 3.44-3.46)",
        _of_store,
        constants=("shift_factor", "vertical_factor", "second_factor", "power_exponent"),
    ),
)
