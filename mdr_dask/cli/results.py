"""Commands that read a store: status, show and law."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from mdr_dask.cli.answers import check_target, print_answer, write_answer
from mdr_dask.cli.options import (
    csv_option,
    json_option,
    limit_option,
    listed,
    select_option,
    series_option,
    tell,
    units_option,
    where_option,
)
from mdr_dask.cli.printing import print_json, print_rows, say
from mdr_dask.cli.writing import require_suffix, writing

STATISTICS = ("mean", "standard_deviation", "standard_error", "grid_error", "quantile", "interval", "count")

store_argument = click.argument("store")


@click.command()
@store_argument
@click.option(
    "--failures", is_flag=True, help="List failed results with their reasons and the ranges of their parameters."
)
@click.option("--messages", is_flag=True, help="List failed results, and also the warnings of finished results.")
@json_option
def status(store: str, failures: bool, messages: bool, form: str | None) -> None:
    """Show the progress of a study, and the runs that are computing it now.

    \b
    mdr-dask status results/quickstart.zarr
    mdr-dask status results/quickstart.zarr --failures
    """
    from mdr_dask import store as stores
    from mdr_dask.aggregation import BIASED, has_biased_means
    from mdr_dask.questions import progress

    if not (failures or messages):
        of_store = stores.attributes(store)
        study = {"study": of_store["title"], "model": of_store["model"], "model_version": of_store["model_version"]}
        _print_counts(study, progress.counts(store), stores.active_runs(store), form)
        stores.require_undamaged(store, stores.series_names(store))
        return
    studies = stores.datasets(store)
    found = [message for name, data in studies.items() for message in progress.messages(store, name, data)]
    if not messages:
        found = [message for message in found if message["status"] != "done"]
    if form == "json":
        print_json(found)
        return
    for group in progress.grouped(found, studies):
        say(f"{group.series + ': ' if group.series else ''}{group.results} x {group.kind}: {group.reason}")
        say(f"    {group.cases}")
    if any(has_biased_means(data["status"]) for data in studies.values()):
        say(f"failed realisations: {BIASED}")
    if not found:
        click.echo("no failures" if not messages else "no messages")


def _print_counts(study: dict[str, Any], rows: list[dict[str, Any]], at_work: list[str], form: str | None) -> None:
    if form == "json":
        print_json({**study, "units": {}, "rows": rows, "at_work": at_work})
        return
    say("{study}: {model}, version {model_version} of the model".format(**study))
    print_rows(rows, {}, "table")
    if at_work:
        click.echo(f"at work: {', '.join(at_work)}")


@click.command()
@store_argument
@click.argument("outputs", nargs=-1, callback=listed)
@click.option(
    "--statistic", type=click.Choice(STATISTICS), multiple=True, help="Statistic over realisations; may be repeated."
)
@click.option("--realisations", "raw", is_flag=True, help="Show single realisations.")
@series_option
@select_option
@where_option
@click.option(
    "--group-by",
    multiple=True,
    callback=listed,
    metavar="AXIS,...",
    help="One row for each combination of values of these axes, averaged over all other axes.",
)
@click.option(
    "--sort",
    multiple=True,
    metavar="[-]COLUMN",
    help="Sort the rows by this column; -COLUMN puts the largest value first. May be repeated.",
)
@click.option(
    "--columns",
    multiple=True,
    callback=listed,
    metavar="NAME,...",
    help="Show only these columns: axes, parameters, outputs, dimensionless numbers, realisations, status.",
)
@units_option
@limit_option
@json_option
@csv_option
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    help="Write a table to FILE.csv or .json, or labelled arrays to FILE.nc or .zarr.",
)
def show(
    store: str,
    outputs: tuple[str, ...],
    statistic: tuple[str, ...],
    raw: bool,
    series: str | None,
    form: str | None,
    output: Path | None,
    limit: int,
    **parts: Any,
) -> None:
    """Show results as a table: means with their errors, or every realisation.

    A mean is followed by its standard error over the realisations and by its discretisation error. The column `status`
    is done, or states how many realisations are missing, failed or not_converged. A column with the same value in all
    rows is printed above the table.

    \b
    mdr-dask show results/quickstart.zarr friction_coefficient
    mdr-dask show results/quickstart.zarr --select 'velocity=1 mm/s..1 m/s' --units velocity=km/h --csv
    mdr-dask show results/quickstart.zarr --where 'friction_coefficient > 0.01 and velocity < 3 km/h' --sort -velocity
    mdr-dask show results/quickstart.zarr --columns load_number,velocity_number,scaled_friction -o numbers.csv
    """
    from mdr_dask import store as stores
    from mdr_dask.questions import selection
    from mdr_dask.questions.table import Question, labelled, table

    if output is not None:
        if form:
            raise click.UsageError(f"expected one of --{form} and --output, got both")
        check_target(output)
    statistics = None if raw else statistic or ("mean", "standard_error", "grid_error")
    join = not (raw or statistic)
    question = Question(outputs, statistics=statistics, written=output is None and not form, **parts)
    dataset = selection.group(stores.datasets(store), series)
    if output is None:
        print_answer(table(dataset, question, 0 if form else limit, tell), form or "table", limit, join)
        return
    if output.suffix in (".nc", ".zarr"):
        found = labelled(dataset, question, tell)
        with writing(output):
            stores.save(found, output)
        click.echo(f"{output}: {len(found.data_vars)} variables over {dict(found.sizes)}")
        return
    answer = table(dataset, question, 0, tell)
    rows = write_answer(answer, output)
    click.echo(f"{output}: {rows} rows of {', '.join(answer.units)}")


@click.command()
@store_argument
@click.argument("output")
@series_option
@select_option
@click.option(
    "--output", "-o", "path", type=click.Path(path_type=Path), required=True, help="Write to FILE.nc or FILE.zarr."
)
def law(store: str, output: str, series: str | None, selections: tuple[str, ...], path: Path) -> None:
    """Write an output and its error as a dense table over the axes of the study, for other programs.

    Interpolate the table linearly, with xarray or in your own program.

    \b
    mdr-dask law results/quickstart.zarr friction_coefficient --select 'normal_force=1.5 N' -o mu.nc
    """
    from mdr_dask import store as stores
    from mdr_dask.fits.interpolant import law as table_of
    from mdr_dask.questions import selection
    from mdr_dask.units import shown

    require_suffix(path, (".nc", ".zarr"))
    dataset = selection.select(selection.group(stores.datasets(store), series), selections, tell)
    table = table_of(selection.outputs(dataset, (output,)).assign(status=dataset["status"]), output)
    with writing(path):
        stores.save(table, path)
    values, error = table[output], table[f"{output}_error"]
    for dim in values.dims:
        if values[dim].dtype.kind in "fiu":
            unit = str(values[dim].attrs.get("units", "1"))
            low, high = (shown(float(values[dim][end]), unit, 6) for end in (0, -1))
            click.echo(f"{dim}: {low} to {high}, {values.sizes[dim]} values")
    part = (error / abs(values)).where(values != 0)
    click.echo(f"{path}: error of {output} {float(part.median()):.1%} in the median, {float(part.max()):.1%} at most")


def require_known(names: Sequence[str], known: Sequence[str], what: str) -> None:
    """Raise UsageError for an unknown name, with a similar known name or a list of the known names."""
    from mdr_dask.errors import similar

    for name in names:
        if name not in known:
            hint = similar(name, known) or f"; known: {', '.join(known) or 'none'}"
            raise click.UsageError(f"no {what} is called {name!r}{hint}")
