"""Figures of the laws of the kinetics of friction (thesis Figs. 4.4-4.7)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError, FitError
from mdr_dask.fits.kinetic_cases import is_jump
from mdr_dask.plots import curves, drawing, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BEFORE = r"$\mu_1$ / rms slope"
JUMP = r"$\Delta\mu_0\,v_1/\Delta v$ / rms slope"
INTERVALS = "bars: 95 % intervals"
HELD = ("hurst", "normal_force", "velocity", "velocity_change", "shear_modulus", "relaxation_time", "rms_roughness")


def _fitted(groups: Mapping[str, xr.Dataset], name: str) -> dict[str, xr.Dataset]:
    from mdr_dask.fits import available

    fit = available("velocity_jump")[name]
    return curves.results(fit.compute, groups)


def _constants(found: xr.Dataset, name: str) -> drawing.Mean:
    return drawing.Mean(found[name], found[f"{name}_low"], found[f"{name}_high"])


def jumps(groups: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Return the series whose velocity jumps at once: the laws of a jump say nothing of other histories.

    Raises
    ------
    DataError
        If there is none.
    """
    found = {name: data for name, data in groups.items() if is_jump(data)}
    if not found:
        raise DataError("expected a series with a jump of the velocity, got other histories: see the figure protocols")
    return found


def _choose(groups: Mapping[str, xr.Dataset], *varied: str) -> tuple[dict[str, xr.Dataset], list[str]]:
    """Return the series that varies along most of some parameters, those with most values, and which are left out."""
    groups = jumps(groups)

    def rank(data: xr.Dataset) -> list[int]:
        sizes = [data[name].size if name in data.coords else 1 for name in varied]
        return [sum(size > 1 for size in sizes), *sizes]

    best = max(groups, key=lambda name: rank(groups[name]))
    rest = [name for name in groups if name != best]
    return {best: groups[best]}, [f"series {', '.join(rest)}"] if rest else []


def _title(figure: Figure, subject: str, held: Mapping[str, xr.DataArray], name: str, *fits: xr.Dataset) -> None:
    text = subject + (f", series {name}" if name else "")
    bars = "; ".join(part for part in (INTERVALS, curves.verdict(fits)) if part)
    style.title(figure, text, curves.fixed_text(held, HELD), bars)


