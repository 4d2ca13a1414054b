"""Master curves of a store or of any table: shift factors, merged curve, and laws of the shift factors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError, distinguishable
from mdr_dask.fits.base import Fit
from mdr_dask.fits.collapse import constants_of, kelvins, laws_of, sign_of, with_verdict
from mdr_dask.fits.curve_tables import (
    columns_to_use,
    curves_of,
    finite_rows,
    frame_of,
    is_temperature,
    kind_of,
    pairs_of,
    second_group,
)
from mdr_dask.physics.superposition import master_curve as superposition
from mdr_dask.physics.superposition import two_factors as two_shifts
from mdr_dask.physics.superposition.master_curve import EXPANSION, OFFSET, Superposition, Vertical


def master_curve(
    table: xr.Dataset | pd.DataFrame,
    abscissa: str | None = None,
    ordinate: str | Sequence[str] | None = None,
    group: str | None = None,
    vertical: Vertical | None = None,
    reference: float | None = None,
) -> xr.Dataset:
    """Shift the curves of a table, or of a series of a store (means over realisations), onto one curve.

    For the arguments see ``mdr-dask master-curve --help``. ``shift_factor`` is added to log10 of the abscissa,
    ``vertical_factor`` to log10 of the ordinate. The suffix ``_error`` marks the half width of the 68 % interval. The
    suffixes ``_low`` and ``_high`` mark the ends of the 95 % interval. If the curves differ in two parameters, such as
    v and T, the curves are shifted by a(v) + b(T), and ``second_factor`` is b. If the reference lies between two
    groups, the factor at the reference is the factor of the best law plus the interpolated difference between the shift
    factors and this law.
    """
    frame = frame_of(table)
    over, ordinates, by = columns_to_use(frame, abscissa, ordinate, group)
    units = frame.attrs.get("units", {})
    second = second_group(frame, (over, *ordinates, by))
    if isinstance(table, xr.Dataset):
        _require_no_axis_beside(table[ordinates[0]], {over, by, second, "realisation"})
    used = (over, *ordinates, by, second, *frame.attrs.get("sources", ()))
    unused = [str(name) for name in frame.columns if name not in used]
    not_used = f"not used: {', '.join(unused)}" if unused and isinstance(table, pd.DataFrame) else ""
    frame, left_out = finite_rows(frame, [over, *ordinates, by] + ([second] if second else []))
    kind = kind_of(over, ordinates, by, units) if vertical is None else vertical
    if second is not None:
        if vertical not in (None, "none"):
            raise DataError(
                f"expected no vertical factors for curves that differ in {by!r} and {second!r}, got {vertical!r}: "
                f"keep one value of {second!r}"
            )
        dataset = _of_two_groups(frame, over, ordinates, (by, second), reference)
        return dataset.assign_attrs(left_out=left_out, not_used=not_used, vertical=_sentence("none"))
    groups, curves = curves_of(frame, over, ordinates, by)
    zero = float(groups[groups.size // 2]) if reference is None else _inside(groups, reference)
    kelvin = kelvins(groups, units.get(by, "")) if kind in ("modulus", "compliance") else None
    free = superposition.superpose(groups, curves, kind, kelvin=kelvin)
    largest = "" if kelvin is None else _largest_offset(free, superposition.known_rise(np.sort(kelvin), kind))
    attrs = {
        "left_out": left_out,
        "not_used": not_used,
        "vertical": _sentence(kind, f"{largest} {units.get(by, '')}".rstrip()),
        "undetermined": _undetermined(free),
    }
    return _with_laws(free, zero, over, ordinates, by, units, attrs)


def _largest_offset(found: Superposition, rise: FloatArray) -> str:
    """Return a text with the largest vertical offset of a group, after subtraction of `rise` and the median offset."""
    offset = rise - found.vertical
    offset -= np.median(offset)
    worst = int(np.argmax(np.abs(offset)))
    return f"; the largest one found is {100 * (10 ** offset[worst] - 1):+.2g} % at {found.groups[worst]:.4g}"


def _sentence(kind: Vertical, largest: str = "") -> str:
    if kind == "none":
        return "horizontal factors only"
    if kind == "free":
        return "free vertical factors"
    b_t = "b_T = rho0 T0 / (rho T)" if kind == "modulus" else "1 / b_T = rho T / (rho0 T0)"
    offset = 100 * np.log(10) * OFFSET[0]
    return (
        f"a {kind}: {b_t} with an expansion of {EXPANSION:g} 1/K is taken out, and each temperature has an unknown "
        f"offset of some {offset:.2g} % (--vertical none turns both off){largest}"
    )


def _require_no_axis_beside(values: xr.DataArray, used: set[str | None]) -> None:
    for name in values.dims:
        if name not in used and name in values.coords and values.sizes[name] > 1:
            raise DataError(f"the study varies in {str(name)!r} too: keep one of its values, or group by it")


def _undetermined(found: Superposition) -> str:
    """Return a sentence about undetermined shifts between neighbouring curves; empty if all shifts are determined."""
    if not found.undetermined:
        return ""
    runs = ", ".join(f"between {low:.6g} and {high:.6g}" for low, high in found.undetermined)
    return f"not determined {runs}: curves there do not overlap, or look alike wherever they lie, as on a plateau"


def _of_two_groups(
    frame: pd.DataFrame,
    over: str,
    ordinates: Sequence[str],
    by: tuple[str, str],
    reference: float | None,
) -> xr.Dataset:
    """Shift curves that differ in two parameters; the reference is a value of the first parameter."""
    keys, curves = pairs_of(frame, over, ordinates, by)
    a, b = keys.T
    found = two_shifts.superpose_twice(a, b, curves, None if reference is None else _inside(np.unique(a), reference))
    units = frame.attrs.get("units", {})
    attrs = {"second": by[1], "second_reference": found.second.reference}
    attrs |= {"chi_squared": found.chi_squared, "probability": found.probability}
    dataset = _dataset(found.first, over, ordinates, by[0], units).assign_attrs(attrs)
    shift = found.first.horizontal[found.first.member] + found.second.horizontal[found.second.member]
    dataset["point_shift"] = ("point", shift, {"units": "1"})
    dataset["point_second"] = ("point", found.second.groups[found.second.member], {"units": units.get(by[1], "")})
    extra = _dataset(found.second, over, ordinates, by[1], units)
    for part in ("", "_error", "_low", "_high"):
        dataset[f"second_factor{part}"] = extra[f"shift_factor{part}"]
    verdicts: dict[str, str] = {}
    for one, name in zip((found.first, found.second), by, strict=True):
        laws, sentences = laws_of(
            one, over, units.get(name, ""), one.reference, is_temperature=is_temperature(name, units.get(name, ""))
        )
        dataset, verdicts = dataset.assign(constants_of(laws)), verdicts | sentences
    return with_verdict(dataset, verdicts)


def _inside(groups: FloatArray, reference: float) -> float:
    """Return the reference, or the nearest group if the reference lies just outside the groups.

    Because measured values scatter, the reference may lie outside the groups by up to a tenth of the mean step between
    groups.
    """
    margin = 0.1 * np.ptp(groups) / max(groups.size - 1, 1)
    if not groups.min() - margin <= reference <= groups.max() + margin:
        got, low, high = distinguishable(reference, groups.min(), groups.max(), digits=6)
        raise DataError(f"expected a reference between {low} and {high}, got {got}")
    return float(np.clip(reference, groups.min(), groups.max()))


def _with_laws(
    found: Superposition,
    zero: float,
    over: str,
    ordinates: Sequence[str],
    by: str,
    units: Mapping[str, str],
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    unit = units.get(by, "")
    warm = is_temperature(by, unit)
    laws, verdicts = laws_of(found, over, unit, zero, is_temperature=warm)
    best = min(laws, key=lambda law: law.residual, default=None)
    if best is None:
        logarithmic = bool(np.all(found.groups > 0)) and not warm
        moved = superposition.rereference(found, zero, logarithmic=logarithmic)
    else:
        places = np.append(found.groups, zero)
        sign = sign_of(over) if warm else 1
        law = sign * best.factors(kelvins(places, unit, found.groups) if warm else places)
        moved = superposition.rereference(found, zero, law[:-1], float(law[-1]), logarithmic=not warm)
    dataset = _dataset(moved, over, ordinates, by, units).assign(constants_of(laws)).assign_attrs(attrs)
    return with_verdict(dataset, verdicts)


def _dataset(
    result: Superposition, over: str, ordinates: Sequence[str], by: str, units: Mapping[str, str]
) -> xr.Dataset:
    size = result.groups.size
    attrs = {
        "abscissa": over,
        "ordinate": ordinates[0],
        "companion": ordinates[1] if len(ordinates) > 1 else "",
        "group": by,
        "reference": result.reference,
    }
    attrs |= {f"{name}_noise": float(each) for name, each in zip(("ordinate", "companion"), result.noise, strict=False)}
    found: dict[str, tuple[Any, ...]] = {}
    narrow, wide = result.interval(math.erf(0.5**0.5)), result.interval()  # 68 % and 95 %
    for name, factor, own in (
        ("shift_factor", result.horizontal, slice(size)),
        ("vertical_factor", result.vertical, slice(size, None)),
    ):
        meaning = f"decades added to log10 of {over if name == 'shift_factor' else ordinates[0]}"
        bar = (narrow[1, own] - narrow[0, own]) / 2
        found[name] = (by, factor, {"units": "1", "long_name": meaning})
        found[f"{name}_error"] = (by, bar, {"units": "1", "long_name": "half width of the 68 % interval"})
        found[f"{name}_low"] = (by, wide[0, own], {"units": "1"})
        found[f"{name}_high"] = (by, wide[1, own], {"units": "1"})
    covariance = result.covariance
    found["covariance"] = ((by, f"{by}_2"), covariance[:size, :size], {"units": "1"})
    found["vertical_covariance"] = ((by, f"{by}_2"), covariance[size:, size:], {"units": "1"})
    found["draws"] = (("draw", by), result.draws[:, :size], {"units": "1"})
    found["vertical_draws"] = (("draw", by), result.draws[:, size:], {"units": "1"})
    found["point_abscissa"] = ("point", 10**result.x, {"units": units.get(over, "")})
    found["point_group"] = ("point", result.groups[result.member], {"units": units.get(by, "")})
    measured = {"measured_low": 10 ** result.measured[0], "measured_high": 10 ** result.measured[1]}
    found["curve_abscissa"] = ("curve", 10**result.curve_x, {"units": units.get(over, ""), **measured})
    about = {"units": "1", "long_name": "standard error, decades"}
    for c, (name, values) in enumerate(zip(("ordinate", "companion"), ordinates, strict=False)):
        unit = {"units": units.get(values, ""), "long_name": values}
        found[f"point_{name}"] = ("point", 10 ** result.y[c], unit)
        found[f"curve_{name}"] = ("curve", 10 ** result.curve_y[c], unit)
        found["curve_error" if c == 0 else "curve_companion_error"] = ("curve", result.curve_error[c], about)
    found["curve_covariance"] = (("channel", "curve", "factor"), result.curve_cross, {"units": "1"})
    return xr.Dataset(found, {by: (by, result.groups, {"units": units.get(by, "")})}, attrs)


def rereferenced(curve: xr.Dataset, reference: float) -> xr.Dataset:
    """Convert a master curve, as returned by `master_curve` or read from a file, to another reference."""
    by, over = str(curve.attrs["group"]), str(curve.attrs["abscissa"])
    ordinates = [str(curve.attrs[name]) for name in ("ordinate", "companion") if curve.attrs.get(name)]
    names, errors = ("ordinate", "companion")[: len(ordinates)], ("curve_error", "curve_companion_error")
    groups = curve[by].to_numpy()
    old = Superposition(
        groups=groups,
        horizontal=curve["shift_factor"].to_numpy(),
        vertical=curve["vertical_factor"].to_numpy(),
        draws=np.hstack([curve["draws"].to_numpy(), curve["vertical_draws"].to_numpy()]),
        reference=float(curve.attrs["reference"]),
        noise=np.array([float(curve.attrs[f"{name}_noise"]) for name in names]),
        x=np.log10(curve["point_abscissa"].to_numpy()),
        y=np.log10([curve[f"point_{name}"].to_numpy() for name in names]),
        member=np.searchsorted(groups, curve["point_group"].to_numpy()),
        curve_x=np.log10(curve["curve_abscissa"].to_numpy()),
        curve_y=np.log10([curve[f"curve_{name}"].to_numpy() for name in names]),
        curve_error=np.array([curve[name].to_numpy() for name in errors[: len(ordinates)]]),
        curve_cross=curve["curve_covariance"].to_numpy(),
        measured=(0.0, 0.0),
    )
    units = {over: curve["curve_abscissa"].attrs.get("units", ""), by: curve[by].attrs.get("units", "")}
    units |= {
        values: curve[f"curve_{name}"].attrs.get("units", "") for name, values in zip(names, ordinates, strict=True)
    }
    kept = {name: value for name, value in curve.attrs.items() if name not in ("reference",)}
    dataset = _with_laws(old, _inside(groups, reference), over, ordinates, by, units, {})
    for name in [name for name in curve.data_vars if name not in dataset or name == "law_holds"]:
        dataset[name] = curve[name]
    if "point_shift" in curve:
        dataset["point_shift"] = curve["point_shift"] + float(dataset["shift_factor"][0] - curve["shift_factor"][0])
    return dataset.assign_attrs(kept)


def friction_of_roughness(series: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return the mean friction of the first series with roughness, as a function of force and velocity.

    Only a series that varies both force and velocity is used. If another series has the same forces and velocities but
    no roughness, the friction of the series without roughness is subtracted.
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
    """Return the shift factors and the constants of the laws, without the merged curve."""
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
        apart=False,
        constants=("shift_factor", "vertical_factor", "second_factor", "power_exponent"),
    ),
)
