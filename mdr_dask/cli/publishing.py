"""Pages of studies: report, serve, publish."""

from __future__ import annotations

from pathlib import Path

import click

from mdr_dask.cli.options import tell
from mdr_dask.cli.writing import require_suffix, writing


@click.command()
@click.argument("stores", nargs=-1, required=True, metavar="STORE...")
@click.option(
    "--output", "-o", default="report.html", show_default=True, type=click.Path(path_type=Path), help="The file."
)
def report(stores: tuple[str, ...], output: Path) -> None:
    """Write a page about studies: one HTML file that opens anywhere, without a network.

    What was asked and how it went, every figure with its numbers, laws with intervals, errors, method and limits, and
    how to run it again. It can be written while a run is at work.

    \b
    mdr-dask report results/quickstart.zarr -o report.html
    mdr-dask report results/dry.zarr results/oil.zarr -o both.html
    """
    from mdr_dask.report import page, read_study

    require_suffix(output, (".html", ".htm"))
    text = page([read_study(store) for store in stores])
    with writing(output):
        output.write_text(text, encoding="utf-8")
    click.echo(str(output))
    tell(f"{len(text.encode()) / 1e6:.1f} MB; any browser opens it")