def draw_jump(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw mu_1 and d_mu_0 v_1 / dv against the velocity for every load, with eq. 4.11 (Fig. 4.4)."""
    from mdr_dask.fits.jumps import LAW, jump_law

    series, told = _choose(groups, "velocity", "normal_force")
    ((name, found),) = _fitted(series, "kinetics").items()
    figure, panels = drawing.panels(2, sharey=True)
    names = "before_over_slope", "jump_over_slope"
    family = curves.family(found, names[0], "velocity", ("normal_force", "hurst"))
    for axes, output, label in zip(panels, names, (BEFORE, JUMP), strict=True):
        for curve in family.curves:
            speed = style.shown("velocity", curve.data["velocity"])
            drawing.curve(axes, curve, speed, _constants(curve.data, output), bars=True)
            if output == names[1] and family.joined:
                law = jump_law(np.asarray(curve.data[names[0]].values), LAW)
                drawing.law(axes, speed, law, ":", name="eq. 4.11", of=curve.data, color=curve.colour, lw=1)
        axes.set(xlabel=style.label("velocity", found["velocity"]), ylabel=label)
    panels[1].plot([], [], "k:", lw=1, label=f"eq. 4.11 with {LAW}, from $\\mu_1$ on the left")
    for axes in panels:
        style.logarithmic(axes, "xy")
    curves.finish(figure, panels[1], family)
    _title(figure, "friction before the jump, and the jump", family.held, name)
    style.leave_out(figure, [*family.left_out, *told])
    return figure


class _Cases(NamedTuple):
    """The cases of a series with one Hurst exponent."""

    hurst: float
    colour: Any
    data: xr.Dataset

    def column(self, name: str) -> FloatArray:
        """Return one number for every case."""
        return np.ravel(np.asarray(self.data[name].values, dtype=np.float64))

    def constant(self, name: str, where: Any = True) -> drawing.Mean:
        """Return one constant with its interval, NaN but for some of the cases."""
        return drawing.Mean(*(self.data[f"{name}{end}"].where(where) for end in ("", "_low", "_high")))


def by_hurst(found: xr.Dataset) -> Iterator[_Cases]:
    """Yield the cases of every Hurst exponent: of an axis, of a sampled design in up to seven classes, or of all."""
    if "hurst" not in found.coords:
        raise DataError("expected a Hurst exponent in the store")
    hurst = np.atleast_1d(found["hurst"].values)
    how, norm = style.shades(hurst)
    for k, value in enumerate(np.unique(hurst)):
        colour = how(norm(float(value))) if np.unique(hurst).size > style.most_colours() else style.colour(k)
        where = found.isel({found["hurst"].dims[0]: np.flatnonzero(hurst == value)}) if found["hurst"].ndim else found
        yield _Cases(float(value), colour, where)


def _name_hursts(figure: Figure, axes: Axes, found: xr.Dataset) -> None:
    """Draw the colour bar of many Hurst exponents, and the legend of the rest."""
    values = np.unique(np.atleast_1d(found["hurst"].values))
    many = values.size > style.most_colours()
    bar = ("hurst", xr.DataArray(values)) if many else None
    curves.finish(figure, axes, curves.NO_FAMILY._replace(bar=bar))


def _hurst_label(found: xr.Dataset, cases: _Cases) -> str | None:
    few = np.unique(np.atleast_1d(found["hurst"].values)).size <= style.most_colours()
    return f"H = {cases.hurst:.3g}" if few else None


def draw_jump_law(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw d_mu_0 v_1 / dv against mu_1, both over the rms slope, with eq. 4.11 (Fig. 4.5)."""
    from mdr_dask.fits.jumps import LAW, jump_law

    series, told = _choose(groups, "velocity", "hurst")
    ((name, found),) = _fitted(series, "kinetics").items()
    ((_, law),) = _fitted(series, "jump_law").items()
    fitted, low, high = (float(law[f"constant{end}"][-1]) for end in ("", "_low", "_high"))
    figure, (axes,) = drawing.panels(1)
    x, y = "before_over_slope", "jump_over_slope"
    for cases in by_hurst(found):
        across = cases.constant(x)
        label = _hurst_label(found, cases)
        drawing.points(axes, across.value, cases.constant(y), cases.colour, ".", label, across)
    known = np.ravel(found[x].values)
    fine = np.geomspace(known[known > 0].min(), np.nanmax(known), 200)
    drawing.law(axes, fine, jump_law(fine, LAW), "k-", lw=1, label=f"eq. 4.11, {LAW}")
    label = f"fitted {fitted:.3f} ({low:.3f}, {high:.3f})"
    drawing.law(axes, fine, jump_law(fine, fitted), "--", color=style.colour(style.FITTED), lw=1.2, label=label)
    drawing.band(
        axes, fine, jump_law(fine, low), jump_law(fine, high), "fitted, 95 %", color=style.colour(style.FITTED)
    )
    drawing.law(axes, fine, fine, "k:", lw=0.8, label="eq. 4.9")
    axes.set(xlabel=BEFORE, ylabel=JUMP)
    jumps = np.ravel(found[y].values)
    axes.set_ylim(jumps[jumps > 0].min() / 2, 3 * np.nanmax(jumps))
    style.logarithmic(axes, "xy")
    _name_hursts(figure, axes, found)
    _title(figure, "the jump against friction before it", curves.scalars(found), name, law)
    style.leave_out(figure, told)
    return figure


def draw_rate(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw b against v_1 tau q_max for every Hurst exponent, with the powers fitted (Fig. 4.6)."""
    from mdr_dask.fits.kinetics import well_known

    series, told = _choose(groups, "velocity", "hurst")
    ((name, found),) = _fitted(series, "relaxation").items()
    powers = _powers(series)
    if not well_known(np.ravel(found["rate_low"].values), np.ravel(found["rate_high"].values)).any():
        raise DataError(
            "expected a rate of relaxation known to a factor of 1.6, got none: more realisations are needed"
        )
    figure, (axes,) = drawing.panels(1)
    left = 0
    for cases in by_hurst(found):
        good = well_known(cases.column("rate_low"), cases.column("rate_high"))
        left += int(np.count_nonzero(~good))
        x = cases.column("passing_number")
        label = _hurst_label(found, cases)
        rates = cases.constant("rate", good.reshape(cases.data["rate"].shape))
        drawing.points(axes, x, rates, cases.colour, ".", label)
        _draw_powers(axes, powers, cases, x[good])
        whole = np.sort(x)
        law = np.where(whole < 1, whole, whole ** (1 - cases.hurst))
        drawing.law(axes, whole, law, ":", name="eq. 4.12", of=cases.data, color=cases.colour, lw=0.8)
    if powers is not None:
        axes.plot([], [], "k-", lw=1, label="power fitted")
    axes.plot([], [], "k:", lw=0.8, label="eq. 4.12")
    axes.axvline(1, color="0.7", lw=0.8)
    axes.set(xlabel=r"$v_1 \tau q_{max}$", ylabel="rate of relaxation $b$")
    style.logarithmic(axes, "xy")
    _name_hursts(figure, axes, found)
    _title(figure, "rate of relaxation, one exponential", curves.scalars(found), name, found)
    unknown = f"{left} rates not known to a factor of 1.6" if left else ""
    style.leave_out(figure, [unknown, *told])
    return figure


def _powers(series: Mapping[str, xr.Dataset]) -> xr.Dataset | None:
    """Return the powers of the rate, or None where too few rates are known for them."""
    try:
        ((_, powers),) = _fitted(series, "rate_power").items()
    except FitError:
        return None
    return powers if "hurst" in powers.coords else None


def _draw_powers(axes: Axes, powers: xr.Dataset | None, cases: _Cases, x: FloatArray) -> None:
    """Draw the powers fitted to the rates of one Hurst exponent, one line for each value of the other axes."""
    if powers is None:
        return
    for row in by_hurst(powers):
        if row.hurst != cases.hurst:
            continue
        for regime, below in (("below", True), ("above", False)):
            part = row.data.sel(regime=regime)
            inside = x[(x < 1) == below]
            for power, factor in zip(np.ravel(part["power"].values), np.ravel(part["factor"].values), strict=True):
                if np.isfinite(power) and inside.size:
                    line = np.array([inside.min(), inside.max()])
                    drawing.law(axes, line, factor * line**power, name="power fitted", color=cases.colour, lw=1)


def draw_power(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the power of b against the Hurst exponent (Fig. 4.7)."""
    series, told = _choose(groups, "velocity", "hurst")
    ((name, found),) = _fitted(series, "rate_power").items()
    if "hurst" not in found.coords:
        raise DataError("expected one Hurst exponent or an axis of them: each has a power of its own")
    figure, (axes,) = drawing.panels(1)
    rows = (
        ("above", "power", r"$v_1\tau q_{max} > 1$"),
        ("below", "power", r"$v_1\tau q_{max} < 1$"),
    )
    for number, (regime, power, label) in enumerate(rows):
        for cases in by_hurst(found.sel(regime=regime)):
            value = cases.constant(power)
            across = np.full(value.value.size, cases.hurst)
            drawing.points(axes, across, value, style.colour(number), style.MARKERS[number], None)
        axes.plot([], [], style.MARKERS[number], color=style.colour(number), ms=4, label=label)
    line = np.array([0.0, 1.0])
    drawing.law(axes, line, 1 - line, "k-", lw=1, label="1 - H")
    drawing.law(axes, line, [1, 1], "k:", lw=1, label="1")
    axes.set(xlabel=style.label("hurst"), ylabel="power of $b$")
    style.legend(axes)
    _title(figure, r"power of the rate of relaxation over $v_1 \tau q_{max}$", curves.scalars(found), name, found)
    style.leave_out(figure, told)
    return figure
