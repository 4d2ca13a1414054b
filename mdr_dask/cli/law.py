"""The command that writes the law of a study as a table for other programs."""

from __future__ import annotations

from pathlib import Path

import click

from mdr_dask.cli.options import select_option, series_option, tell
from mdr_dask.cli.results import Reading, store_argument
from mdr_dask.cli.writing import require_suffix, writing


@click.command(cls=Reading)
@store_argument
@click.argument("output")
@series_option
@select_option
@click.option(
    "--output", "-o", "path", type=click.Path(path_type=Path), required=True, help="Write to FILE.nc or FILE.zarr."
)
def law(store: str, output: str, series: str | None, selections: tuple[str, ...], path: Path) -> None:
    """Write an output and its error as a dense table over the axes of the study, for other programs.

    Interpolate the table linearly: with xarray, with mdr_dask.Law, or in your own program.

    \b
    mdr-dask law results/quickstart.zarr friction_coefficient -o mu.nc
    """
    from mdr_dask import store as stores
    from mdr_dask.fits.interpolant import law as table_of
    from mdr_dask.questions import selection

    require_suffix(path, (".nc", ".zarr"))
    dataset = selection.select(selection.group(stores.datasets(store), series), selections, tell)
    table = table_of(selection.outputs(dataset, (output,)).assign(status=dataset["status"]), output)
    with writing(path):
        stores.save(table, path)
    values, error = table[output], table[f"{output}_error"]
    for dim in values.dims:
        if values[dim].dtype.kind in "fiu":
            unit = str(values[dim].attrs.get("units", "1"))
            low, high = (selection.written(values[dim].to_numpy()[end], unit) for end in (0, -1))
            click.echo(f"{dim}: {low} to {high}, {values.sizes[dim]} values")
    part = (error / abs(values)).where(values != 0)
    click.echo(f"{path}: error of {output} {float(part.median()):.1%} in the median, {float(part.max()):.1%} at most")
