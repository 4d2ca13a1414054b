"""Figures of the scales of sliding friction: growth of the contact with the load, and collapse on the general law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import aggregation
from mdr_dask.errors import DataError, FitError
from mdr_dask.fits.friction import numbers, spectral_slope
from mdr_dask.physics.sliding import laws
from mdr_dask.plots import curves, drawing, style
from mdr_dask.plots.base import Plot
from mdr_dask.plots.friction import LAW, MODELS, MU, has_hurst, is_plane, slim, titles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GROWTH = ("contact_fraction", "contact_slope")


def draw_contact_growth(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw length and slope of the contact against the load, with F^(1 / (1 + H)) (eq. 3.12, 3.21)."""
    found = curves.with_outputs(groups, GROWTH, "normal_force", where=is_plane)
    found, told = curves.few(found, 3)
    figure, panels = drawing.panels(2 * len(found), columns=2)
    families = []
    for k, (name, data) in enumerate(found.items()):
        for axes, output in zip(panels[2 * k : 2 * k + 2], GROWTH, strict=True):
            one = curves.family(data, output, "normal_force", ("hurst", "velocity"))
            families.append(one)
            for curve in one.curves:
                _draw_contact(axes, curve, output, one.joined)
            style.logarithmic(axes, "xy" if output == GROWTH[0] else "x")
            curves.finish(figure, axes, one)
        told += [f"{name}: {each}" if name else each for each in families[-1].left_out]
    bars = curves.meaning_of_bars(*found.values(), outputs=GROWTH)
    names = [name for name in found for _ in GROWTH]
    subject = r"growth of the contact; dashed: $F^{1/(1+H)}$ through the lightest load"
    grown = _said("contact_growth", "exponent", "exponent of the contact length", found)
    titles(figure, panels, names, families, subject, "; ".join(part for part in (bars, grown) if part))
    style.leave_out(figure, told)
    return figure


def _draw_contact(axes: Axes, curve: drawing.Curve, output: str, joined: bool) -> None:
    """Draw length or slope of the contact of one family's curve against the force number."""
    data = curve.data
    keys = ("normal_force", "shear_modulus", "rms_roughness", "length")
    force = laws.force_number(*(data[key] for key in keys))
    is_length = output == GROWTH[0]
    value = curves.measured(data, output, 1.0 if is_length else 1 / spectral_slope(data))
    drawing.curve(axes, curve, force, value)
    axes.set_xlabel("force number $F_N / (G h L)$")
    axes.set_ylabel("contact length / L" if is_length else "rms slope in contact / rms slope")
    if is_length and joined:
        _draw_growth(axes, curve, np.asarray(force.values), np.asarray(value.value.values))


def _draw_growth(axes: Axes, curve: drawing.Curve, force: Any, fraction: Any) -> None:
    """Draw the power law of eq. 3.12 through the lightest load that is known, as far as loads are known."""
    known = np.isfinite(fraction) & (fraction > 0)
    if known.any():
        force, fraction = force[known], fraction[known]
        first = np.argmin(force)
        law = fraction[first] * (force / force[first]) ** (1 / (1 + float(curve.data["hurst"])))
        drawing.law(axes, force, np.minimum(law, 1), "--", name="eq. 3.12", of=curve.data, lw=0.8, color=curve.colour)


class _Scaled(NamedTuple):
    """Cases on the scales of eq. 3.23: velocity over crossover, friction over plateau; NaN without friction."""

    x: xr.DataArray
    y: xr.DataArray
    hurst: xr.DataArray
    force: xr.DataArray


def _scaled(data: xr.Dataset) -> _Scaled:
    """Return the cases of one series."""
    ratio, number, velocity = numbers(data)
    crossover = laws.crossover(number, laws.alpha(data["hurst"]), laws.BETA)
    friction = aggregation.mean(ratio) / np.sqrt(2)
    columns = xr.broadcast(velocity / crossover, friction, data["hurst"], number)
    return _Scaled(*(column.where(columns[1] > 0) for column in columns))


def draw_collapse(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw all friction of planes on the scales of eq. 3.23: velocity over crossover, friction over plateau."""
    found = curves.with_outputs(groups, [MU], where=is_plane)
    figure, (axes,) = drawing.panels(1)
    scaled = [_scaled(slim(data)) for data in found.values()]
    columns = ([drawing.flat(column) for column in each] for each in zip(*scaled, strict=True))
    x, y, hurst, force = map(np.concatenate, columns)
    if not (known := np.isfinite(y)).any():
        raise DataError("expected friction of a rough plane, got no case that succeeded")
    by_hurst = np.ptp(hurst[known]) > 0
    how, norm = style.shades((hurst if by_hurst else force)[known])
    for one in scaled:
        drawn = drawing.dots(axes, one.x, one.y, one.hurst if by_hurst else one.force, s=8, cmap=how, norm=norm)
    fine = np.geomspace(x[known].min(), x[known].max(), 300)
    drawing.law(axes, fine, (1 + fine**-2.0) ** -0.5, "k-", lw=1, label=LAW)
    off = y[known] / (1 + x[known] ** -2.0) ** -0.5
    axes.set_xlabel(r"velocity number / crossover: $v \tau \nabla z / (\sqrt{2} h) / f(F_N / G h L)$")
    axes.set_ylabel(r"$\mu$ / ($\sqrt{2}$ rms slope)")
    style.logarithmic(axes, "xy")
    figure.colorbar(drawn, ax=axes, label=style.label("hurst") if by_hurst else r"force number $F_N / (G h L)$")
    style.legend(axes)
    spread = f"{int(known.sum())} cases; half of them deviate from the law by less than {_half(off):.0%}"
    shifted = _said("collapse", "collapsed", "share of the spread that free shifts take away", found)
    style.title(figure, "collapse of friction on the scales of eq. 3.23", spread, shifted)
    return figure


def _said(name: str, constant: str, what: str, found: Mapping[str, xr.Dataset]) -> str:
    """Return the range of a constant of the fit of the same name, and where its law holds; nothing without a fit."""
    from mdr_dask.fits import available

    try:
        known = {key: data for key, data in found.items() if has_hurst(data)}
        fits = curves.results(available(MODELS[0])[name].compute, known)
    except (FitError, DataError):
        return ""
    values = np.concatenate([np.ravel(each[constant].values) for each in fits.values()])
    values = values[np.isfinite(values)]
    if not values.size:
        return ""
    ends = f"{values.min():.3g}" if values.size == 1 else f"{values.min():.3g} to {values.max():.3g}"
    return f"fit {name}: {what} {ends}; {curves.verdict(fits.values())}"


def _half(ratio: Any) -> float:
    """Return the relative deviation that half of the cases stay within."""
    return float(np.median(np.abs(ratio - 1)))


PLOTS: tuple[Plot, ...] = (
    Plot("collapse", MODELS, "all friction of planes on the scales of the general law (eq. 3.22, 3.23)", draw_collapse),
    Plot(
        "contact_growth",
        MODELS,
        "length and slope of the contact against the load (eq. 3.12, 3.21)",
        draw_contact_growth,
    ),
)
