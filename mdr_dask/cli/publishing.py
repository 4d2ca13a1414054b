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


@click.command()
@click.argument("stores", nargs=-1, required=True, metavar="STORE...")
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Where to listen; at others than this, other machines see it.",
)
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Port; one that is free if not given.")
def serve(stores: tuple[str, ...], host: str, port: int) -> None:
    """Serve the page of studies to a browser on this machine, and follow a run; Ctrl-C ends it.

    The address holds a secret. Nothing but the page is served, and nothing is written.

    \b
    mdr-dask serve results/quickstart.zarr
    """
    import threading

    from mdr_dask.report.serving import Follower, Server

    follower, ended = Follower(stores), threading.Event()
    try:
        server = Server(follower, host, port)
    except OSError as error:
        raise click.UsageError(f"cannot listen at {host}, port {port}: {error.strerror or error}") from None
    with server:
        follower.look()
        threading.Thread(target=follower.follow, args=(ended,), daemon=True).start()
        click.echo(server.address)
        if not server.is_local:
            tell("whoever has this address and reaches this machine can read the page, and the network can listen")
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            tell("ended")
        finally:
            ended.set()


@click.command()
@click.argument("store")
@click.option(
    "--output", "-o", default="study.zip", show_default=True, type=click.Path(path_type=Path), help="The file."
)
@click.option(
    "--license", "licence", default="", help="Address of the licence, or its name in the list of SPDX: CC-BY-4.0."
)
def publish(store: str, output: Path, licence: str) -> None:
    """Pack a study to be published: store, campaign, data, page, environment, checksums and RO-Crate metadata.

    The zip is itself a Zarr store. Unpacked, `run` goes on with it; `verify` reads all of it, packed or not.

    \b
    mdr-dask publish results/quickstart.zarr -o study.zip --license CC-BY-4.0
    mdr-dask verify study.zip
    """
    from mdr_dask.report.publishing import publish as pack

    require_suffix(output, (".zip", ".ZIP"))
    with writing(output):
        count = pack(store, output, licence)
    click.echo(f"{output}: {count} files, {output.stat().st_size / 1e6:.1f} MB")
    if not licence:
        tell("no licence is stated in it; --license states one")
