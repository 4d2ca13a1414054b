"""The commands that fit laws to the results of a study, and compute Sobol indices."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.cli.figures import COMMAND, Drawing, save
from mdr_dask.cli.options import (
    csv_option,
    figure_options,
    json_option,
    limit_option,
    select_option,
    series_option,
    tell,
)
from mdr_dask.cli.printing import (
    cell,
    print_aligned,
    print_json,
    print_named,
    print_rows,
    say,
    table,
    titled,
    with_intervals,
)
from mdr_dask.cli.results import require_known, store_argument
from mdr_dask.errors import FitError

if TYPE_CHECKING:
    import xarray as xr

    from mdr_dask.fits.base import Fit


@click.command(cls=Drawing)
@store_argument
@click.argument("names", nargs=-1)
@series_option
@select_option
@click.option(
    "--measured",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="Table of measured points for `calibration`; replaces the table of the campaign.",
)
@figure_options("--plot", "-o")
@limit_option
@json_option
@csv_option
@click.pass_context
def fit(
    context: click.Context,
    store: str,
    names: tuple[str, ...],
    series: str | None,
    selections: tuple[str, ...],
    measured: Path | None,
    figure: Path | None,
    look: dict[str, Any],
    limit: int,
    form: str | None,
) -> None:
    """Fit laws: print constants with 95 % intervals, and whether each law holds. Without a name, list the laws.

    `calibration` finds unknown parameters of a study from a table of measured points.

    \b
    mdr-dask fit results/friction_force.zarr
    mdr-dask fit results/friction_force.zarr zone_one --json
    mdr-dask fit results/rig.zarr calibration -o rig.png
    mdr-dask fit results/rig.zarr calibration --measured tuesday.csv
    """
    from mdr_dask import fits as room
    from mdr_dask import store as stores
    from mdr_dask.fits.calibration import with_table
    from mdr_dask.questions import selection

    model = stores.attributes(store)["model"]
    known = room.available(model)
    if not names:
        if form:
            print_rows([{"law": name, "summary": law.summary} for name, law in known.items()], {}, form)
        else:
            print_named([(name, law.summary) for name, law in known.items()])
        return
    require_known(names, list(known), f"law for {model}")
    if (measured or figure) and names != ("calibration",):
        raise click.UsageError("--measured and --plot can be used only with `calibration`")
    groups = stores.datasets(store)
    if series is not None:
        groups = {series: selection.group(groups, series)}
    groups = selection.select_all(groups, selections, tell)
    if measured is not None:
        groups = with_table(groups, measured)
    for note in dict.fromkeys(note for data in groups.values() for note in data.attrs.get("notes", [])):
        tell(note)
    _print_fits({name: known[name] for name in names}, groups, form, limit)
    if figure is not None:
        from mdr_dask.plots import available
        from mdr_dask.plots.base import provenance

        drawn = available(model)["calibration"]
        save(lambda: drawn.describe(groups), figure, provenance("calibration", [store], context.meta[COMMAND]), look)


def _print_fits(fits: Mapping[str, Fit], groups: Mapping[str, xr.Dataset], form: str | None, limit: int) -> None:
    """Print the results of all fits that succeed. If some were refused, then raise FitError with names and reasons."""
    refused = []
    for name, fit in fits.items():
        try:
            found = fit.results(groups)
        except FitError as error:
            refused.append(f"{name}: {error}")
            continue
        for group, result in found.items():
            if (len(fits) > 1 or len(found) > 1) and not form:
                say(f"{group + ': ' if group else ''}{name}: {fit.summary}")
            _print(result, group, form, limit)
    if refused:
        raise FitError("\n".join(refused))


def _print(result: xr.Dataset, group: str, form: str | None, limit: int) -> None:
    rows, units = table(result)
    if form:
        print_rows([{"series": group, **row} for row in rows] if group else rows, units, form, limit)
    elif any(name.endswith("_low_68") for name in units):
        _print_constants(rows[0], units)
    else:
        print_rows(*with_intervals(rows, units), "table", limit)


def _print_constants(row: dict[str, Any], units: dict[str, str]) -> None:
    """Print a table of the constants with their 95 % and 68 % intervals, and then the other results of the fit."""
    constants = [name for name in units if f"{name}_low_68" in units]
    names = [titled(name, units[name]) for name in constants]
    print_aligned(["", *_ENDS], [names, *([row[name + end] for name in constants] for end in _ENDS.values())])
    ends = {name + end for name in constants for end in _ENDS.values()}
    for name in (name for name in units if name not in ends):
        unit = "" if units[name] == "1" else f" {units[name]}"
        say(f"{name}: {cell(row[name])}{unit}")


_ENDS = {"value": "", "95 % from": "_low", "to": "_high", "68 % from": "_low_68", "68 % to": "_high_68"}


@click.command(cls=Drawing)
@store_argument
@click.argument("output")
@series_option
@select_option
@figure_options("--plot", "-o")
@json_option
@csv_option
@click.pass_context
def sensitivity(
    context: click.Context,
    store: str,
    output: str,
    series: str | None,
    selections: tuple[str, ...],
    figure: Path | None,
    look: dict[str, Any],
    form: str | None,
) -> None:
    """Compute which parameters matter for an output: Sobol indices with 95 % intervals.

    The campaign needs `sampling: {saltelli: n}`. The first-order index of a parameter is the fraction of the variance
    that this parameter explains alone. The total index includes the interactions of the parameter with other
    parameters.

    \b
    mdr-dask sensitivity results/rolling.zarr breakthrough_probability
    mdr-dask sensitivity results/rolling.zarr film_ratio -o sensitivity.png
    """
    from mdr_dask import store as stores
    from mdr_dask.fits.sensitivity import sobol_indices
    from mdr_dask.questions import selection

    dataset = selection.select(selection.group(stores.datasets(store), series), selections, tell)
    found = sobol_indices(selection.outputs(dataset, (output,)), output)
    rows, units = table(found)
    if form == "json":
        print_json({"rows": rows, **found.attrs})
    else:
        shown = (rows, units) if form else with_intervals(rows, units)
        print_rows(*shown, form or "table")
    for sentence in _sentences(found.attrs):
        tell(sentence)
    if figure is not None:
        from mdr_dask.plots.base import provenance
        from mdr_dask.plots.sensitivity import sensitivity as drawn

        save(lambda: drawn(found), figure, provenance("sensitivity", [store], context.meta[COMMAND]), look)


def _sentences(attributes: dict[str, object]) -> list[str]:
    sentences = []
    if attributes["left_out"]:
        sentences.append(
            f"{attributes['left_out']} of {attributes['cases']} cases are left out, because they have no value"
        )
    if attributes["realisations"] == 1:
        sentences.append(
            "with one realisation, scatter between samples, if there is any, counts as an interaction of parameters"
        )
    return [*sentences, str(attributes["advice"])]
