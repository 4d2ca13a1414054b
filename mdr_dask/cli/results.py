"""Commands around a store: status, show, aggregate, fit."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.cli.options import select_option, series_option, tell, units_option
from mdr_dask.cli.printing import print_json, print_rows, printable, table, with_errors, with_intervals
from mdr_dask.cli.writing import require_suffix, writing

if TYPE_CHECKING:
    import xarray as xr


class Reading(click.Command):
    """A command that reads a store, its first argument."""

    def invoke(self, context: click.Context) -> Any:
        """Run it; what Zarr has to say of chunks that cannot be read is one error."""
        from mdr_dask.store import readable

        with readable(context.params[str(self.params[0].name)]):
            return super().invoke(context)


STATISTICS = ("mean", "standard_deviation", "standard_error", "grid_error", "quantile", "interval", "count")

store_argument = click.argument("store")
json_option = click.option("--json", "form", flag_value="json", help="Print one JSON document, with units.")
csv_option = click.option("--csv", "form", flag_value="csv", help="Print comma-separated values.")
limit_option = click.option(
    "--limit", type=click.IntRange(min=0), default=40, show_default=True, help="Most rows of a table; 0 for all."
)


@click.command(cls=Reading)
@store_argument
@click.option("--failures", is_flag=True, help="List what failed, why, and which values the failures share.")
@click.option("--messages", is_flag=True, help="List warnings of results that are done, too.")
@json_option
def status(store: str, failures: bool, messages: bool, form: str | None) -> None:
    """Show the progress of a store, during a run too.

    \b
    mdr-dask status results/quickstart.zarr
    mdr-dask status results/quickstart.zarr --failures
    """
    from mdr_dask import store as room

    groups = room.datasets(store)
    if not (failures or messages):
        print_rows([_count(name, dataset) for name, dataset in groups.items()], {}, form or "table")
        return
    found = [message for name, dataset in groups.items() for message in _told(store, name, dataset)]
    if not messages:
        found = [message for message in found if message["status"] != "done"]
    if form == "json":
        print_json(found)
        return
    for series, reason in dict.fromkeys((message["series"], message["message"]) for message in found):
        alike = [message for message in found if (message["series"], message["message"]) == (series, reason)]
        kind = "warning" if alike[0]["status"] == "done" else alike[0]["status"]
        click.echo(printable(f"{series + ': ' if series else ''}{len(alike)} x {kind}: {reason}"))
        click.echo(printable(f"    {_shared(alike)}"))
    if not found:
        click.echo("no failures" if not messages else "no messages")


def _count(name: str, dataset: xr.Dataset) -> dict[str, Any]:
    from mdr_dask.models.base import Status

    states = dataset["status"].to_numpy()
    counts = {state.name.lower(): int((states == state).sum()) for state in Status}
    return {"series": name or "-", "results": states.size, **counts}


def _told(store: str, series: str, dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return what still holds of the messages of a group: the last attempt's, where the ledger says the same."""
    from mdr_dask import store as room
    from mdr_dask.models.base import Status

    last: dict[tuple[int, ...], dict[str, Any]] = {}
    for record in sorted(room.records(store, series), key=lambda record: record["attempt"]):
        for message in record["messages"]:
            last[tuple(message["place"])] = {"series": series, "attempt": record["attempt"], **message}
    ledger = room.ledger(store, series, dataset["status"].shape)
    return [message for place, message in last.items() if ledger[place] == Status[message["status"].upper()]]


def _shared(messages: list[dict[str, Any]]) -> str:
    """Return the range that each varied parameter takes among the messages."""
    parts = []
    for path in messages[0]["case"]:
        values = sorted({message["case"].get(path) for message in messages}, key=lambda v: (str(type(v)), v))
        if len(values) == 1:
            parts.append(f"{path} = {_brief(values[0])}")
        else:
            parts.append(f"{path} {_brief(values[0])} .. {_brief(values[-1])} ({len(values)} values)")
    return ", ".join(parts) or "the only case"


