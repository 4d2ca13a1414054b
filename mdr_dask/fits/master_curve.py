"""Master curves of a store or of any table: shift factors, merged curve, and laws of the shift factors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.fits.base import Fit
from mdr_dask.fits.collapse import constants_of, kelvins, laws_of, sign_of, with_verdict
from mdr_dask.fits.curve_tables import (
    columns_to_use,
    curves_of,
    finite_rows,
    frame_of,
    is_temperature,
    kind_of,
    require_one_group,
)
from mdr_dask.physics.superposition import master_curve as superposition
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
    suffixes ``_low`` and ``_high`` mark the ends of the 95 % interval. All factors are 0 at the reference. If the
    reference lies between two groups, the shift to the reference is interpolated: the deviations of the shift factors
    from the best law are interpolated linearly, and added to the law. Without a law, the shift factors themselves are
    interpolated.
    """
    frame = frame_of(table)
    over, ordinates, by = columns_to_use(frame, abscissa, ordinate, group)
    units = frame.attrs.get("units", {})
    if isinstance(table, xr.Dataset):
        _require_no_axis_beside(table[ordinates[0]], {over, by, "realisation"})
    else:
        require_one_group(frame, (over, *ordinates, by))
    used = (over, *ordinates, by, *frame.attrs.get("sources", ()))
    unused = [str(name) for name in frame.columns if name not in used]
    not_used = f"not used: {', '.join(unused)}" if unused and isinstance(table, pd.DataFrame) else ""
    frame, left_out = finite_rows(frame, [over, *ordinates, by])
    kind = kind_of(over, ordinates, by, units) if vertical is None else vertical
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
    """Return a text with the largest vertical offset: known (`rise`) minus fitted factor, relative to the median."""
    offset = rise - found.vertical
    offset -= np.median(offset)
    worst = int(np.argmax(np.abs(offset)))
    return f"; the largest offset found is {100 * (10 ** offset[worst] - 1):+.2g} % at {found.groups[worst]:.4g}"


def _sentence(kind: Vertical, largest: str = "") -> str:
    if kind == "none":
        return "horizontal factors only"
    if kind == "free":
        return "free vertical factors"
    b_t = "b_T = rho0 T0 / (rho T)" if kind == "modulus" else "1 / b_T = rho T / (rho0 T0)"
    offset = 100 * np.log(10) * OFFSET[0]
    return (
        f"a {kind}: {b_t} with an expansion of {EXPANSION:g} 1/K is removed, and each temperature may have an "
        f"offset of about {offset:.2g} % (with --vertical none, neither is done){largest}"
    )


def _require_no_axis_beside(values: xr.DataArray, used: set[str]) -> None:
    for name in values.dims:
        if name not in used and name in values.coords and values.sizes[name] > 1:
            raise DataError(f"the study varies in {str(name)!r} too: keep one of its values, or group by it")


def _undetermined(found: Superposition) -> str:
    """Return a sentence about undetermined shifts between neighbouring curves; empty if all shifts are determined."""
    if not found.undetermined:
        return ""
    runs = ", ".join(f"between {low:.6g} and {high:.6g}" for low, high in found.undetermined)
    return f"not determined {runs}: curves there do not overlap, or fit equally well at any shift, as on a plateau"


def _inside(groups: FloatArray, reference: float) -> float:
    """Return the reference, or the nearest group if the reference lies just outside the groups.

    Because measured values scatter, the reference may lie outside the groups by up to a tenth of the mean step between
    groups. Raise DataError if it lies farther outside.
    """
    margin = 0.1 * np.ptp(groups) / max(groups.size - 1, 1)
    if not groups.min() - margin <= reference <= groups.max() + margin:
        raise DataError(f"expected a reference between {groups.min():.9g} and {groups.max():.9g}, got {reference:.9g}")
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
    return xr.Dataset(found, {by: (by, result.groups, {"units": units.get(by, "")})}, attrs)


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
        raise DataError("expected a series that has roughness and varies normal_force and velocity, got none")
    friction = rough[0]
    for smooth in (mean for height, mean in means if height == 0):
        if all(np.array_equal(smooth[name], friction[name]) for name in wanted):
            friction = (friction - smooth.reset_coords(drop=True)).assign_attrs(friction.attrs)
    return friction.to_dataset(name="friction_coefficient")


def _of_store(series: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return the shift factors and the constants of the laws, without the merged curve."""
    curve = master_curve(friction_of_roughness(series))
    return curve.drop_dims(["point", "curve"])


FITS = (
    Fit(
        "master_curve",
        ("sliding_friction",),
        "mu(F_N, v) = Q(log F_N + shift(v)), shift = exponent log v (thesis 3.44-3.46)",
        _of_store,
        apart=False,
    ),
)
