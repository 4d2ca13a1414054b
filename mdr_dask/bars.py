"""Show the progress of a run: a bar in a notebook or on a terminal, otherwise a line on stderr every few seconds."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from mdr_dask.errors import LOOK, PAUSE
from mdr_dask.units import seconds

if TYPE_CHECKING:
    from mdr_dask.execute import Progress

#: Function that draws the progress. Its arguments: the progress (None before it is first known), and the times in s
#: since the start and since the last change of the progress.
Draw = Callable[["Progress | None", float, float], None]


@contextmanager
def reporter(quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """Yield a function that receives the progress of a run. The latest progress is shown at regular intervals.

    Nothing is shown if `quiet` is true, or if there is neither a notebook nor stderr.
    """
    if quiet:
        yield lambda _: None
    elif "ipykernel" in sys.modules:
        with _in_notebook() as draw, _beating(draw, LOOK) as show:
            yield show
    elif sys.stderr is None:
        yield lambda _: None
    elif sys.stderr.isatty():
        with _live() as draw, _beating(draw, LOOK) as show:
            yield show
    else:
        with _beating(lambda *known: _write(describe(*known)), PAUSE) as show:
            yield show


@contextmanager
def at_work(what: str) -> Iterator[None]:
    """Print the text `what` and the elapsed time every few seconds if stderr is a terminal."""

    def draw(_: Progress | None, elapsed: float, _unchanged: float) -> None:
        _write(", ".join([what, seconds(round(elapsed)), *(["compiling ..."] if _compiles() else [])]))

    if sys.stderr is None or not sys.stderr.isatty():
        yield
        return
    with _beating(draw, PAUSE):
        yield


@contextmanager
def _beating(draw: Draw, pause: float) -> Iterator[Callable[[Progress], None]]:
    """Yield a function that receives the progress, and call `draw` with the latest progress every `pause` seconds."""
    started, ended = time.monotonic(), threading.Event()
    latest: tuple[Progress | None, float] = None, started

    def beat() -> None:
        while not ended.wait(pause):
            (progress, changed), now = latest, time.monotonic()
            draw(progress, now - started, now - changed)

    def show(progress: Progress) -> None:
        nonlocal latest
        latest = progress, time.monotonic()

    thread = threading.Thread(target=beat, daemon=True)
    thread.start()
    try:
        yield show
    finally:
        ended.set()
        thread.join()


@contextmanager
def _live() -> Iterator[Draw]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bar

    columns = (BarColumn(bar_width=20), TextColumn("{task.description}"))
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(describe(None, 0.0), total=None)

        def draw(progress: Progress | None, elapsed: float, unchanged: float) -> None:
            total = max(progress.total, 1) if progress else None
            settled = progress.total - progress.to_do if progress else 0
            bar.update(task, total=total, completed=settled, description=describe(progress, elapsed, unchanged))

        yield draw


@contextmanager
def _in_notebook() -> Iterator[Draw]:
    """Draw a bar below the cell of a notebook while the cell runs."""
    from IPython.display import HTML, display

    handle = display(HTML(_html(None, 0.0)), display_id=True)
    try:
        yield lambda *state: handle.update(HTML(_html(*state)))
    finally:
        handle.update(HTML(""))


def _html(progress: Progress | None, elapsed: float, unchanged: float = 0.0) -> str:
    done = f'value="{progress.total - progress.to_do}" max="{max(progress.total, 1)}"' if progress else ""
    return f"<progress {done}></progress> {describe(progress, elapsed, unchanged)}"


def _write(line: str) -> None:
    sys.stderr.write(line + "\n")
    sys.stderr.flush()


def describe(progress: Progress | None, elapsed: float, unchanged: float = 0.0) -> str:
    """Return one line about the progress: percentage, elapsed time, remaining time and numbers of results.

    Failed results count towards the percentage. `elapsed` and `unchanged` are the times in s since the start and since
    the last change of the progress. The estimated remaining time is reduced by `unchanged`, and is left out when it
    reaches zero. While code is compiled, the line says so instead. If the progress is not known yet (None), the line
    contains only ``preparing`` and the elapsed time.
    """
    if progress is None:
        return f"preparing, {seconds(round(elapsed))}"
    settled = progress.total - progress.to_do
    parts = [f"{100 * settled // max(progress.total, 1)} %", seconds(round(elapsed))]
    if _compiles():
        parts.append("compiling ...")
    elif progress.to_do and (left := (progress.seconds_left or 0.0) - unchanged) > 0:
        parts.append(f"about {seconds(left)} left")
    return ", ".join([*parts, f"{settled} of {progress.total} results", f"{progress.failed} failed"])


def _compiles() -> bool:
    from mdr_dask.compile_clock import compile_clock

    return "numba" in sys.modules and compile_clock().is_running
