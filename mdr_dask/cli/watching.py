"""Show the active runs of a store and their progress, until they end."""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Callable
from datetime import datetime

import click

from mdr_dask.cli.printing import Row

#: Between two updates the program waits at least `PAUSE` seconds, and at least `SHARE` times the duration of an update.
PAUSE, SHARE = 1.0, 5.0


def at_work(store: str) -> list[str]:
    """Describe the active runs of a store: the exclusive run, and the number and the names of active parts."""
    from mdr_dask import store as stores

    runner, parts = stores.at_work(store)
    found = [runner] if runner else []
    for count, alike in itertools.groupby(parts, key=lambda part: part.count):
        numbers = [part.number for part in alike]
        found.append(f"{len(numbers)} of {count} parts ({_ranges(numbers)})")
    return found


def _ranges(numbers: list[int]) -> str:
    """Return ascending numbers as ranges: ``1-3, 7``."""
    runs = itertools.groupby(enumerate(numbers), key=lambda pair: pair[1] - pair[0])
    ends = [[number for _, number in run] for _, run in runs]
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in ends)


def watch(store: str, count: Callable[[], list[Row]]) -> None:
    """Show the progress of a store until no run is active.

    On a terminal, the text is replaced in place. Otherwise a line is printed for every change.

    Parameters
    ----------
    store : str
        Path or URL of the store.
    count : callable
        Returns a row for every group: its name, the number of its results, and the number of results in each state.
    """
    if sys.stdout.isatty():
        from rich.console import Console
        from rich.live import Live

        with Live(console=Console(), auto_refresh=False) as live:
            _follow(store, count, lambda lines: live.update("\n".join(lines), refresh=True))
        return
    last: list[str] = []

    def show(lines: list[str]) -> None:
        for line in lines:
            if line not in last:
                click.echo(f"{datetime.now():%H:%M:%S} {line}")
        last[:] = lines

    _follow(store, count, show)


def _follow(store: str, count: Callable[[], list[Row]], show: Callable[[list[str]], None]) -> None:
    while True:
        start = time.monotonic()
        who = at_work(store)
        show([*map(_line, count()), f"at work: {', '.join(who) or 'no run'}"])
        if not who:
            return
        time.sleep(max(PAUSE, SHARE * (time.monotonic() - start)))


def _line(row: Row) -> str:
    settled = row["results"] - row["missing"]
    states = ", ".join(f"{row[state]} {state.replace('_', ' ')}" for state in list(row)[2:] if row[state])
    name = "" if row["series"] == "-" else f"{row['series']}: "
    return f"{name}{settled} of {row['results']} results ({settled / max(row['results'], 1):.0%}): {states}"
