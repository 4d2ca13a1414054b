"""How figures look: sizes, colours, quantities with their units, titles, ticks, and what a figure leaves out."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.plots import page
from mdr_dask.units import conversion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.colors import Colormap, Normalize
    from matplotlib.figure import Figure

#: Okabe and Ito's colours, told apart by colour-blind readers; more curves than these have a colour bar.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: Which of them fitted laws have, and the bands that they are known within.
FITTED = 1
LINES = ("-", "--", ":", "-.")
MARKERS = ("o", "s", "^", "D")
#: Panels of one figure that can still be read.
MOST_PANELS = 6
#: Most of the height of a figure that its title takes before it is printed smaller.
TITLE_SHARE = 0.2
#: Characters to an inch in letters of one point.
SMALL_PRINT = 120
#: What everything drawn carries as its gid: data and their bars, laws, and guides, which stand in no table.
DATA, BAND, LAW, GUIDE = "data", "band", "law", "guide"


class Quantity(NamedTuple):
    """How a parameter is written: its symbol, the unit shown, and the way there from SI."""

    symbol: str
    unit: str
    factor: float = 1.0
    offset: float = 0.0

    def of(self, values: Any) -> Any:
        """Return values in SI in the unit shown."""
        return values * self.factor + self.offset


#: Parameters by name; a store whose unit is 1 (a dimensionless campaign) keeps the symbol alone.
QUANTITIES: Mapping[str, Quantity] = {
    "normal_force": Quantity("normal force $F_N$", "N"),
    "line_load": Quantity("line load $w$", "N/m"),
    "velocity": Quantity("velocity $v$", "m/s"),
    "velocity_change": Quantity(r"velocity change $\Delta v/v_1$", ""),
    "mean_velocity": Quantity("mean velocity $u$", "m/s"),
    "rotation_speed": Quantity("rotation speed", "rpm", 30 / np.pi),
    "temperature": Quantity("temperature", "°C", 1.0, -273.15),
    "shear_modulus": Quantity("shear modulus $G$", "MPa", 1e-6),
    "contact_modulus": Quantity("contact modulus $E^*$", "GPa", 1e-9),
    "relaxation_time": Quantity(r"relaxation time $\tau$", "ms", 1e3),
    "hurst": Quantity("Hurst exponent $H$", ""),
    "rms_roughness": Quantity("rms height $h$", "µm", 1e6),
    "length": Quantity("length $L$", "mm", 1e3),
    "longest_wavelength": Quantity("longest wavelength", "mm", 1e3),
    "shortest_wavelength": Quantity("shortest wavelength", "µm", 1e6),
    "points": Quantity("points", ""),
    "slide_roll_ratio": Quantity("slide-roll ratio", ""),
    "pressure_viscosity": Quantity(r"pressure-viscosity coefficient $\alpha$", "1/GPa", 1e9),
    "layer_thickness": Quantity("layer thickness $h_c$", "nm", 1e9),
    "layer_shear_strength": Quantity(r"layer strength $\tau_0$", "MPa", 1e-6),
    "load_parameter": Quantity("load parameter $W$", ""),
    "speed_parameter": Quantity("speed parameter $U$", ""),
    "material_parameter": Quantity("material parameter $G$", ""),
    "inlet": Quantity("inlet $x_{in}/a$", ""),
    "viscosity": Quantity(r"viscosity $\eta_0$", "Pa s"),
    "radius": Quantity("radius $R$", "mm", 1e3),
    "roller_radius": Quantity("roller radius", "mm", 1e3),
    "stick_radius": Quantity("stick radius $c/a_0$", ""),
    "cycles": Quantity("cycles", ""),
    "pressure": Quantity("pressure $p$", "GPa", 1e-9),
    "wear_volume": Quantity("worn volume $V$", "m^3"),
    "amplitude": Quantity("amplitude $U_0$", "µm", 1e6),
    "depth": Quantity("depth $d_0$", "µm", 1e6),
    "path": Quantity("sliding path", "m"),
    "friction": Quantity("coefficient of friction", ""),
    "xi": Quantity(r"$\xi$", ""),
    "eyring_stress": Quantity("Eyring stress", "MPa", 1e-6),
    "hardness": Quantity("hardness", "GPa", 1e-9),
    "roller_width": Quantity("roller width", "mm", 1e3),
    "relaxation_times": Quantity(r"$(t - t_0)/\tau$", ""),
    "indenter_angle": Quantity("angle", "°", 180 / np.pi),
    "indenter_radius": Quantity("radius $R$", "mm", 1e3),
}


#: Symbols in the long names of outputs, and how they are written.
SYMBOLS = {
    r"\bd_mu_(\w+)": r"$\\Delta\\mu_{\1}$",
    r"\bmu_(\w+)": r"$\\mu_{\1}$",
    r"\b([A-Za-z])_(\w+)": r"$\1_{\2}$",
}


def quantity(name: str, values: xr.DataArray | None = None) -> Quantity:
    """Return how a parameter or an output is written; one without a unit in its store is a pure number.

    Raises
    ------
    DataError
        If it cannot have the unit that was asked for.
    """
    unit = None if values is None else values.attrs.get("units")
    words = name.replace("_", " ") if values is None or name in values.coords else meaning(values, name)
    known = QUANTITIES.get(name, Quantity(words, "" if unit in (None, "1") else str(unit)))
    wanted = None if values is None else page.asked().unit(name)
    if wanted is None:
        return Quantity(known.symbol, "") if unit == "1" else known
    try:
        factor, zero = conversion(wanted, str(unit))
    except ValueError as error:
        raise DataError(f"{name}: {error}, got {wanted!r}") from None
    return Quantity(known.symbol, wanted, 1 / factor, -zero / factor)


def meaning(values: xr.DataArray, name: str) -> str:
    """Return the long name of an output without what stands behind it in brackets, symbols as mathtext."""
    words = re.split(r"[;,] | \(", str(values.attrs.get("long_name", name.replace("_", " "))))[0]
    for ascii_form, symbol in SYMBOLS.items():
        words = re.sub(ascii_form, symbol, words)
    return words


def shown(name: str, values: xr.DataArray) -> Any:
    """Return the values of a parameter in the unit that figures show."""
    if values.dtype.kind not in "fiu":
        return values.values
    return quantity(name, values).of(np.asarray(values.values, dtype=np.float64))


def label(name: str, values: xr.DataArray | None = None) -> str:
    """Return the label of an axis: ``normal force $F_N$ [N]``."""
    how = quantity(name, values)
    return with_unit(how.symbol, how.unit)


def with_unit(symbol: str, unit: str) -> str:
    """Return a label with its unit as all figures write it."""
    return f"{symbol} [{_raised(unit)}]" if unit and unit != "1" else symbol


def _raised(unit: str) -> str:
    """Return a unit as it is printed: powers raised, ``um`` as µm, ``degC`` as °C."""
    unit = re.sub(r"\bu(?=(m|s|N|Pa|W|rad)\b)", "µ", unit)
    unit = re.sub(r"\bpercent\b", "%", re.sub(r"\bdeg(?=C?\b)", "°", unit))
    return re.sub(r"\^(-?\d+)", r"$^{\1}$", unit)


def named(name: str, value: xr.DataArray) -> str:
    """Return one value as legends and titles write it: ``$F_N$ = 1.5 N``."""
    how, number = quantity(name, value), shown(name, value)
    text = f"{float(number):.4g}" if value.dtype.kind in "fiu" else str(number[()])
    symbol = how.symbol[how.symbol.index("$") :] if "$" in how.symbol else how.symbol
    return f"{symbol} = {text} {_raised(how.unit)}".strip()


def plain(text: str) -> str:
    """Return a label without mathtext, in one line: ``F_N = 1 N``."""
    return re.sub(r"[$\\]", "", text.replace("\\,", " ")).replace("#", "no. ").replace("\n", " ").strip()


def title(figure: Figure, subject: str, *fixed: str) -> None:
    """Write the subject of a figure over it, what is held fixed and what bars mean; in smaller print the more it is."""
    from matplotlib import rcParams
    from matplotlib.font_manager import font_scalings

    for size in ("medium", "small", "x-small"):
        lines = [line for text in (subject, *fixed) if text for line in _wrapped(figure, text, font_scalings[size])]
        height = 1.2 / 72 * float(rcParams["font.size"]) * font_scalings[size] * len(lines)
        if height <= TITLE_SHARE * figure.get_figheight():
            break
    figure.suptitle("\n".join(lines), fontsize=size)


def leave_out(figure: Figure, sentences: Iterable[str]) -> None:
    """Write under a figure what it leaves out."""
    told = [sentence for sentence in dict.fromkeys(sentences) if sentence]
    before = left_out(figure)
    text = "; ".join([*([before] if before else []), *told])
    if text:
        figure.supxlabel("\n".join(_wrapped(figure, f"not drawn: {text}")), fontsize="small", color="0.3")


def left_out(figure: Figure) -> str:
    """Return what a figure says that it leaves out."""
    return figure.get_supxlabel().replace("\n", " ").removeprefix("not drawn: ")


def _letters() -> float:
    """Return how many letters go to an inch."""
    from matplotlib import rcParams

    return SMALL_PRINT / float(rcParams["font.size"])


def _wrapped(figure: Figure, text: str, size: float = 1.0) -> list[str]:
    """Return lines as wide as a figure, counted as they are seen; a value stays with its symbol and its unit."""
    most = max(30, int(_letters() / size * figure.get_figwidth()))
    joined = re.sub(r" = (\S+) (?=[^\s,;]+(?:[,;)]|$))", "\u00a0=\u00a0\\1\u00a0", text).replace(" = ", "\u00a0=\u00a0")
    return [line.replace("\u00a0", " ") for line in broken(joined, most).split("\n")]


def broken(label: str, most: int = 40) -> str:
    """Return a label in lines that fit beside a panel."""
    lines = [""]
    for word in label.split(" "):
        line = f"{lines[-1]} {word}".strip(" ")
        lines[-1:] = [line] if len(plain(line)) <= most or not lines[-1] else [lines[-1], word]
    return "\n".join(lines)


def beside(figure: Figure, axes: Axes, label: str) -> str:
    """Return a label in lines as long as a panel is high."""
    place = axes.get_subplotspec()
    rows = place.get_gridspec().nrows if place else 1
    return broken(label, max(16, int(0.9 * _letters() * figure.get_figheight() / rows)))


def _cycle(key: str) -> tuple[str, ...]:
    """Return what the style asked for says of one curve after the other: its ``color``, ``linestyle`` or ``marker``."""
    return tuple(each[key] for each in page.asked().cycle if key in each)


def most_colours() -> int:
    """Return how many curves colours tell apart."""
    return len(_cycle("color") or COLOURS)


def colour(number: int) -> str:
    """Return the colour of a curve: of the style asked for, else of those that all readers tell apart."""
    colours = _cycle("color") or COLOURS
    return colours[number % len(colours)]


def scale(count: int) -> list[str]:
    """Return so many colours for curves that a legend names."""
    return [colour(k) for k in range(count)]


def line_and_marker(number: int) -> tuple[str, str]:
    """Return line and marker of a curve that its colour tells apart, but for a style in greys, or with others."""
    from matplotlib.colors import to_rgb

    greys = all(len(set(to_rgb(each))) == 1 for each in _cycle("color") or COLOURS)
    lines = _cycle("linestyle") or (LINES if greys else LINES[:1])
    markers = _cycle("marker") or (MARKERS if greys else MARKERS[:1])
    return lines[number % len(lines)], markers[(number + number // len(lines)) % len(markers)]


def shades(values: Any, logarithmic: bool = True) -> tuple[Colormap, Normalize]:
    """Return colour map and norm of a colour bar: logarithmic, unless forbidden, where the values are geometric."""
    from matplotlib import colormaps, rcParams
    from matplotlib.colors import LogNorm, Normalize

    values = np.asarray(values, dtype=np.float64)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    norm = (LogNorm if logarithmic and is_geometric(values) else Normalize)(low, high if high > low else low + 1)
    return colormaps[rcParams["image.cmap"]].resampled(256), norm


def is_geometric(values: Any) -> bool:
    """Return whether numbers belong on a logarithmic axis: positive, and spread over more than a factor of ten."""
    values = np.asarray(values, dtype=np.float64)
    values = values[np.isfinite(values)]
    return bool(values.size and values.min() > 0 and values.max() > 10 * values.min())


def logarithmic(axes: Axes, which: str) -> None:
    """Give the axes of a panel that are named, ``x``, ``y`` or ``xy``, a logarithmic scale whose labels do not collide.

    Called when the data are drawn: the ticks go by the limits then.
    """
    from matplotlib.ticker import LogLocator, NullFormatter

    for name in which:
        getattr(axes, f"set_{name}scale")("log")
        axis: Axis = getattr(axes, f"{name}axis")
        low, high = sorted(np.abs(axis.get_view_interval()))
        if low > 0 and high < 100 * low:
            _plain_ticks(axis, low, high)
        else:
            axis.set_major_locator(LogLocator(numticks=10))
            axis.set_minor_formatter(NullFormatter())


def _plain_ticks(axis: Axis, low: float, high: float) -> None:
    """Put ticks at 1, 2 and 5 times the powers of ten, with plain numbers, on an axis of less than two decades."""
    from matplotlib.ticker import FixedLocator, MaxNLocator, NullFormatter

    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    ticks = np.sort(np.ravel(decades[:, None] * np.array([1, 2, 5])))
    ticks = ticks[(ticks >= low) & (ticks <= high)]
    if ticks.size < 2:
        ticks = np.array(MaxNLocator(4).tick_values(low, high))
        ticks = ticks[(ticks >= low) & (ticks <= high)]
    axis.set_major_locator(FixedLocator(ticks.tolist()))
    axis.set_major_formatter(lambda value, _: f"{value:.4g}")
    axis.set_minor_formatter(NullFormatter())


def legend(axes: Axes, heading: str = "") -> None:
    """Draw the legend of a panel where it has anything to name, outside where it is long."""
    handles, _ = axes.get_legend_handles_labels()
    if not handles:
        return
    long = len(handles) > 9
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)} if long else {"loc": "best"}
    axes.legend(title=heading or None, fontsize="x-small", title_fontsize="x-small", framealpha=0.7, **place)


def legend_below(*axes_of: Axes) -> None:
    """Draw one legend for all axes of a panel under it, where curves leave no room."""
    found = [axes.get_legend_handles_labels() for axes in axes_of]
    handles = [each for one, _ in found for each in one]
    labels = [each for _, one in found for each in one]
    if handles:
        place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.16)}
        axes_of[-1].legend(handles, labels, ncols=min(3, len(handles)), fontsize="x-small", **place)
