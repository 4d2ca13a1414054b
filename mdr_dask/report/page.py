"""The page about studies: one HTML file that needs no network.

The page contains no scripts, and its content security policy forbids them. Figures are SVG pictures in ``img``
elements, in which a browser never runs a script.
"""

from __future__ import annotations

import base64
import io
import math
import re
import shlex
import zipfile
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import aggregation, fits, models, plots, store
from mdr_dask.errors import LISTED, DataError, FitError, ModelError
from mdr_dask.plots import curves
from mdr_dask.plots.base import provenance
from mdr_dask.plots.labels import plain
from mdr_dask.plots.page import drawing_for, requested
from mdr_dask.questions import progress
from mdr_dask.questions.columns import fixed_words
from mdr_dask.questions.units import as_written
from mdr_dask.report.papers import SOURCES
from mdr_dask.units import seconds, shown
from mdr_dask.version import __version__

#: Largest number of cases of one series that are drawn. The laws of a larger study are not fitted. Chosen by trial:
#: with this number, a page already takes minutes.
MOST_CASES = 4000
#: Width of the figures: two columns of a journal, which fit on paper without scaling.
SIZE = "170mm"
_DECIMALS = re.compile(r"(\.\d\d)\d+")


class Table(NamedTuple):
    """A table of the page: title, headings, rows of texts, and a note below the table."""

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


def page(urls: Sequence[str]) -> str:
    """Return a page about the studies in some stores as HTML. The studies may be unfinished."""
    from jinja2 import Environment, StrictUndefined

    studies = [_study(url) for url in urls]
    template, style = (_asset(name) for name in ("page.html.jinja", "page.css"))
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    title = ", ".join(dict.fromkeys(study["title"] for study in studies))
    return environment.from_string(template).render(studies=studies, title=title, style=style, version=__version__)


def _asset(name: str) -> str:
    return (files("mdr_dask.report") / "assets" / name).read_text(encoding="utf-8")


def _study(url: str) -> dict[str, Any]:
    """Return all that the template shows of a study."""
    held, groups, left_out = store.attributes(url), {}, []
    whole = store.datasets(url)
    for name, data in whole.items():
        groups[name], texts = _thinned(data)
        left_out += texts
    records = [record for name in groups for record in store.records(url, name)]
    messages = [message for name in groups for message in progress.messages(url, name, whole[name])]
    counted, model = progress.counts(url), str(held["model"])
    return {
        "url": url,
        "title": str(held["title"]),
        "model": model,
        "summary": _summary(model),
        "at_work": ", ".join(store.active_runs(url)),
        "facts": _facts(held, counted, records),
        "counts": _counts(counted),
        "groups": progress.grouped(messages, groups),
        "notes": dict.fromkeys(note for data in groups.values() for note in data.attrs.get("notes", [])),
        **_figures(url, model, groups, left_out),
        **_laws(url, model, groups, bool(left_out)),
        "outputs": [_outputs(name, data) for name, data in groups.items()],
        "source": SOURCES.get(model),
        "file": str(held.get("source") or "campaign.yaml"),
        "campaign": str(held["campaign"]),
        "parameters": [_parameters(name, data) for name, data in groups.items()],
        "rerun": _rerun(url, held),
    }