def _brief(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


@click.command(cls=Reading)
@store_argument
@click.argument("outputs", nargs=-1)
@series_option
@select_option
@click.option("--statistic", type=click.Choice(STATISTICS), multiple=True, help="Over realisations; repeat.")
@click.option("--realisations", "raw", is_flag=True, help="Show every realisation, not a statistic.")
@units_option
@limit_option
@json_option
@csv_option
def show(
    store: str,
    outputs: tuple[str, ...],
    series: str | None,
    selections: tuple[str, ...],
    statistic: tuple[str, ...],
    raw: bool,
    units: dict[str, str],
    limit: int,
    form: str | None,
) -> None:
    """Show results as a table: means with their errors, or every realisation.

    A mean stands with the standard error of the realisations and, behind a second +-, with the discretisation error.

    \b
    mdr-dask show results/quickstart.zarr friction_coefficient
    mdr-dask show results/quickstart.zarr --select 'velocity=1 mm/s..1 m/s' --units velocity=km/h --csv
    """
    from mdr_dask import store as room
    from mdr_dask.aggregation import aggregate as reduce
    from mdr_dask.questions import selection
    from mdr_dask.questions.units import in_units

    dataset = selection.group(room.datasets(store), series)
    wanted = selection.select(selection.outputs(dataset, outputs), selections, tell)
    shown = wanted if raw else reduce(wanted, statistic or ("mean", "standard_error", "grid_error"))
    shown = in_units(shown, units)
    rows, of_columns = table(shown)
    if not (raw or statistic or form):
        rows, of_columns = with_errors(rows, of_columns)
    print_rows(rows, of_columns, form or "table", limit)


@click.command(cls=Reading)
@store_argument
@series_option
@click.option("--statistic", type=click.Choice(STATISTICS), multiple=True, help="Only these; repeat.")
@click.option("--output", "-o", type=click.Path(path_type=Path), help="Write to FILE.zarr, FILE.nc or FILE.csv.")
@limit_option
@json_option
@csv_option
def aggregate(
    store: str, series: str | None, statistic: tuple[str, ...], output: Path | None, limit: int, form: str | None
) -> None:
    """Reduce every output over its realisations: mean, scatter, standard error, quantiles, bootstrap interval.

    \b
    mdr-dask aggregate results/quickstart.zarr -o quickstart-means.nc
    """
    from mdr_dask import store as room
    from mdr_dask.aggregation import aggregate as reduce
    from mdr_dask.questions import selection

    if output is not None:
        _check_target(output)
    reduced = reduce(selection.group(room.datasets(store), series), statistic or STATISTICS)
    if output is None:
        rows, units = table(reduced)
        print_rows(rows, units, form or "table", limit)
        return
    with writing(output):
        _write(reduced, output)
    click.echo(f"{output}: {len(reduced.data_vars)} variables over {dict(reduced.sizes)}")


def _check_target(path: Path) -> None:
    from mdr_dask.store import is_study

    require_suffix(path, (".zarr", ".nc", ".csv"))
    if path.suffix == ".zarr" and is_study(str(path)):
        raise click.UsageError(f"expected a place for the statistics, got the store of a study: {str(path)!r}")


def _write(dataset: xr.Dataset, path: Path) -> None:
    from mdr_dask.store import save

    if path.suffix == ".csv":
        rows, units = table(dataset)
        with path.open("w") as stream, contextlib.redirect_stdout(stream):
            print_rows(rows, units, "csv")
    else:
        save(dataset, path)


@click.command(cls=Reading)
@store_argument
@click.argument("names", nargs=-1)
@series_option
@limit_option
@json_option
@csv_option
def fit(store: str, names: tuple[str, ...], series: str | None, limit: int, form: str | None) -> None:
    """Fit laws to a store, each constant with its interval; without a name, say which laws there are.

    \b
    mdr-dask fit results/friction_force.zarr
    mdr-dask fit results/friction_force.zarr zone_one --json
    """
    from mdr_dask import fit as room
    from mdr_dask import store as stores
    from mdr_dask.questions import selection

    model = stores.attributes(store)["model"]
    known = room.available(model)
    if not names:
        list_names(model, {name: law.summary for name, law in known.items()})
        return
    require_known(names, list(known), f"law for {model}")
    groups = stores.datasets(store)
    if series is not None:
        groups = {series: selection.group(groups, series)}
    for name in names:
        found = known[name].results(groups)
        for group, result in found.items():
            if (len(names) > 1 or len(found) > 1) and not form:
                click.echo(f"{group + ': ' if group else ''}{name}: {known[name].summary}")
            rows, units = table(result)
            if not form:
                rows, units = with_intervals(rows, units)
            print_rows(
                [{"series": group, **row} for row in rows] if group and form else rows, units, form or "table", limit
            )


def list_names(model: str, summaries: dict[str, str]) -> None:
    """Print what there is for a model, with a line about each."""
    if not summaries:
        click.echo(f"none for {model}")
    width = max(map(len, summaries), default=0)
    for name, summary in summaries.items():
        click.echo(f"{name.ljust(width)}  {summary}")


def require_known(names: Sequence[str], known: Sequence[str], what: str) -> None:
    """Refuse a name that is not known."""
    for name in names:
        if name not in known:
            raise click.UsageError(f"no {what} is called {name!r}; known: {', '.join(known) or 'none'}")
