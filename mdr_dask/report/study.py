"""The content of a page about one study, read from the store of the study."""

from __future__ import annotations

import hashlib
import json
import platform
import shlex
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import aggregation, fits, models, plots, store
from mdr_dask.errors import DataError, FitError
from mdr_dask.plots import curves, labels, page
from mdr_dask.plots.base import provenance
from mdr_dask.questions import progress
from mdr_dask.questions.columns import fixed_words
from mdr_dask.report.cases import cases_of, main_outputs, thinned
from mdr_dask.report.figures import Json, drawn_of
from mdr_dask.report.subjects import Subject, subject_of
from mdr_dask.units import seconds

#: Largest number of rows of a table of a law.
MOST_ROWS = 60
#: Largest number of values of an axis that are listed.
LISTED = 6


class Table(NamedTuple):
    """A table of the page: title, headings, rows of texts, and a note below the table."""

    title: str
    headings: list[str]
    rows: list[list[str]]
    note: str = ""


@dataclass(frozen=True)
class Study:
    """The content of a page about one study.

    `understood` are tables that show how the campaign was understood: axes, fixed parameters and outputs. `failures`
    are failures and warnings. Messages that differ only in numbers form one group. `not_fitted` are the laws that
    cannot be fitted, with reasons. `not_drawn` are the figures that cannot be drawn, with reasons. The module
    `mdr_dask.report.figures` makes the data in `figures`, and `mdr_dask.report.cases` makes the data in `cases`.
    `rerun` are commands that compute the study again. `at_work` names the runs that are now computing the study.
    """

    url: str
    title: str
    model: str
    summary: str
    facts: dict[str, str]
    campaign: str
    source: str
    understood: list[Table]
    counts: list[Table]
    machines: list[Table]
    failures: list[progress.Group]
    laws: list[Table]
    not_fitted: list[tuple[str, str]]
    errors: list[Table]
    figures: list[Json]
    not_drawn: list[tuple[str, str]]
    cases: list[Json]
    subject: Subject | None
    digests: dict[str, str]
    rerun: list[str]
    at_work: str


def read_study(url: str) -> Study:
    """Read the content of a page about a study. The study may be unfinished."""
    with store.readable(url):
        whole = store.datasets(url)
        read = {name: thinned(data) for name, data in whole.items()}
        groups = {name: data for name, (data, _) in read.items()}
        with page.with_labels(labels.chosen_units(groups), labels.symbols(groups)):
            return _study(url, whole, groups, {name: texts for name, (_, texts) in read.items()})


def _study(
    url: str,
    whole: Mapping[str, xr.Dataset],
    groups: dict[str, xr.Dataset],
    left_out: Mapping[str, list[str]],
) -> Study:
    omitted = [text for texts in left_out.values() for text in texts]
    held = store.attributes(url)
    model = str(held["model"])
    counted = progress.counts(url)
    records = [record for name in groups for record in store.records(url, name)]
    drawn = list(
        drawn_of(
            {name: plot for name, plot in plots.figures_of(model, groups).items() if not (omitted and plot.fitted)},
            groups,
            lambda name: provenance(name, [url], f"mdr-dask plot {shlex.quote(url)} {name}"),
        )
    )
    if not omitted:
        laws, not_fitted = _laws(url, model, groups)
    else:
        laws, not_fitted = [], [("all laws", f"the study is large; use mdr-dask fit {shlex.quote(url)} NAME")]
        drawn = [
            one | {"left_out": "; ".join(filter(None, [one["left_out"], *omitted]))} if isinstance(one, dict) else one
            for one in drawn
        ]
    return Study(
        url=url,
        title=str(held["title"]),
        model=model,
        summary=_summary(model),
        facts=_facts(held, counted, records),
        campaign=str(held["campaign"]),
        source=str(held.get("source", "")),
        understood=[table for name, data in groups.items() for table in _understood(name, data)],
        counts=[_count_table(counted)],
        machines=_machines(records, held),
        failures=progress.grouped(
            [m for name, data in groups.items() for m in progress.messages(url, name, whole[name])], groups
        ),
        laws=laws,
        not_fitted=not_fitted,
        errors=[table for name, data in groups.items() for table in _errors(name, data)],
        figures=sorted((one for one in drawn if isinstance(one, dict)), key=_shows_no_errors),
        not_drawn=[one for one in drawn if isinstance(one, tuple)],
        cases=cases_of(groups, left_out),
        subject=subject_of(model),
        digests=_digests(url, held, records),
        rerun=_rerun(url, held),
        at_work=", ".join(store.active_runs(url)),
    )


def _shows_no_errors(figure: Json) -> bool:
    """Return whether a figure shows no intervals. Figures without intervals come last on the page."""
    return not any("y_low" in trace or "value_low" in trace for trace in figure["traces"])


def _summary(model: str) -> str:
    from mdr_dask.errors import ModelError

    try:
        return models.load(model).summary
    except ModelError:
        return "a model that is not installed here"


