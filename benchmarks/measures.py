"""What the benchmarks share: processor times, tables, figures of error over time, single cases of a model."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from mdr_dask.models.base import Block, Model, Parameters, Status

#: Seconds and errors of one method.
Curve = tuple[Sequence[float], Sequence[float]]


def timed(function: Callable[..., Any], *arguments: Any, calls: int = 1) -> tuple[Any, float]:
    """Return the value and the least processor time of some calls."""
    seconds = []
    for _ in range(calls):
        started = time.process_time()
        value = function(*arguments)
        seconds.append(time.process_time() - started)
    return value, min(seconds)


def timed_in_turns(functions: Sequence[Callable[[], Any]], rounds: int) -> list[tuple[Any, float]]:
    """Return the value and the least processor time of every function, called in turns: all see the same machine."""
    found: list[tuple[Any, float]] = [(None, np.inf)] * len(functions)
    for _ in range(rounds):
        for place, function in enumerate(functions):
            value, seconds = timed(function)
            found[place] = value, min(seconds, found[place][1])
    return found


def print_table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a table in Markdown."""
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    for row in rows:
        print(f"| {' | '.join(str(cell) for cell in row)} |")


COLUMNS, CROWDED = 4, 1e4  # panels in a row; ratio of times from which ticks stand at decades only


def draw_errors(panels: Mapping[str, Mapping[str, Curve]], error: str, path: str, goal: float | None = None) -> None:
    """Write a figure of error over processor time: a panel each title, in it a curve each method."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter

    rows = -(-len(panels) // COLUMNS)
    columns = -(-len(panels) // rows)
    figure = Figure(figsize=(max(3.6 * columns, 6.4), 4.2 * rows), layout="constrained")
    places = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for axes in places[len(panels) :]:
        axes.remove()
    for axes, (title, curves) in zip(places, panels.items(), strict=False):
        for label, (seconds, errors) in curves.items():
            axes.loglog(seconds, errors, "o-", ms=4, label=label)
        if goal is not None:
            axes.axhline(goal, color="0.6", linewidth=1)
        axes.set(title=title, xlabel="processor time (s)")
        low, high = axes.get_xlim()
        wider = max(10 * low / high, 1.0) ** 0.5  # within less than a decade ticks would lie at each other
        axes.set_xlim(low / wider, high * wider)
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0) if high < CROWDED * low else (1.0,)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(alpha=0.3)
    for axes in places[: len(panels) : columns]:
        axes.set_ylabel(error)
    figure.axes[0].legend(fontsize="x-small")
    figure.savefig(path, dpi=120)


def alone(
    model: Model[Any],
    parameters: Parameters,
    realisation: int,
    outputs: tuple[str, ...],
    seed: int,
    accuracy: float | None = None,
) -> dict[str, np.ndarray] | None:
    """Return the outputs of one case in one realisation, or None if it is not done."""
    found = model.compute(Block(parameters, {}, 1, (realisation,), seed, outputs, accuracy))
    done = found.status[0, 0] == Status.DONE
    return {name: value[0, 0] for name, value in found.values.items()} if done else None
