"""The commands that write a page about studies and pack a study for publication."""

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
    """Write a page about studies: one HTML file that any browser opens, without a network.

    The page contains the campaign, the progress and all figures with their numbers. The page gives fitted laws with
    intervals, the errors of the results, and the method with its limits. The page also states how to run the study
    again. The page can also be written during a run.

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
    tell(f"{len(text.encode()) / 1e6:.1f} MB, opens in any browser")


@click.command()
@click.argument("store")
@click.option(
    "--output", "-o", default="study.zip", show_default=True, type=click.Path(path_type=Path), help="The file."
)
def publish(store: str, output: Path) -> None:
    """Pack a study for publication: store, campaign, data files, page, environment and checksums.

    The zip itself is a Zarr store. `verify` can check the zip directly; `run` can extend the study after unpacking.

    \b
    mdr-dask publish results/quickstart.zarr -o study.zip
    mdr-dask verify study.zip
    """
    from mdr_dask.report.publishing import publish as pack

    require_suffix(output, (".zip", ".ZIP"))
    with writing(output):
        count = pack(store, output)
    click.echo(f"{output}: {count} files, {output.stat().st_size / 1e6:.1f} MB")
