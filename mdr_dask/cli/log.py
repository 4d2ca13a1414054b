"""The log of a run in JSON lines, and its messages on stderr."""

from __future__ import annotations

import json
import os
import platform
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.cli.printing import printable
from mdr_dask.cli.writing import require_outside
from mdr_dask.version import __version__

if TYPE_CHECKING:
    from mdr_dask.execute import Event, Tell


@contextmanager
def telling(quiet: bool, log: Path | None, **about: Any) -> Iterator[Tell]:
    """Yield a function that writes events of a run to the file `log`, and the messages of the events to stderr.

    If `log` is None, no file is written. If `quiet` is true, no messages are written. The entries of `about` describe
    the run, and are written to `log` with the event ``run begun``.
    """
    lock = threading.Lock()
    if log is not None:
        require_outside(log)
    with nullcontext() if log is None else log.open("a", encoding="utf-8") as stream:

        def write(name: str, facts: dict[str, Any]) -> None:
            line = {"time": datetime.now(UTC).isoformat(timespec="milliseconds"), "event": name, **facts}
            if stream is not None:
                with lock:
                    stream.write(json.dumps(line) + "\n")
                    stream.flush()

        def tell(event: Event) -> None:
            write(event.name, dict(event.facts))
            if event.sentence and not quiet:
                click.echo(printable(event.sentence), err=True)

        write("run begun", {**about, "mdr_dask": __version__, "host": platform.node(), "process": os.getpid()})
        try:
            yield tell
        except BaseException as error:
            write("run interrupted", {"why": str(error) or type(error).__name__})
            raise
        write("run ended", {})