def _thinned(data: xr.Dataset) -> tuple[xr.Dataset, list[str]]:
    """Load at most `MOST_CASES` cases of a series. Return the cases, and texts about the values that are left out."""
    dims, left_out = [str(dim) for dim in data["status"].dims if dim != "realisation"], []
    while (cases := math.prod(data.sizes[dim] for dim in dims)) > MOST_CASES:
        longest = max(dims, key=lambda dim: data.sizes[dim])
        size = data.sizes[longest]
        data, texts = curves.thin(data, longest, max(1, min(size - 1, size * MOST_CASES // cases), size // 4))
        left_out += texts
    return data.load(), left_out


def _summary(model: str) -> str:
    try:
        return models.load(model).summary
    except ModelError:
        return "a model that is not installed here"


def _facts(held: Mapping[str, Any], counted: Sequence[Mapping[str, Any]], records: Any) -> dict[str, str]:
    total, missing = (sum(row[key] for row in counted) for key in ("results", "missing"))
    machines = {str(record["host"]): str(record.get("kind", "kind unknown")).partition(",")[0] for record in records}
    spent = seconds(sum(float(record["compute_seconds"]) for record in records))
    versions = {f"model {held['model']}": held["model_version"], "Python": held.get("python", ""), **held["versions"]}
    times = [datetime.fromtimestamp(float(record["finished"]), UTC).isoformat(timespec="seconds") for record in records]
    return {
        "results": f"{total - missing} of {total} ({(total - missing) / max(total, 1):.0%})",
        "accuracy": f"{100 * held['accuracy']:g} %, relative" if held.get("accuracy") else "default of the model",
        "seed": str(held["seed"]),
        "store created": str(held["created"]),
        "last result": max(times, default="none"),
        "machine time": ", ".join([f"{spent} in the model", *(f"{host} ({kind})" for host, kind in machines.items())]),
        "versions": ", ".join(f"{name} {number}" for name, number in versions.items()),
    }


def _counts(counted: Sequence[Mapping[str, Any]]) -> Table:
    headings = [heading.replace("_", " ") for heading in counted[0]] if counted else []
    return Table("Results in each state", headings, [[str(value) for value in row.values()] for row in counted])


def _figures(url: str, model: str, groups: Mapping[str, xr.Dataset], left_out: list[str]) -> dict[str, Any]:
    """Return the figures as pictures, a zip of their tables, and the figures that cannot be drawn, with reasons."""
    from mdr_dask.plots.render import render

    figures, not_drawn, tables = [], {}, io.BytesIO()
    with drawing_for(requested(size=SIZE)), zipfile.ZipFile(tables, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, plot in plots.figures_of(model, groups).items():
            command = f"mdr-dask plot {shlex.quote(url)} {name}"
            if plot.fitted and left_out:
                not_drawn[name] = f"the study is large; use {command}"
                continue
            try:
                figure = plot.describe(groups)
                figure.leave_out(left_out)
                with plot.faults_named():
                    drawn = render(figure)
                    picture = base64.b64encode(_svg(drawn)).decode()
            except (DataError, FitError) as error:
                not_drawn[name] = str(error)
                continue
            drawn.origin = provenance(name, [url], command)
            packed.writestr(f"{name}.csv", drawn.csv("%.9g"))
            heading = "; ".join(part for part in (figure.subject, figure.fixed, figure.bars) if part)
            figures.append(
                {
                    "name": name.replace("_", " "),
                    "summary": plot.summary,
                    "source": f"data:image/svg+xml;base64,{picture}",
                    "caption": [plain(line) for line in (heading, *figure.remarks()) if line],
                }
            )
    link = f"data:application/zip;base64,{base64.b64encode(tables.getvalue()).decode()}"
    return {"figures": figures, "not_drawn": not_drawn, "tables": link}


def _svg(figure: Any) -> bytes:
    """Return a figure as SVG. To keep the page small, coordinates of paths (in points) are cut to two decimals."""
    picture = io.StringIO()
    figure.savefig(picture, format="svg")
    return re.sub(r'(?<= d=")[^"]+', lambda path: _DECIMALS.sub(r"\1", path[0]), picture.getvalue()).encode()


def _laws(url: str, model: str, groups: Mapping[str, xr.Dataset], is_large: bool) -> dict[str, Any]:
    """Return tables of the fitted laws, and the laws that cannot be fitted, with reasons."""
    if is_large:
        return {"laws": [], "not_fitted": {"all laws": f"the study is large; use mdr-dask fit {shlex.quote(url)} NAME"}}
    found, missing = [], {}
    for name, law in fits.available(model).items():
        try:
            results = law.results(groups)
        except (FitError, DataError) as error:
            missing[name] = str(error)
            continue
        command = f"mdr-dask fit {shlex.quote(url)} {name}"
        tables = [
            _law(f"{name} {series}".strip() + f": {law.summary}", each, command) for series, each in results.items()
        ]
        found += [one for one in tables if one.rows]
    return {"laws": found, "not_fitted": missing}


def _law(title: str, result: xr.Dataset, command: str) -> Table:
    names = [str(each) for each in result.data_vars]
    constants = [name for name in names if name.removesuffix("_low").removesuffix("_high") not in {*names} - {name}]
    constants.sort(key=lambda name: not name.endswith("law_holds"))
    dims = [str(dim) for dim in result.sizes]
    frame = (result if dims else result.expand_dims("case")).to_dataframe(dim_order=dims or None).reset_index()
    numbers = [name for name in constants if frame[name].dtype.kind == "f"]
    frame = frame.dropna(how="all", subset=numbers) if numbers else frame
    rows = [
        [*(_cell(row[dim]) for dim in dims), *(_interval(row, name) for name in constants)]
        for row in frame.to_dict("records")
    ]
    units = {name: str(result[name].attrs.get("units", "1")) for name in constants}
    headings = [*dims, *(name if unit in ("1", "") else f"{name} [{unit}]" for name, unit in units.items())]
    return Table(title, headings, rows, command)


def _interval(row: Mapping[Any, Any], name: str) -> str:
    """Return a fitted constant as text, followed by the limits of the interval if these limits are known."""
    low, high = (row.get(f"{name}{end}", np.nan) for end in ("_low", "_high"))
    return f"{_cell(row[name])} ({_cell(low)}, {_cell(high)})" if np.isfinite([low, high]).all() else _cell(row[name])


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _outputs(name: str, data: xr.Dataset) -> Table:
    """Return a table of the outputs of a series, with the errors of their means relative to these means."""
    names = [str(output) for output in data.data_vars if output != "status"]
    errors = {str(data[output].attrs.get("ancillary_variables")) for output in names}
    rows = []
    for output in (each for each in names if each not in errors):
        unit = str(data[output].attrs.get("units", "1"))
        heading = output if unit == "1" else f"{output} [{unit}]"
        rows.append([heading, str(data[output].attrs.get("long_name", "")), *_shares(data, output)])
    headings = [
        "output",
        "meaning",
        "standard error: median, largest",
        "grid error: median, largest",
        "share of grid error",
    ]
    return Table(f"Outputs{' of ' + name if name else ''}", headings, rows)


def _shares(data: xr.Dataset, output: str) -> list[str]:
    if "realisation" not in data[output].dims or set(data[output].dims) > set(data["status"].dims):
        return ["-"] * 3
    size, error = abs(aggregation.mean(data[output])), aggregation.companion(data, output)
    lines = aggregation.standard_error(data[output])
    grid = aggregation.grid_error(error) if error is not None else xr.full_like(lines, np.nan)
    whole = lines.fillna(0) + grid
    relative = [_percents(each / size.where(size > 0), 0.5, 1.0) for each in (lines, grid)]
    return [*relative, _percents(grid / whole.where(whole > 0), 0.5)]


def _percents(share: xr.DataArray, *quantiles: float) -> str:
    known = share.to_numpy()[np.isfinite(share.to_numpy())]
    percents = [100 * float(np.quantile(known, at)) for at in quantiles] if known.size else []
    texts = [f"{percent:.2g} %" if percent < 10 else f"{percent:.0f} %" for percent in percents]
    return (
        ", ".join("over 100 %" if percent > 100 else text for percent, text in zip(percents, texts, strict=True)) or "-"
    )


def _parameters(name: str, data: xr.Dataset) -> Table:
    """Return a table of the axes and the fixed parameters of a series, in the units of the campaign file."""
    written = as_written(data)
    dims = [str(dim) for dim in data["status"].dims if dim != "realisation"]
    axes = [axis for dim in dims for axis in curves.parameters_along(data, dim) if axis in data.coords]
    fixed = [str(key) for key, value in data.coords.items() if value.ndim == 0 and value.dtype.kind in "fiu"]
    rows = []
    for each in (*axes, *fixed):
        attrs, values = data[each].attrs, np.ravel(data[each].to_numpy())
        is_long = values.size > LISTED
        if values.dtype.kind in "fiu":
            ends = [values.min(), values.max()] if is_long else values
            texts = [shown(float(value), str(attrs.get("units", "1")), 6, written.get(each, "")) for value in ends]
            text = f"{texts[0]} to {texts[1]}, {values.size} values" if is_long else ", ".join(texts)
        else:
            text = ", ".join(map(str, values[:LISTED])) + (f", ... ({values.size} values)" if is_long else "")
        rows.append([each, str(attrs.get("long_name", "")), text])
    rows += [[key, "", word] for key, word in fixed_words(data).items()]
    rows.append(["realisation", "independent realisations, at most", str(data.sizes["realisation"])])
    return Table(f"Parameters{' of ' + name if name else ''}", ["parameter", "meaning", "values"], rows)


def _rerun(url: str, held: Mapping[str, Any]) -> list[str]:
    """Return the commands that compute the study again."""
    model, version = str(held["model"]), held["model_version"]
    own = f"# with version {version} of the model in the module {model.partition(':')[0]}, which is not included"
    return [
        f"# with mdr_dask {held['versions']['mdr_dask']}",
        *([own] if models.is_own(model) else []),
        f"mdr-dask run {shlex.quote(str(held.get('source') or 'campaign.yaml'))} --store {shlex.quote(url)}",
    ]
