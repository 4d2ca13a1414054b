"""Pictures of a sliding contact: the rough line, the elastomer over it and where they touch; lines of several H."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import models
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.base import Block
from mdr_dask.plots import curves, drawing, style
from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODELS = ("sliding_friction",)
DEPTH = "indentation_depth"
CASE = (
    *("hurst", "normal_force", "velocity", "shear_modulus", "relaxation_time"),
    *("rms_roughness", "length", "points", "indenter_angle", "indenter_radius"),
)
#: Grid of a picture: places for every Nyquist point, and the part of the line in the right panel.
OVERSAMPLING = 8
CLOSE_UP = 0.02
MOST_CASES = 3
MOST_LINES = len(style.COLOURS)
ROUNDING = 1e-9  # of the height of a line
MICRO, MILLI = 1e6, 1e3


class Contact(NamedTuple):
    """A line in contact, in m: places, heights into the elastomer, and those of the elastomer's surface."""

    place: FloatArray
    line: FloatArray
    elastomer: FloatArray

    @property
    def touching(self) -> Any:
        """Where both surfaces are the same, to rounding."""
        return self.elastomer - self.line <= ROUNDING * np.ptp(self.line)


def _line(case: xr.Dataset) -> tuple[Any, Any]:
    """Return the sliding problem of one case and its line's setting."""
    from mdr_dask.models.parts.sliding_problem import sliding_problems

    model = models.load(str(case.attrs["model"]))
    parameters = model.parameters.model_validate(curves.parameters_at(case))
    realisation = int(case["realisation"])
    problems = sliding_problems(Block(parameters, {}, 1, (realisation,), int(case.attrs["seed"]), ()))
    if problems.faults:
        raise DataError(problems.faults[0])
    return problems, problems.settings[0]


def contact_of(case: xr.Dataset) -> Contact:
    """Return the contact of one case in one realisation, from its line and the depth that the store holds.

    Raises
    ------
    DataError
        If the body is no Kelvin body, or the case has no depth.
    """
    from mdr_dask.physics.sliding.displacement import displacement

    problems, setting = _line(case)
    if setting.terms is not None:
        raise DataError("expected a Kelvin body, whose surface follows from the depth alone")
    depth = float(case[DEPTH]) / problems.height[0]
    if not np.isfinite(depth):
        raise DataError("expected a case with a depth, got one that did not succeed")
    waves = setting.roughness.waves(int(case.attrs["seed"]), int(case["realisation"]))
    count = OVERSAMPLING * waves.points
    place = np.arange(count) / count
    line = waves.heights(count)
    if setting.body is not None:
        line = line + setting.body.at(place - 0.5)[0]
    pushed = displacement(depth + line, float(problems.deborah[0]) * count, periodic=setting.body is None)
    length, height = problems.length[0], problems.height[0]
    return Contact(place * length, line * height, np.maximum(pushed - depth, line) * height)


