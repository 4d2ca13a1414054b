"""Progress of a run on stderr: a live line on a terminal, now and then a plain one elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from mdr_dask.execute import Progress

#: Seconds between two plain lines.
PAUSE = 5.0


@contextmanager
def reporter(quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """Yield the function that shows the progress it is called with."""
    if quiet:
        yield lambda _: None
    elif sys.stderr.isatty():
        with _live() as show:
            yield show
    else:
        yield _plain()


@contextmanager
def _live() -> Iterator[Callable[[Progress], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bar

    columns = (BarColumn(bar_width=30), TextColumn("{task.description}"))
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=None)

        def show(progress: Progress) -> None:
            settled = progress.total - progress.to_do
            bar.update(task, total=max(progress.total, 1), completed=settled, description=describe(progress))

        yield show


def _plain() -> Callable[[Progress], None]:
    last = time.monotonic()

    def show(progress: Progress) -> None:
        nonlocal last
        if time.monotonic() - last >= PAUSE:
            last = time.monotonic()
            click.echo(describe(progress), err=True)

    return show


def describe(progress: Progress) -> str:
    """Return done, failed and open results, rate and time left in one line."""
    settled = progress.total - progress.to_do
    parts = [f"{settled} of {progress.total} results", f"{progress.failed} failed"]
    fresh = progress.done + progress.failed
    if fresh and progress.wall_seconds > 0:
        rate = fresh / progress.wall_seconds
        left = progress.seconds_left
        parts += [f"{rate:.3g} a second", f"{seconds(progress.to_do / rate if left is None else left)} left"]
    return ", ".join(parts)


def seconds(duration: float) -> str:
    """Return a duration as a person says it."""
    if duration < 60:
        return f"{duration:.2g} s" if duration < 10 else f"{duration:.0f} s"
    minutes, rest = divmod(round(duration), 60)
    if minutes < 10:
        return f"{minutes} min {rest} s"
    if minutes < 60:
        return f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60} min"
