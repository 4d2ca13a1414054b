"""Fit the law of friction for rough indenters (thesis eqs. 3.34 to 3.40).

The law is mu / (sqrt 2 s) = (1 + xi^-n)^(-1/n) with n = 1.5 and the rms slope s of the roughness. The argument is xi =
mu_low / (sqrt 2 s), where mu_low is the friction at low velocities by eqs. 3.34 and 3.38.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import SMALL, Fit, require, short
from mdr_dask.fits.cases import Variables, constant, each, holds, measure, nonlinear, one_value, table_of
from mdr_dask.fits.friction import FRICTION, KELVIN, MODELS, spectral_slope
from mdr_dask.physics.sliding import laws
from mdr_dask.physics.surfaces.shapes import PowerLaw


def _body(data: xr.Dataset) -> tuple[Any, float]:
    """Return c and k of the profile c |x|^k by which the method of dimensionality reduction replaces the indenter."""
    if "indenter_angle" in data.coords:
        return PowerLaw.of_body(1.0, 1.0).coefficient * np.tan(data["indenter_angle"]), 1.0
    if "indenter_radius" in data.coords:
        return 1 / data["indenter_radius"], 2.0
    if "indenter_coefficient" in data.coords and data["indenter_exponent"].ndim == 0:
        exponent = one_value(data, "indenter_exponent")
        return PowerLaw.of_body(1.0, exponent).coefficient * data["indenter_coefficient"], exponent
    raise FitError("expected a store with an indenter: cone, parabola, or power with one exponent")


def _half_width(data: xr.Dataset) -> Any:
    """Return the half width a of the contact of a smooth indenter at rest, in m.

    By section 3.3.2 of the thesis, F_N / (4 G) is 2 k c a^(k+1) / (k + 1), with c and k of `_body`.
    """
    coefficient, exponent = _body(data)
    load = data["normal_force"] / (4 * data["shear_modulus"])
    return ((exponent + 1) * load / (2 * exponent * coefficient)) ** (1 / (exponent + 1))


def indenter_xi(data: xr.Dataset, slope: xr.DataArray) -> xr.DataArray:
    """Return the argument xi of the law of rough indenters."""
    require(data, *KELVIN)
    low = laws.indenter_low(
        _half_width(data),
        data["velocity"],
        data["relaxation_time"],
        data["shear_modulus"],
        data["normal_force"],
        slope,
    )
    return xr.DataArray(low / (np.sqrt(2) * slope))


def within_indenter_law(data: xr.Dataset, slope: xr.DataArray) -> xr.DataArray:
    """Return whether the law of rough indenters applies to each case.

    The law neglects the slope of the indenter. The rms slope of the indenter in the contact must therefore be at most
    `SMALL` times the rms slope `slope` of the roughness. The indenter must be pressed in by at least the rms height. If
    the velocity is an axis, it must not exceed the velocity at which friction is largest.
    """
    coefficient, exponent = _body(data)
    width = _half_width(data)
    flat = coefficient * exponent * width ** (exponent - 1) / np.sqrt(2 * exponent - 1) <= SMALL * slope
    deep = coefficient * width**exponent >= data["rms_roughness"]
    within = flat & deep
    if "velocity" in data[FRICTION].dims:
        mean = data[FRICTION].mean("realisation").fillna(0.0)
        within = within & (data["velocity"] <= mean.idxmax("velocity"))
    return xr.DataArray(within)


def _indenter(data: xr.Dataset) -> Variables:
    """Fit the exponent of eq. 3.40.

    If the law applies to fewer than three cases, the exponent and the deviations from the law are NaN.
    """
    slope = spectral_slope(data)
    table = table_of(data, np.sqrt(2) * slope, indenter_xi(data, slope), within_indenter_law(data, slope))
    xi, within = table.columns
    known = (table.mean() > 0) & np.isfinite(xi) & (xi > 0)
    used = (within > 0) & known
    measured = measure("cases", int(used.sum()), "number of cases to which the law applies")
    if np.count_nonzero(used) < 3:
        errors = [f"{which}_error{suffix}" for suffix in ("", "_stated") for which in ("rms", "largest")]
        names = ["exponent", "exponent_low", "exponent_high", *errors]
        reason = (
            f"not tested: the law applies to {used.sum()} of {known.sum()} cases, three are needed; in the others, the"
            " indenter is steep compared with the roughness, is pressed in by less than the rms height, or slides"
            " faster than at the largest friction"
        )
        return {name: xr.Variable((), np.nan, {"units": "1"}) for name in names} | measured | holds(reason, reason)
    xi, count = xi[used], table.count(used)
    logs = table.logarithms(used)

    def model(constants: FloatArray) -> FloatArray:
        with np.errstate(invalid="ignore"):  # with only one realisation, all resampled rows are NaN
            law: FloatArray = np.log(laws.indenter(xi, np.exp(constants)))
        return law

    def where(k: int) -> str:
        return f"xi = {short(xi[k])}"

    found, verdicts = nonlinear(model, np.log([laws.INDENTER_EXPONENT]), logs, count, where)
    return {
        **constant("exponent", np.exp(found.constants[:, 0]), count, "exponent n of the law of rough indenters", True),
        **measured,
        **verdicts,
    }


def _indenter_axes(data: xr.Dataset) -> list[str]:
    return [str(dim) for dim in data[FRICTION].dims if dim not in ("realisation", "hurst")]


FITS: tuple[Fit, ...] = (
    Fit(
        "indenter",
        MODELS,
        "exponent n of mu / (sqrt 2 slope) = (1 + xi^-n)^(-1/n) for rough indenters (eq. 3.40)",
        lambda series: each(series, _indenter_axes, _indenter, FRICTION),
    ),
)
