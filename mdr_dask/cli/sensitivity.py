"""The command that computes Sobol indices."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from mdr_dask.cli.figures import COMMAND, Drawing, save
from mdr_dask.cli.options import csv_option, figure_options, json_option, select_option, series_option, tell
from mdr_dask.cli.printing import print_json, print_rows, table, with_intervals
from mdr_dask.cli.results import Reading, store_argument


class Asking(Drawing, Reading):
    """A command that reads a store and may draw a figure."""


@click.command(cls=Asking)
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
    """Compute which parameters matter for an output: Sobol indices of a sampled study, with 95 % intervals.

    The first-order index of a parameter is the fraction of the variance that this parameter explains alone. The total
    index includes the interactions of the parameter with other parameters. Total indices need a campaign with
    `sampling: {saltelli: n}`; first-order indices can be computed for every sampled study.

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
        sentences.append("with one realisation, scatter between realisations counts as an interaction")
    return [*sentences, str(attributes["advice"])]
