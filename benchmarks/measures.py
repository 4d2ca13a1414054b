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


def draw_errors(panels: Mapping[str, Mapping[str, Curve]], error: str, path: str, goal: float | None = None) -> None:
    """Write a figure of error over processor time: a panel each title, in it a curve each method."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter

    figure = Figure(figsize=(max(3.6 * len(panels), 6.4), 4.2), layout="constrained")
    for axes, (title, curves) in zip(
        figure.subplots(1, len(panels), sharey=True, squeeze=False)[0], panels.items(), strict=True
    ):
        for label, (seconds, errors) in curves.items():
            axes.loglog(seconds, errors, "o-", ms=4, label=label)
        if goal is not None:
            axes.axhline(goal, color="0.6", linewidth=1)
        axes.set(title=title, xlabel="processor time (s)")
        low, high = axes.get_xlim()
        wider = max(10 * low / high, 1.0) ** 0.5  # within less than a decade ticks would lie at each other
        axes.set_xlim(low / wider, high * wider)
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel(error)
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
