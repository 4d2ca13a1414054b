"""A solver under test: random cases with known truths, and methods that solve them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.rows import Row, timed_in_turns
from mdr_dask.models.base import Block, Model, Parameters, Status

ROUNDING = 1e-9  # of the scale: errors below count as held


class Truth(NamedTuple):
    """Known values, their own error, and the scale that errors are relative to."""

    values: ArrayLike
    doubt: ArrayLike = 0.0
    scale: ArrayLike = 1.0


class Found(NamedTuple):
    """Computed values and their stated errors; NaN where a method states none."""

    values: ArrayLike
    stated: ArrayLike = np.nan


@dataclass(frozen=True)
class Solver:
    """One solver of the package beside other methods.

    Parameters
    ----------
    name : str
    about : str
        What the errors are, and what the truth is.
    families : dict
        Name and function that draws a case and its truth from a generator; None if the case has no solution.
    methods : dict
        Method, setting and function that solves a case. A method that does not apply to a case returns None.
    rounds : int
        Calls of each method, of which the least time counts; the first may compile.
    """

    name: str
    about: str
    families: Mapping[str, Callable[[np.random.Generator], tuple[Any, Truth] | None]]
    methods: Mapping[str, Mapping[str, Callable[[Any], Found | None]]]
    rounds: int = 3

    def measure(self, cases: int, seed: int) -> Iterator[Row]:
        """Yield for every family, method and setting: median time, error that 90 % of cases stay below, stated error.

        Parameters
        ----------
        cases : int
            Random cases of each family.
        seed : int
            The first number of the seed of every case.
        """
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

    A method with another error than the reference is judged down to the doubt of the reference only.
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
