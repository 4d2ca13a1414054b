"""The class `Solver`: random cases with known results, and the methods that solve them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.rows import Row, timed_in_turns
from mdr_dask.models.base import Block, Model, Parameters, Status

ROUNDING = 1e-9  # errors below this share of the scale count as within the stated error


class Truth(NamedTuple):
    """Known values, their error, and the scale to which errors are relative."""

    values: ArrayLike
    doubt: ArrayLike = 0.0
    scale: ArrayLike = 1.0


class Found(NamedTuple):
    """Computed values and their stated errors; NaN if a method states no error."""

    values: ArrayLike
    stated: ArrayLike = np.nan


@dataclass(frozen=True)
class Solver:
    """One solver of the package, and other methods for comparison.

    docs/accuracy-and-speed.md defines the error and the reference (here `Truth`). A function of `families` draws a case
    and its truth, or returns None if the case has no solution. A function of `methods`, by method and setting, solves a
    case, or returns None if the method does not apply. A time is the least of `rounds` calls; the first may compile.
    """

    name: str
    families: Mapping[str, Callable[[np.random.Generator], tuple[Any, Truth] | None]]
    methods: Mapping[str, Mapping[str, Callable[[Any], Found | None]]]
    rounds: int = 3

    def measure(self, cases: int, seed: int) -> Iterator[Row]:
        """Yield a row for every family, method and setting: median time, 90 % quantile of the error, stated error."""
        for family, draw in self.families.items():
            found: dict[tuple[str, str], list[tuple[float, float, float, float]]] = {}
            for index in range(cases):
                drawn = draw(np.random.default_rng((seed, index)))
                if drawn is None:
                    continue
                case, truth = drawn
                solves = {(m, s): partial(solve, case) for m, each in self.methods.items() for s, solve in each.items()}
                for key, (answer, seconds) in timed_in_turns(solves, self.rounds).items():
                    if answer is not None:
                        found.setdefault(key, []).append((seconds, *judged(answer, truth)))
            for (method, setting), rows in found.items():
                seconds, errors, stated, held = np.array(rows).T
                error = np.quantile(errors, 0.9, method="lower") if np.all(np.isfinite(errors)) else np.nan
                numbers = np.median(seconds), error, np.median(stated), np.mean(held)
                yield Row(self.name, family, method, setting, len(rows), *map(float, numbers))


def judged(found: Found, truth: Truth) -> tuple[float, float, float]:
    """Return the largest error and the largest stated error over the scale, and the share of stated errors that hold.

    The error returned is at least that of the truth, because smaller errors cannot be resolved.
    """
    errors = np.abs(np.asarray(found.values) - truth.values)
    held = errors <= found.stated + np.asarray(truth.doubt) + ROUNDING * np.asarray(truth.scale)
    largest = [float(np.max(each / np.asarray(truth.scale))) for each in (errors, truth.doubt, found.stated)]
    return max(largest[:2]), largest[2], np.nan if np.all(np.isnan(found.stated)) else float(np.mean(held))


def one_case(
    model: Model[Any],
    parameters: Parameters,
    outputs: tuple[str, ...],
    realisation: int = 0,
    seed: int = 1,
    accuracy: float | None = None,
) -> dict[str, np.ndarray] | None:
    """Return the outputs of one case of a model in one realisation, or None if it is not solved."""
    found = model.compute(Block(parameters, {}, 1, (realisation,), seed, outputs, accuracy))
    done = found.status[0, 0] == Status.DONE
    return {name: value[0, 0] for name, value in found.values.items()} if done else None