def _facts(held: Mapping[str, Any], counted: list[Json], records: list[Json]) -> dict[str, str]:
    total = sum(row["results"] for row in counted)
    states = {state: sum(row[state] for row in counted) for state in list(counted[0])[2:]} if counted else {}
    settled = total - states.get("missing", 0)
    spent = sum(float(record["compute_seconds"]) for record in records)
    listed = ", ".join(f"{number} {state.replace('_', ' ')}" for state, number in states.items() if number)
    facts = {
        "results": f"{settled} of {total} ({settled / max(total, 1):.0%}): {listed}",
        "store created": str(held["created"]),
        "time in the model": seconds(spent),
        "computed by": f"mdr_dask {held['versions']['mdr_dask']}, model version {held['model_version']}",
        "seed": str(held["seed"]),
        "accuracy": f"{held['accuracy']:g}, relative" if held.get("accuracy") else "default of the model",
    }
    if records:
        last = datetime.fromtimestamp(max(float(record["finished"]) for record in records), UTC)
        facts["last block"] = last.isoformat(timespec="seconds")
    return facts


def _count_table(counted: list[Json]) -> Table:
    headings = [heading.replace("_", " ") for heading in counted[0]] if counted else []
    return Table("Results in each state", headings, [[str(value) for value in row.values()] for row in counted])


def _understood(name: str, data: xr.Dataset) -> Iterator[Table]:
    """Yield three tables of a series: the axes, the fixed parameters, and the outputs."""
    of = f" of {name}" if name else ""
    dims = [str(dim) for dim in data["status"].dims if dim != "realisation"]
    varied = [axis for dim in dims for axis in curves.parameters_along(data, dim) if axis in data.coords]
    rows = [
        [axis, str(data[axis].attrs.get("long_name", "")), str(data[axis].size), _range(axis, data[axis])]
        for axis in varied
    ]
    rows.append(["realisation", "independent realisations, at most", str(data.sizes["realisation"]), ""])
    yield Table(f"Axes{of}", ["axis", "meaning", "values", "range"], rows)
    fixed = [
        [str(key), str(value.attrs.get("long_name", "")), _shown(str(key), value)]
        for key, value in data.coords.items()
        if value.ndim == 0 and value.dtype.kind in "fiu"
    ]
    words = [[key, "", word] for key, word in fixed_words(data).items()]
    yield Table(f"Fixed parameters{of}", ["parameter", "meaning", "value"], fixed + words)
    computed = [
        [each, str(data[each].attrs.get("long_name", "")), str(data[each].attrs.get("units", "1"))]
        for each in main_outputs(data)
    ]
    notes = "; ".join(map(str, data.attrs.get("notes", [])))
    yield Table(f"Outputs{of}", ["output", "meaning", "unit"], computed, notes)


def _shown(name: str, value: xr.DataArray) -> str:
    """Return one value as text in the unit of the figures."""
    unit = labels.quantity(name, value).unit
    return f"{float(labels.shown(name, value)):.6g} {unit}".strip()


def _range(name: str, values: xr.DataArray) -> str:
    if values.dtype.kind not in "fiu":
        words = [str(value) for value in values.to_numpy()]
        return ", ".join(words[:LISTED]) + (", ..." if len(words) > LISTED else "")
    if values.size <= LISTED:
        return ", ".join(_shown(name, value) for value in values)
    return f"{_shown(name, values.min(keep_attrs=True))} to {_shown(name, values.max(keep_attrs=True))}"


def _machines(records: list[Json], held: Mapping[str, Any]) -> list[Table]:
    hosts = Counter(str(record["host"]) for record in records)
    spent = dict.fromkeys(hosts, 0.0)
    for record in records:
        spent[str(record["host"])] += float(record["compute_seconds"])
    workers = {host: len({record.get("process") for record in records if record["host"] == host}) for host in hosts}
    rows = [[host, str(count), str(workers[host]), seconds(spent[host])] for host, count in hosts.items()]
    kinds = Counter(str(record.get("kind", "unknown")) for record in records)
    versions = [[name, str(number)] for name, number in {"Python": held.get("python", ""), **held["versions"]}.items()]
    return [
        Table("Machines", ["machine", "blocks", "processes", "time in the model"], rows),
        Table("Processors and programs", ["kind", "blocks"], [[kind, str(count)] for kind, count in kinds.items()]),
        Table("Versions when the store was created", ["program", "version"], versions),
        Table("History", ["event"], [[str(line)] for line in held["history"]]),
    ]