def draw_contact(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the line, the elastomer and where they touch, the whole line and a part of it (figures 3.5 and 3.12)."""
    name, data = next(iter(curves.with_outputs(groups, [DEPTH]).items()))
    told = [f"series {', '.join(other for other in groups if other != name)}"] if len(groups) > 1 else []
    over = curves.along_dim(data, "velocity", DEPTH)
    data = data[[DEPTH, "status"]]
    data, more = curves.hold(data, [dim for dim in curves.axes_of(data, DEPTH) if dim != over])
    if data.sizes["realisation"] > 1:
        more.append(f"realisations but the first of {data.sizes['realisation']}")
    data = data.isel(realisation=0)
    if over:
        data = data.isel({over: np.flatnonzero(np.isfinite(data[DEPTH].values))})
        data, thinned = curves.thin(data, over, MOST_CASES)
        more += thinned
    cases = [data.isel({over: k}) for k in range(data.sizes[over])] if over else [data]
    if not cases:
        raise DataError("expected a case with a depth, got none that succeeded")
    figure, panels = drawing.panels(2 * len(cases), columns=2, size=(5.6, 2.8))
    alike = curves.fixed_by_all([curves.scalars(case) for case in cases])
    for k, case in enumerate(cases):
        contact = contact_of(case)
        own = {key: value for key, value in curves.scalars(case).items() if key not in alike}
        for axes, part in zip(panels[2 * k : 2 * k + 2], (slice(None), _close_up(contact)), strict=True):
            _draw_one(axes, case, contact, part)
        share = f"{contact.touching.mean():.2%} of the line touches"
        panels[2 * k].set_title(", ".join(p for p in (curves.fixed_text(own, CASE), share) if p), fontsize="small")
        panels[2 * k + 1].set_title("a part of it", fontsize="small")
    style.legend(panels[0])
    style.title(
        figure,
        f"contact{f', series {name}' if name else ''}; the line slides to the left",
        curves.fixed_text(alike, CASE),
    )
    style.leave_out(figure, [*more, *told])
    return figure


def _close_up(contact: Contact) -> slice:
    """Return a part of the line of which about half touches."""
    width = max(int(CLOSE_UP * contact.place.size), 2)
    shares = np.convolve(contact.touching, np.ones(width) / width, "valid")
    start = int(np.argmin(abs(shares - 0.5)))
    return slice(start, start + width)


def _draw_one(axes: Axes, case: xr.Dataset, contact: Contact, part: slice) -> None:
    place, line, elastomer = contact.place[part] * MILLI, contact.line[part] * MICRO, contact.elastomer[part] * MICRO
    axes.fill_between(place, line, line.min() - 0.05 * np.ptp(line), color="0.85", linewidth=0, gid=style.GUIDE)
    drawing.plain(axes, place, line, label="rigid line", of=case, lw=0.6, color="0.4")
    drawing.plain(axes, place, elastomer, label="elastomer", of=case, lw=1.0, color=style.colour(0))
    touching = np.where(contact.touching[part], line, np.nan)
    drawing.plain(axes, place, touching, label="contact", of=case, lw=2.0, color=style.colour(1))
    shown = [elastomer.min(), elastomer.max(), *([line.min()] if part != slice(None) else [])]
    axes.set_ylim(min(shown) - 0.1 * np.ptp(shown) - 1e-9, max(shown) + 0.1 * np.ptp(shown) + 1e-9)
    axes.set(xlabel=style.with_unit("place $x$", "mm"), ylabel=style.with_unit("height", "µm"))


def draw_lines(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw lines of several Hurst exponents with the same phases (figure 2.6)."""
    found = {name: data for name, data in groups.items() if "hurst" in data.coords and "hurst" in data.dims}
    if not found:
        raise DataError("expected a series with an axis hurst")
    name, data = next(iter(found.items()))
    dims = [str(dim) for dim in data["status"].dims if dim not in ("hurst", "realisation")]
    data, told = curves.hold(data[["status"]], dims)
    if data.sizes["realisation"] > 1:
        told.append(f"realisations but the first of {data.sizes['realisation']}")
    data, thinned = curves.thin(data.isel(realisation=0), "hurst", MOST_LINES)
    figure, panels = drawing.panels(data.sizes["hurst"], columns=1, size=(7.0, 1.3), sharex=True)
    for k, axes in enumerate(panels):
        case = data.isel(hurst=k)
        problems, setting = _line(case)
        waves = setting.roughness.waves(int(case.attrs["seed"]), int(case["realisation"]))
        count = 2 * waves.points
        place = np.arange(count) / count * problems.length[0] * MILLI
        height = waves.heights(count) * problems.height[0] * MICRO
        drawing.plain(axes, place, height, of=case, lw=0.6, color=style.colour(0))
        axes.set_title(style.named("hurst", case["hurst"]), fontsize="small")
        axes.set_ylabel(style.with_unit("height", "µm"))
    panels[-1].set_xlabel(style.with_unit("place $x$", "mm"))
    held = {key: value for key, value in curves.scalars(data).items() if key in ("rms_roughness", "length", "points")}
    text = curves.fixed_text(held, ("rms_roughness", "length", "points"))
    style.title(figure, f"lines of the same phases{f', series {name}' if name else ''}", text)
    rest = ", ".join(other for other in groups if other != name)
    style.leave_out(figure, [*told, *thinned, f"series {rest}" if rest else ""])
    return figure


PLOTS: tuple[Plot, ...] = (
    Plot("contact", MODELS, "the line, the elastomer, and where they touch (Fig. 3.5, 3.12)", draw_contact),
    Plot("lines", MODELS, "lines of several H with the same phases (Fig. 2.6)", draw_lines),
)
