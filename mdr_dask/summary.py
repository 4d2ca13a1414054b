"""Describe the size and the costs of a campaign before it is run, as text and as JSON, for ``mdr-dask check``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from mdr_dask import models
from mdr_dask.campaign import Axis, Campaign, Refinement
from mdr_dask.campaign.fields import yaml_text
from mdr_dask.errors import LISTED
from mdr_dask.models.base import unit_of
from mdr_dask.plan import Estimate, estimate
from mdr_dask.units import seconds, shown


@dataclass(frozen=True, repr=False)
class Summary(Estimate):
    """The size and the costs of a campaign. ``print`` shows the text of ``mdr-dask check``.

    `lines` name the campaign and its model, the axes of each series, the defaults used, the notes and the costs.
    `questions` are the remarks of the campaign: questions about numbers without a unit, and notes about unused columns
    of a table of cases.
    """

    lines: tuple[str, ...] = ()
    questions: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return "\n".join((*self.lines, *self.questions))


def summary(campaign: Campaign) -> Summary:
    """Summarise a campaign without running it."""
    costs = estimate(campaign)
    lines = (f"{campaign.name}: {campaign.model}", *study_lines(campaign, costs))
    return Summary(**vars(costs), lines=lines, questions=campaign.remarks)


def study_lines(campaign: Campaign, costs: Estimate) -> Iterator[str]:
    """Yield the axes of each series, and the defaults, notes and costs of the campaign, line by line."""
    for series in campaign.series:
        units = models.load(campaign.model).units(series.parameters)
        if series.name:
            yield f"  {series.name}{'' if series.axes else ': one case'}"
        width = max((len(axis.name) for axis in series.axes), default=0)
        indent = "    " if series.name else "  "
        for axis in series.axes:
            unit = units.get(axis.path, axis.unit or "1")
            yield f"{indent}{axis.name:{width}s}  {axis_range(axis, unit, campaign.written_units.get(axis.name, ''))}"
    if defaults := _defaults(campaign):
        yield f"  defaults used: {', '.join(defaults)}"
    yield from (f"  {note}" for note in costs.notes)
    yield from (f"  {line}" for line in cost_lines(costs))


def _defaults(campaign: Campaign) -> list[str]:
    """Return the names and defaults of the parameters that the campaign does not give.

    Defaults that have no effect, or that are zero, false or empty, are left out. If only some series use a default, the
    names of these series follow in brackets.
    """
    found: dict[str, list[str]] = {}
    for series in campaign.series:
        given, varied = series.parameters, {axis.path.partition(".")[0] for axis in series.axes}
        unmet = {
            name
            for name, (other, value) in given.requires.items()
            if other not in varied and getattr(given, other) != value
        }
        for name in type(given).model_fields.keys() - given.model_fields_set - varied - given.inactive.keys() - unmet:
            if value := getattr(given, name):
                unit = unit_of(type(given), name)
                is_number = isinstance(value, int | float) and not isinstance(value, bool)
                text = shown(value, unit or "1") if is_number else yaml_text(value)
                found.setdefault(f"{name} = {text}", []).append(series.name)
    order = list(type(campaign.series[0].parameters).model_fields)
    return [
        text if len(names) == len(campaign.series) else f"{text} ({', '.join(names)})"
        for text, names in sorted(found.items(), key=lambda item: order.index(item[0].partition(" ")[0]))
    ]


def axis_range(axis: Axis, unit: str, written: str = "") -> str:
    """Return the values of an axis as text.

    If there are more than `LISTED` numbers, the text is their range: ``1 mN to 100 N, 20 values, geometric``. If there
    are more than `LISTED` labels, the text contains the first ones. The text of an adaptive axis is its range and its
    tolerances.
    """
    count = len(axis.values)
    if axis.refinement is not None:
        low, high = (shown(value, unit, written=written) for value in (axis.values[0], axis.values[-1]))
        return f"{low} to {high}, {_adaptive(axis.refinement, count)}"
    if axis.labels is not None:
        more = f", ... ({count} values)" if count > LISTED else ""
        return ", ".join(axis.labels[:LISTED]) + more
    if count <= LISTED:
        return ", ".join(shown(value, unit, written=written) for value in axis.values)
    first, last = (shown(end, unit, written=written) for end in (min(axis.values), max(axis.values)))
    ends = f"{first} to {last}, {count} values"
    return ends if axis.dim == "case" else ends + spacing(axis.values)


def _adaptive(refinement: Refinement, first: int) -> str:
    wanted = []
    for name, tolerance in refinement.until.items():
        parts = [f"{100 * tolerance.relative:.3g} % of its largest value"] * bool(tolerance.relative)
        parts += [f"{tolerance.absolute:.3g} in SI"] * bool(tolerance.absolute)
        wanted.append(f"{name} is interpolated with an error below {' or '.join(parts)}")
    scale = "geometric" if refinement.spread.geometric else "linear"
    return f"{first} to {refinement.at_most} values, {scale}, until {' and '.join(wanted)}"


def spacing(values: tuple[float, ...]) -> str:
    """Return ``, linear`` for equal differences of the values, ``, geometric`` for equal ratios, or an empty text."""
    import numpy as np

    numbers = np.asarray(values, dtype=np.float64)
    steps = np.diff(numbers)
    if np.allclose(steps, steps[0], atol=0):
        return ", linear"
    if np.all(numbers > 0) and np.allclose(np.diff(np.log(numbers)), np.log(numbers[1] / numbers[0]), atol=0):
        return ", geometric"
    return ""


def cost_lines(costs: Estimate) -> Iterator[str]:
    """Yield lines about a study: its number of results, blocks and files, its size and its computing time."""
    more = costs.rounds
    cases, results = _counted("case", costs.cases, costs.growth), _counted("result", costs.results, more)
    yield f"{cases} x {_counted('realisation', costs.realisations, costs.at_most / costs.realisations)} = {results}"
    yield f"{_counted('block', costs.blocks, more)}, about {_counted('file', costs.files, more)} in the store"
    sizes = " to ".join(dict.fromkeys(human_bytes(count * costs.bytes) for count in (1, more)))
    yield f"{sizes} uncompressed"
    if costs.seconds is not None:
        times = " to ".join(dict.fromkeys(seconds(max(count * costs.seconds, 1.0)) for count in (1, more)))
        yield f"about {times} on one core: an estimate from a count of operations, not a measurement on this machine"
    if more > 1:
        yield "ranges: the first number is for the first round or stage, the second one is the upper limit"


def human_bytes(size: float) -> str:
    """Return a number of bytes as text, rounded to two or three digits, with a unit: ``1.5 MB``."""
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if size < 999.5 or unit == "TB":
            break
        size /= 1000
    return f"{size:.0f} {unit}" if size >= 99.5 or unit == "B" else f"{size:.2g} {unit}"


def costs_row(costs: Estimate) -> dict[str, Any]:
    """Return the costs of a study for JSON. Programs of users read these keys: do not change the keys."""
    first = {name: getattr(costs, name) for name in ("results", "blocks", "bytes", "files")}
    return {
        "cases": costs.cases,
        "cases_at_most": round(costs.cases * costs.growth),
        "realisations": costs.realisations,
        "at_most": costs.at_most,
        **first,
        **{f"{name}_at_most": round(count * costs.rounds) for name, count in first.items()},
        "seconds": costs.seconds,
        "seconds_at_most": None if costs.seconds is None else costs.seconds * costs.rounds,
        "notes": list(costs.notes),
    }


def axes_rows(campaign: Campaign) -> list[dict[str, Any]]:
    """Return a row for each axis of each series: names, unit, number of values, first value and last value."""
    return [
        {
            "series": series.name,
            "axis": axis.name,
            "dimension": axis.dim,
            "unit": axis.unit,
            "values": len(axis.values),
            "first": axis.values[0] if axis.labels is None else axis.labels[0],
            "last": axis.values[-1] if axis.labels is None else axis.labels[-1],
        }
        for series in campaign.series
        for axis in series.axes
    ]


def _counted(what: str, first: int, more: float) -> str:
    """Return a number with a noun, such as ``2 cases``, or ``2 to 8 cases`` if it may grow by the factor `more` = 4."""
    last = round(first * more)
    return f"{first if more == 1 else f'{first} to {last}'} {what}{'s' if last != 1 else ''}"