def _laws(url: str, model: str, groups: Mapping[str, xr.Dataset]) -> tuple[list[Table], list[tuple[str, str]]]:
    """Return tables of the fitted laws, and the laws that cannot be fitted, with reasons."""
    found: list[Table] = []
    missing: list[tuple[str, str]] = []
    for name, law in fits.available(model).items():
        try:
            results = law.results(groups)
        except (FitError, DataError) as error:
            missing.append((name, str(error)))
            continue
        except Exception as error:
            if store.is_damage(error):
                raise
            missing.append((name, f"internal error in this law; please report it with the campaign: {error}"))
            continue
        found += [_law(url, f"{name} {series}".strip(), law.summary, result) for series, result in results.items()]
    return found, missing


def _law(url: str, name: str, summary: str, result: xr.Dataset) -> Table:
    names = [str(each) for each in result.data_vars]
    joined = [
        each for each in names if not any(each == f"{other}{end}" for other in names for end in ("_low", "_high"))
    ]
    dims = [str(dim) for dim in result.sizes]
    frame = (result if dims else result.expand_dims("case")).to_dataframe(dim_order=dims or None).reset_index()
    rows = [
        [*(_cell(row[dim]) for dim in dims), *(_interval(row, each) for each in joined)]
        for row in frame.head(MOST_ROWS).to_dict("records")
    ]
    units = {each: str(result[each].attrs.get("units", "1")) for each in joined}
    headings = [*dims, *(each if units[each] in ("1", "") else f"{each} [{units[each]}]" for each in joined)]
    more = f"{len(frame) - MOST_ROWS} more rows; " if len(frame) > MOST_ROWS else ""
    command = f"mdr-dask fit {shlex.quote(url)} {name.split(' ')[0]}"
    return Table(f"{name}: {summary}", headings, rows, f"{more}{command}")


def _interval(row: Mapping[Any, Any], name: str) -> str:
    """Return a fitted constant as text, followed by the limits of the interval if these limits are known."""
    low, high = (row.get(f"{name}{end}", np.nan) for end in ("_low", "_high"))
    return f"{_cell(row[name])} ({_cell(low)}, {_cell(high)})" if np.isfinite([low, high]).all() else _cell(row[name])


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _errors(name: str, data: xr.Dataset) -> Iterator[Table]:
    """Yield one table with two errors of the mean of each output: the standard error over realisations, and the grid
    error.
    """
    rows = []
    for output in main_outputs(data):
        if "realisation" not in data[output].dims or set(data[output].dims) > set(data["status"].dims):
            continue
        size = abs(aggregation.mean(data[output]))
        error = aggregation.companion(data, output)
        lines = aggregation.standard_error(data[output])
        grid = aggregation.grid_error(error) if error is not None else xr.full_like(lines, np.nan)
        whole = lines.fillna(0) + grid.fillna(0)
        share = (grid.fillna(0) / whole.where(whole > 0)) if error is not None else grid
        relative = [(each / size.where(size > 0)).to_numpy() for each in (lines, grid)]
        rows.append(
            [output, *(_percent(each, at) for each in relative for at in (0.5, 1.0)), _percent(share.to_numpy(), 0.5)]
        )
    headings = [
        "output",
        "standard error, median",
        "standard error, largest",
        "grid error, median",
        "grid error, largest",
        "share of the grid error, median",
    ]
    note = (
        "Standard error of the mean over realisations, and estimated discretisation error of the mean (grid error), "
        "relative to the mean of each case. A dash means that the error is unknown, and over 100 % that the error is "
        "larger than the mean."
    )
    if rows:
        yield Table(f"Errors{' of ' + name if name else ''}", headings, rows, note)


def _percent(values: Any, at: float) -> str:
    known = values[np.isfinite(values)]
    if not known.size:
        return "-"
    percent = 100 * float(np.quantile(known, at))
    if percent > 100:
        return "over 100 %"
    return f"{percent:.0f} %" if percent >= 10 else f"{percent:.2g} %"


def _digests(url: str, held: Mapping[str, Any], records: list[Json]) -> dict[str, str]:
    """Return digests of the campaign and of the results."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    written = sorted(json.dumps([r["block"], r["attempt"], r.get("chunks", {})], sort_keys=True) for r in records)
    return {
        "campaign, sha256": hashlib.sha256(str(held["campaign"]).encode()).hexdigest(),
        "digests of all chunks, sha256": hashlib.sha256("\n".join(written).encode()).hexdigest(),
        "model": f"{held['model']} version {held['model_version']}",
        "this page": f"written {now} on {platform.node()} from {Path(url).name}",
    }


def _rerun(url: str, held: Mapping[str, Any]) -> list[str]:
    file = shlex.quote(str(held.get("source") or "campaign.yaml"))
    place = shlex.quote(url)
    module = str(held["model"]).partition(":")[0]
    own = f"# with version {held['model_version']} of the model in the module {module}, which is not packed"
    return [
        f"# with mdr_dask {held['versions']['mdr_dask']}",
        *([own] if models.is_own(str(held["model"])) else []),
        f"mdr-dask run {file} --store {place}",
        f"mdr-dask verify {place}",
        f"mdr-dask report {place} -o report.html",
    ]
