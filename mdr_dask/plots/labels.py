"""Texts for quantities in figures: symbols, units, labels of axes, and single values."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import models
from mdr_dask.campaign.written import written_units
from mdr_dask.errors import DataError, with_digits
from mdr_dask.plots import page
from mdr_dask.units import PREFIXES, conversion

#: Labels of the parameters of this package that have a symbol. The label of any other parameter is its name.
SYMBOLS: Mapping[str, str] = {
    "normal_force": "normal force $F_N$",
    "line_load": "line load $w$",
    "velocity": "velocity $v$",
    "velocity_change": r"velocity change $\Delta v/v_1$",
    "mean_velocity": "mean velocity $u$",
    "shear_modulus": "shear modulus $G$",
    "contact_modulus": "contact modulus $E^*$",
    "relaxation_time": r"relaxation time $\tau$",
    "hurst": "Hurst exponent $H$",
    "rms_roughness": "rms height $h$",
    "length": "length $L$",
    "pressure_viscosity": r"pressure-viscosity coefficient $\alpha$",
    "layer_thickness": "layer thickness $h_c$",
    "layer_shear_strength": r"layer strength $\tau_0$",
    "load_parameter": "load parameter $W$",
    "speed_parameter": "speed parameter $U$",
    "material_parameter": "material parameter $G$",
    "inlet": "inlet $x_{in}/a$",
    "viscosity": r"viscosity $\eta_0$",
    "radius": "radius $R$",
    "stick_radius": "stick radius $c/a_0$",
    "amplitude": "amplitude $U_0$",
    "depth": "depth $d_0$",
    "xi": r"$\xi$",
}
#: Units that are shown instead of an SI unit if the campaign states no unit.
USUAL = {"rad/s": "rpm", "rad": "deg"}
#: Units that may have a prefix.
_PREFIXED = re.compile(r"(m|Pa|N|s|W|ohm)(?:\^([23]))?")
#: Patterns of symbols in the long names of outputs, and the mathtext that replaces them.
_MATHTEXT = {r"\bd_mu_(\w+)": r"$\\Delta\\mu_{\1}$", r"\bmu_(\w+)": r"$\\mu_{\1}$", r"\b([A-Za-z])_(\w+)": r"$\1_{\2}$"}


class Quantity(NamedTuple):
    """The symbol and the shown unit of a quantity: shown value = SI value * `factor` + `offset`."""

    symbol: str
    unit: str
    factor: float = 1.0
    offset: float = 0.0

    def of(self, values: Any) -> Any:
        """Convert values from SI to the shown unit."""
        return values * self.factor + self.offset


def chosen_units(groups: Mapping[str, xr.Dataset]) -> dict[str, str]:
    """Return the units in which figures show the quantities of some series.

    If all campaign files use the same unit for a quantity, figures show this unit. Otherwise temperatures are in
    degrees Celsius, rotation speeds in rpm, angles in degrees, and other quantities in SI units. A unit such as m
    or Pa gets a prefix that brings the largest value between 1 and 1000 (for m^2, between 1 and 10^6).
    """
    written = [written_units(str(data.attrs.get("campaign", ""))) for data in groups.values()]
    found: dict[str, str] = {}
    for name in dict.fromkeys(str(name) for data in groups.values() for name in data.variables):
        arrays = [data[name] for data in groups.values() if name in data.variables]
        units = {str(array.attrs.get("units", "1")) for array in arrays}
        own = {units_of.get(name) for units_of in written}
        if len(own) == 1 and None not in own:
            found[name] = str(own.pop())
        elif len(units) == 1:
            found[name] = _readable(name, units.pop(), arrays)
    return found


def symbols(groups: Mapping[str, xr.Dataset]) -> dict[str, str]:
    """Return the labels of coordinates of the given series. Any other coordinate is labelled with its name."""
    found = dict(SYMBOLS) if all(data.attrs.get("model") in models.NAMES for data in groups.values()) else {}
    for data in groups.values():
        own = set(data.dims) - set(data["status"].dims) if "status" in data else set()
        found |= {str(name): meaning(data[name], str(name)) for name in own}
    return found


def _readable(name: str, unit: str, arrays: list[xr.DataArray]) -> str:
    if unit == "K" and name.endswith("temperature"):
        return "degC"
    match = _PREFIXED.fullmatch(unit)
    if match is None:
        return USUAL.get(unit, unit)
    if any(array.dtype.kind not in "fiu" for array in arrays):
        return unit
    largest = max((float(abs(array).where(np.isfinite(array)).max()) for array in arrays if array.size), default=np.nan)
    if not (np.isfinite(largest) and largest > 0):
        return unit
    step = 3 * int(np.floor(np.log10(largest) / (3 * int(match[2] or 1)) + 1e-9))
    return f"{PREFIXES.get(step, '')}{unit}"


def quantity(name: str, values: xr.DataArray) -> Quantity:
    """Return the symbol and the shown unit of a parameter or an output.

    DataError is raised if values cannot be converted to the requested unit.
    """
    unit = str(values.attrs.get("units", "1"))
    is_coordinate = name in values.coords
    symbol = page.current().symbols.get(name, name.replace("_", " ")) if is_coordinate else meaning(values, name)
    wanted = page.current().unit(name)
    if wanted is None or wanted == unit:
        return Quantity(symbol, "" if unit == "1" else unit)
    try:
        factor, zero = conversion(wanted, unit)
    except ValueError as error:
        raise DataError(f"{name}: {error}, got {wanted!r}") from None
    return Quantity(symbol, wanted, 1 / factor, -zero / factor)


def meaning(values: xr.DataArray, name: str) -> str:
    """Return the long name of an output, with mathtext for symbols, without a remark after ``;``, ``,`` or ``(``."""
    words = re.split(r"[;,] | \(", str(values.attrs.get("long_name", name.replace("_", " "))))[0]
    for ascii_form, symbol in _MATHTEXT.items() if "$" not in words else ():
        words = re.sub(ascii_form, symbol, words)
    return words


def converted(name: str, values: xr.DataArray) -> Any:
    """Return values in the unit of the figures; words remain unchanged."""
    if values.dtype.kind not in "fiu":
        return values.values
    return quantity(name, values).of(np.asarray(values.values, dtype=np.float64))


def label(name: str, values: xr.DataArray) -> str:
    """Return the label of an axis: ``normal force $F_N$ [N]``."""
    how = quantity(name, values)
    return with_unit(how.symbol, how.unit)


def with_unit(symbol: str, unit: str) -> str:
    """Return a label with its unit in square brackets."""
    return f"{symbol} [{printed_unit(unit)}]" if unit and unit != "1" else symbol


def printed_unit(unit: str) -> str:
    """Return a unit as figures show it: with raised powers, with µm for ``um``, and with °C for ``degC``."""
    unit = re.sub(r"\bu(?=(m|s|N|Pa|W|rad)\b)", "µ", unit)
    unit = re.sub(r"\bpercent\b", "%", re.sub(r"\bdeg(?=C?\b)", "°", unit))
    return re.sub(r"\^(-?[\d./]+)", r"$^{\1}$", unit)


def named(name: str, value: xr.DataArray) -> str:
    """Return one value as text for legends and titles: ``$F_N$ = 1.5 N``."""
    how, number = quantity(name, value), converted(name, value)
    text = with_digits(float(number), 4) if value.dtype.kind in "fiu" else str(number[()])
    symbol = how.symbol[how.symbol.index("$") :] if "$" in how.symbol else how.symbol
    return f"{symbol} = {text} {printed_unit(how.unit)}".strip()


def plain(text: str) -> str:
    """Return a label without mathtext, in one line: ``F_N = 1 N``."""
    return re.sub(r"[$\\]", "", text.replace("\\,", " ")).replace("#", "no. ").replace("\n", " ").strip()
