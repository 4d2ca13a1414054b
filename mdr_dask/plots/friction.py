"""Figures of sliding friction: those of thesis chapter 3, redrawn from a store."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask.errors import DataError, FitError
from mdr_dask.fits import friction, indenter
from mdr_dask.fits.friction import numbers, spectral_slope
from mdr_dask.fits.indenter import indenter_xi, within_indenter_law
from mdr_dask.physics.sliding import laws
from mdr_dask.plots import curves, drawing, style
from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mdr_dask.fits.base import Fit

MODELS = ("sliding_friction",)
MU = "friction_coefficient"
#: What a title says of a case, where it is fixed.
CASE = (
    *("hurst", "normal_force", "velocity", "shear_modulus", "relaxation_time"),
    *("rms_roughness", "length", "points", "longest_wavelength", "indenter_angle", "indenter_radius"),
)
#: Axes that get the colours, the first that varies.
BY = ("normal_force", "hurst", "shear_modulus", "rms_roughness", "points")
LAW = "law (eq. 3.18)"
FIT: dict[str, Fit] = {fit.name: fit for fit in (*friction.FITS, *indenter.FITS)}


def on_generated_line(data: xr.Dataset) -> bool:
    """Return whether a series has a Kelvin body on a generated line, which the laws are written for."""
    needed = {"shear_modulus", "relaxation_time", "rms_roughness", "length", "hurst", "points"}
    return needed <= set(data.coords) and bool((data["rms_roughness"] > 0).all())


def is_plane(data: xr.Dataset) -> bool:
    """Return whether a series has a Kelvin body on a generated line under a plane body."""
    return on_generated_line(data) and not any(str(name).startswith("indenter_") for name in data.coords)


class _Shown(NamedTuple):
    """What stands on the axes: friction times what, the velocity in which form, and both labels."""

    factor: Any
    velocity: Any
    x: str
    y: str


def _in_units(data: xr.Dataset) -> _Shown:
    """Return friction against velocity: over the rms slope where that of the spectrum is known."""
    x, velocity = style.label("velocity", data["velocity"]), style.shown("velocity", data["velocity"])
    if on_generated_line(data):
        return _Shown(1 / spectral_slope(data), velocity, x, r"$\mu$ / rms slope")
    return _Shown(1.0, velocity, x, r"coefficient of friction $\mu$")


def _in_numbers(data: xr.Dataset) -> _Shown:
    """Return friction against velocity as the interpolation law has them, where it is meant to hold."""
    if not is_plane(data):
        return _in_units(data)
    _, _, number = numbers(data)
    factor = 1 / (np.sqrt(2) * spectral_slope(data))
    x = r"velocity number $v \tau \nabla z / (\sqrt{2} h)$"
    return _Shown(factor, number, x, r"$\mu$ / ($\sqrt{2}$ rms slope)")


def _mean_of(data: xr.Dataset, how: Callable[[xr.Dataset], _Shown]) -> tuple[Any, drawing.Mean]:
    """Return where the points of a curve lie and their means."""
    shown = how(data)
    return shown.velocity, curves.measured(data, MU, shown.factor)


def slim(data: xr.Dataset) -> xr.Dataset:
    """Return what figures of friction need, so that nothing else is read."""
    wanted = [name for name in (MU, f"{MU}_error", "rms_slope", "status") if name in data]
    return data[wanted]


def _against_velocity(
    groups: Mapping[str, xr.Dataset],
    subject: str,
    how: Callable[[xr.Dataset], _Shown],
    by: tuple[str, ...],
    scales: str,
    varied: tuple[str, ...] = (),
    law: bool = False,
) -> Figure:
    """Draw friction against velocity, one panel for each series."""
    found = {name: slim(data) for name, data in curves.with_outputs(groups, [MU], "velocity", *varied).items()}
    found, told = curves.few(found)
    figure, panels = drawing.panels(len(found))
    families = []
    for axes, (name, data) in zip(panels, found.items(), strict=True):
        one = curves.family(data, MU, "velocity", by)
        families.append(one)
        told += [f"{name}: {each}" if name else each for each in one.left_out]
        for curve in one.curves:
            drawing.curve(axes, curve, *_mean_of(curve.data, how))
            if law and one.joined and is_plane(curve.data):
                _draw_law(axes, curve)
        shown = how(one.curves[0].data)
        axes.set(xlabel=shown.x, ylabel=shown.y)
        style.logarithmic(axes, scales)
        if "y" not in scales:
            axes.set_ylim(bottom=0)
        if law and one.joined and is_plane(data):
            axes.plot([], [], "k-", lw=0.8, label=LAW)
        curves.finish(figure, axes, one)
    titles(figure, panels, list(found), families, subject, curves.meaning_of_bars(*found.values(), outputs=[MU]))
    style.leave_out(figure, told)
    return figure


def titles(
    figure: Figure, panels: list[Axes], names: list[str], families: list[curves.Family], subject: str, bars: str
) -> None:
    """Write what all panels hold fixed over the figure, and over each panel its series and what it alone holds."""
    alike = curves.fixed_by_all([each.held for each in families])
    style.title(figure, subject, curves.fixed_text(alike, CASE), bars)
    for axes, name, one in zip(panels, names, families, strict=True):
        own = {key: value for key, value in one.held.items() if key not in alike}
        text = ", ".join(part for part in (name, curves.fixed_text(own, CASE)) if part)
        if text:
            axes.set_title(text, fontsize="small", wrap=True)


def _draw_law(axes: Axes, curve: drawing.Curve) -> None:
    """Draw the interpolation law of one case through the range of its velocities."""
    _, force, velocity = numbers(curve.data)
    fine = np.geomspace(float(velocity.min()), float(velocity.max()), 200)
    law = laws.interpolation(_number(force), fine, _number(laws.alpha(curve.data["hurst"])), laws.BETA)
    drawing.law(axes, fine, law, "-", name=LAW, of=curve.data, lw=0.8, alpha=0.6, color=curve.colour)


def _number(value: Any) -> float:
    return float(np.ravel(np.asarray(value))[0])


def draw_velocity(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw friction against velocity in the numbers of the interpolation law, with the law (figure 3.8)."""
    by = ("hurst", "normal_force", "temperature")
    return _against_velocity(groups, "friction against velocity", _in_numbers, by, "x", law=True)


