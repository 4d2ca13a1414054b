"""The commands that verify a store, write a page about studies, and pack a study for publication."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from mdr_dask.cli.options import json_option, limit_option, tell
from mdr_dask.cli.printing import print_json, print_rows, printable
from mdr_dask.cli.writing import require_suffix, writing

if TYPE_CHECKING:
    from mdr_dask.store import Inspection


@click.command()
@click.argument("store")
@click.option(
    "--repair",
    is_flag=True,
    help="Write damaged metadata again; remove damaged blocks and coordinates, which the next run writes again.",
)
@limit_option
@json_option
def verify(store: str, repair: bool, limit: int, form: str | None) -> int:
    """Read every file of a store, and list damaged, missing and foreign files.

    The exit code is 1 if there are such files. With --repair, it is 1 only if some of them are left as they are.

    \b
    mdr-dask verify results/quickstart.zarr
    mdr-dask verify results/quickstart.zarr --repair
    mdr-dask verify study.zip
    """
    from mdr_dask import store as stores

    if store.endswith(".zip") and Path(store).is_file():
        if repair:
            raise click.UsageError("--repair is for a store, not for a published zip; unpack it first")
        found, left = stores.verify_packed(Path(store)), None
    else:
        found, left = stores.repair(store) if repair else (stores.verify(store), None)
    if form == "json":
        print_json(_document(found) | ({"left": _document(left)["findings"]} if left else {}))
    else:
        _print(store, found, limit, repaired=left is not None)
    if left is None:
        return 1 if found.findings else 0
    for finding in left.findings:
        click.echo(printable(f"left as it is: {finding.kind} {finding.name}: {finding.what}"), err=True)
    return 1 if left.findings else 0


def _print(store: str, found: Inspection, limit: int, *, repaired: bool) -> None:
    rows = [{"kind": f.kind, "file": printable(f.name), "what": printable(f.what)} for f in found.findings]
    if rows:
        print_rows(rows, {}, "table", limit)
    for note in found.notes:
        click.echo(printable(note))
    bad = sum(len(group.bad_blocks) for group in found.groups)
    click.echo(f"{store}: {found.files} files, {found.blocks} blocks: {len(rows) or 'no'} faults")
    if bad:
        what = f"removed blocks: {bad}" if repaired else f"damaged blocks: {bad}; --repair removes them"
        click.echo(f"{what}; the next run computes them again")


def _document(found: Inspection) -> dict[str, object]:
    findings = [{"kind": f.kind, "file": f.name, "what": f.what} for f in found.findings]
    return {"files": found.files, "blocks": found.blocks, "findings": findings, "notes": found.notes}


@click.command()
@click.argument("stores", nargs=-1, required=True, metavar="STORE...")
@click.option(
    "--output", "-o", default="report.html", show_default=True, type=click.Path(path_type=Path), help="File to write."
)
def report(stores: tuple[str, ...], output: Path) -> None:
    """Write a page about studies: one HTML file that any browser opens, without a network.

    The page contains the campaign, the progress, the warnings, all figures with their numbers, the fitted laws with
    intervals, the errors of the results, and the papers to cite. The page can also be written during a run.

    \b
    mdr-dask report results/quickstart.zarr -o report.html
    mdr-dask report results/dry.zarr results/oil.zarr -o both.html
    """
    from mdr_dask.report.page import page

    require_suffix(output, (".html", ".htm"))
    text = page(stores)
    with writing(output):
        output.write_text(text, encoding="utf-8")
    click.echo(str(output))
    tell(f"{len(text.encode()) / 1e6:.1f} MB, opens in any browser")


@click.command()
@click.argument("store")
@click.option(
    "--output", "-o", default="study.zip", show_default=True, type=click.Path(path_type=Path), help="File to write."
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