def draw_forces(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw friction against velocity, both logarithmic, for many loads (figure 3.9)."""
    subject = "friction against velocity for every load"
    return _against_velocity(groups, subject, _in_units, BY, "xy", ("normal_force",))


def draw_regions(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw friction against velocity for one case of each series, with the regions of the law (figure 3.7)."""
    found = curves.with_outputs(groups, [MU], "velocity", where=is_plane)
    found = {name: slim(data) for name, data in found.items() if "velocity" in data[MU].dims}
    if not found:
        raise DataError("expected velocity as an axis of its own: regions follow one case through the velocities")
    found, told = curves.few(found)
    figure, panels = drawing.panels(len(found))
    families = []
    for axes, (name, data) in zip(panels, found.items(), strict=True):
        one, more = curves.hold(data, [dim for dim in curves.axes_of(data, MU) if dim != "velocity"])
        told += [f"{name}: {each}" if name else each for each in more]
        families.append(curves.family(one, MU, "velocity"))
        _draw_regions(axes, families[-1].curves[0])
    bars = curves.meaning_of_bars(*found.values(), outputs=[MU])
    titles(figure, panels, list(found), families, "regions of friction against velocity", bars)
    style.leave_out(figure, told)
    return figure


def _draw_regions(axes: Axes, curve: drawing.Curve) -> None:
    data = curve.data
    speeds, value = _mean_of(data, _in_units)
    drawing.curve(axes, curve._replace(label="simulated"), speeds, value)
    _, force, number = numbers(data)
    scale = _number(number / speeds)
    exponent = _number(laws.alpha(data["hurst"]))
    fine = np.geomspace(speeds.min(), speeds.max(), 300)
    law = np.sqrt(2) * laws.interpolation(_number(force), fine * scale, exponent, laws.BETA)
    drawing.law(axes, fine, law, "k--", of=data, lw=1, label=LAW)
    edges = [edge / scale for edge in laws.regions(_number(force), exponent, laws.BETA)]
    edges.append(_fall(speeds, value.value.values))
    bounds = [speeds.min(), *edges, speeds.max()]
    for left, right, region in zip(bounds[:-1], bounds[1:], ("I", "II", "III", "IV"), strict=True):
        if right > left > 0 and np.isfinite(right):
            centre = np.sqrt(max(left, speeds.min()) * min(right, speeds.max()))
            axes.text(centre, 0.02, region, transform=axes.get_xaxis_transform(), ha="center")
    for edge in edges:
        if speeds.min() < edge < speeds.max():
            axes.axvline(edge, color="grey", lw=0.8, ls=":")
    shown = _in_units(data)
    axes.set(xlabel=shown.x, ylabel=shown.y, ylim=(0, None))
    style.logarithmic(axes, "x")
    style.legend(axes)


def _fall(velocity: Any, mean: Any) -> float:
    """Return the velocity beyond the maximum at which friction has lost a twentieth of it, the start of region IV."""
    if not np.isfinite(mean).any():
        return float(velocity.max())
    peak = int(np.nanargmax(mean))
    below = np.flatnonzero(mean[peak:] < 0.95 * mean[peak])
    return float(velocity[peak + below[0]]) if below.size else float(velocity.max())


def _fitted(name: str, groups: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Return the constants of a law for every series that has the data for it."""
    known = {key: slim(data) for key, data in groups.items() if MU in data and has_hurst(data)}
    if not known:
        raise DataError("expected one Hurst exponent or an axis of them: each has constants of its own")
    return curves.results(FIT[name].compute, known)


def has_hurst(data: xr.Dataset) -> bool:
    """Return whether the Hurst exponent is fixed or an axis of its own, not drawn along with other parameters."""
    return "hurst" in data.coords and data["hurst"].dims in ((), ("hurst",))


def constants(found: xr.Dataset, name: str) -> drawing.Mean:
    """Return fitted constants with their intervals."""
    return drawing.Mean(found[name], found[f"{name}_low"], found[f"{name}_high"])


class _Panel(NamedTuple):
    """A constant of a law against the Hurst exponent, and what it is compared with."""

    constant: str
    label: str
    law: Callable[[Any], Any]
    law_label: str


def _against_hurst(name: str, groups: Mapping[str, xr.Dataset], subject: str, rows: tuple[_Panel, ...]) -> Figure:
    """Draw constants of a law against the Hurst exponent, one panel for each, all series in it."""
    found = _fitted(name, groups)
    figure, panels = drawing.panels(len(rows), sharex=True)
    fine, told, held = np.linspace(0, 1, 101), [], []
    for axes, row in zip(panels, rows, strict=True):
        families = {key: curves.family(each, row.constant, "hurst", BY) for key, each in found.items()}
        for number, (key, one) in enumerate(families.items()):
            alone = len(found) == 1
            told += [each if alone else f"{key}: {each}" for each in one.left_out]
            held.append(one.held)
            for curve in one.curves:
                text = ", ".join(part for part in ("" if alone else key, curve.label) if part)
                colour = curve.colour if alone else style.colour(number)
                drawn = curve._replace(label=text, colour=colour, line="", marker=style.MARKERS[number % 4])
                drawing.curve(axes, drawn, curve.data["hurst"], constants(curve.data, row.constant), bars=True)
        drawing.law(axes, fine, row.law(fine), "k-", lw=1, label=row.law_label)
        axes.set(xlabel=style.label("hurst"), ylabel=row.label, ylim=(0, None))
        curves.finish(figure, axes, next(iter(families.values())) if len(families) == 1 else curves.NO_FAMILY)
    fixed = curves.fixed_by_all(held)
    bars = "; ".join(part for part in ("bars: 95 % intervals", curves.verdict(found.values())) if part)
    style.title(figure, subject, curves.fixed_text(fixed, CASE), bars)
    style.leave_out(figure, told)
    return figure


def draw_zone_one(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw alpha and beta against the Hurst exponent, with H / (1 + H) (figure 3.10)."""
    rows = (
        _Panel("alpha", r"$\alpha$", laws.alpha, "H / (1 + H) (eq. 3.13)"),
        _Panel("beta", r"$\beta$", lambda hurst: np.full_like(hurst, laws.BETA), f"{laws.BETA} of the docs"),
    )
    subject = r"law of zone 1: $\mu$ / slope = $\beta$ (v $\tau$ slope / h) (G h L / $F_N)^\alpha$"
    return _against_hurst("zone_one", groups, subject, rows)


def draw_plateau(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the plateau against the Hurst exponent (figure 3.11)."""
    row = _Panel(
        "plateau", r"largest $\mu$ / rms slope", lambda hurst: np.full_like(hurst, np.sqrt(2)), "√2 (eq. 3.15)"
    )
    return _against_hurst("plateau", groups, "plateau of friction", (row,))


class _Indented(NamedTuple):
    """The cases of one series of indenters: xi, friction where it is known, and where the law is meant to hold."""

    xi: xr.DataArray
    friction: drawing.Mean
    within: xr.DataArray

    def where(self, chosen: xr.DataArray) -> drawing.Mean:
        """Return the friction of some of the cases."""
        return drawing.Mean(*(each.where(chosen) for each in self.friction))


def _indented(data: xr.Dataset) -> _Indented:
    """Return the cases of one series."""
    slope = spectral_slope(data)
    value = curves.measured(data, MU, 1 / (np.sqrt(2) * slope))
    xi, within, *friction = xr.broadcast(indenter_xi(data, slope), within_indenter_law(data, slope), *value)
    known = (friction[0] > 0) & np.isfinite(xi) & (xi > 0)
    return _Indented(xi, drawing.Mean(*(each.where(known) for each in friction)), within & known)


def draw_indenter(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw friction of rough indenters against xi, with their law (figures 3.14 and 3.15)."""
    points, reasons = {}, []
    for name, data in curves.with_outputs(groups, [MU]).items():
        try:
            points[name] = _indented(slim(data))
        except FitError as error:
            reasons.append(f"{name}: {error}" if name else str(error))
    if not points:
        raise FitError("; ".join(dict.fromkeys(reasons)))
    figure, (axes,) = drawing.panels(1)
    inside = 0
    for (name, one), colour in zip(points.items(), style.scale(len(points)), strict=True):
        inside += int(one.within.sum())
        drawing.plain(axes, one.xi, one.where(~one.within).value, ".", ms=2, color="0.6", zorder=1)
        drawing.points(axes, one.xi, one.where(one.within), colour, "o", name or "simulated")
    span = np.concatenate([drawing.flat(one.xi.where(one.xi > 0)) for one in points.values()])
    span = span[np.isfinite(span)]
    if not span.size:
        raise DataError("expected friction of a rough indenter, got no case that succeeded")
    axes.plot([], [], ".", color="0.6", label="outside the law: steep or barely touching body, region IV")
    fine = np.geomspace(span.min(), span.max(), 300)
    drawing.law(axes, fine, laws.indenter(fine), "k-", lw=1, label=r"law (eq. 3.40), $\alpha$ = 1.5")
    drawing.law(axes, fine, np.minimum(fine, 1), "k:", lw=0.8, label="limits (eq. 3.34, 3.36)")
    axes.set(xlabel=r"$\xi = 8 G a \tau v \nabla z / (\sqrt{2} F_N)$", ylabel=r"$\mu$ / ($\sqrt{2}$ rms slope)")
    style.logarithmic(axes, "xy")
    style.legend(axes)
    held = curves.fixed_by_all([{str(k): v for k, v in groups[name].coords.items() if v.ndim == 0} for name in points])
    total = sum(int(one.friction.value.count()) for one in points.values())
    bars_text = curves.meaning_of_bars(*(groups[name] for name in points), outputs=[MU])
    subject = f"rough indenters against their law: {inside} of {total} cases lie within it"
    style.title(figure, subject, curves.fixed_text(held, CASE), bars_text)
    style.leave_out(figure, reasons)
    return figure


PLOTS: tuple[Plot, ...] = (
    Plot("regions", MODELS, "friction against velocity with regions I to IV (Fig. 3.7)", draw_regions),
    Plot("velocity", MODELS, "friction against velocity and the law, e.g. for several H (Fig. 3.8)", draw_velocity),
    Plot("force", MODELS, "friction against velocity for many loads, logarithmic (Fig. 3.9)", draw_forces),
    Plot("zone_one", MODELS, "alpha and beta against the Hurst exponent (Fig. 3.10)", draw_zone_one),
    Plot("plateau", MODELS, "plateau of friction against the Hurst exponent (Fig. 3.11)", draw_plateau),
    Plot("indenter", MODELS, "friction of rough indenters against their law (Fig. 3.14, 3.15)", draw_indenter),
)
