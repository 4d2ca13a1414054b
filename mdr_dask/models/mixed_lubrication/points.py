"""How many points a line gets where a case asks for an accuracy instead of points."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.models.mixed_lubrication.declaration import LEAST_PER_WAVE, MOST_POINTS
from mdr_dask.models.mixed_lubrication.lines import Measured
from mdr_dask.models.mixed_lubrication.operation import Operation
from mdr_dask.models.mixed_lubrication.turn import Turn

#: Relative error where the campaign names none.
ACCURACY = 0.01
#: Outputs of a turn that come from the lengths in contact of its windows.
OF_LENGTH = {
    "contact_length",
    "contact_conductance",
    "contact_resistance",
    "contact_length_trace",
    "upper_profile",
    "lower_profile",
}


class Settings(NamedTuple):
    """Numbers of the choice, from ``python -m benchmarks mixed honesty``.

    Parameters
    ----------
    first, coarse, order : float
        The error stated with the fewest points, over a power of the length of the shortest wave in that of the pieces
        that break, and the power of the spacing that it falls like.
    steps : int
        Numbers of points in a factor of two: few, so that cases of other layers share lines.
    further : int
        Times the first points that a turn gets at most.
    slowest : float
        Power of the spacing that errors fall like where single clusters decide.
    rare : float
        Probability below which an accuracy is that of this probability.
    """

    first: float = 0.2
    coarse: float = 0.6
    order: float = 3.6
    steps: int = 4
    further: int = 4
    slowest: float = 2.0
    rare: float = 0.1


SETTINGS = Settings()


def first(operation: Operation, accuracy: float | None) -> Operation:
    """Return the case on the points that its layer and its shortest wave ask for, or as it is if it names them."""
    source = operation.source
    if isinstance(source, Measured) or operation.case.points != "auto":
        return operation
    wave = operation.coarseness * source.per_wave
    stated = SETTINGS.first * wave**SETTINGS.coarse
    return _on(operation, (stated / (accuracy or ACCURACY)) ** (1 / SETTINGS.order))


def finer(
    operation: Operation,
    turn: Turn,
    errors: Callable[[], FloatArray],
    accuracy: float | None,
    outputs: Collection[str],
) -> Operation | None:
    """Return the case on more points if its turn misses an accuracy asked for and may have more, else None."""
    begun, here = first(operation, accuracy).source, operation.source
    if accuracy is None or isinstance(here, Measured) or operation.case.points != "auto":
        return None
    most = begun.points * SETTINGS.further
    if here.points >= min(most, MOST_POINTS):
        return None
    missed = miss(turn, errors(), accuracy, outputs)
    if missed <= 1:
        return None
    wanted = min(missed ** (1 / SETTINGS.slowest) * here.points, most)
    return _on(operation, wanted / (LEAST_PER_WAVE * here.modes))


def miss(turn: Turn, errors: FloatArray, accuracy: float, outputs: Collection[str]) -> float:
    """Return the error over what an accuracy allows: that of the probability, or of the length where one is asked for
    that comes from it and it is larger.
    """
    of_probability, of_length = errors / list(judged_by(turn).values())
    return float(max(of_probability, of_length) if OF_LENGTH & set(outputs) else of_probability) / accuracy


def judged_by(turn: Turn) -> dict[str, float]:
    """Return what an accuracy is a part of, by output; of rare contact that of `rare` contact."""
    probability = max(turn.probability, SETTINGS.rare)
    length = turn.length * probability / turn.probability if turn.length else np.inf
    return {"breakthrough_probability": probability, "contact_length": length}


def _on(operation: Operation, times: float) -> Operation:
    """Return a case on some times the fewest points or a step more, a number that Fourier transforms are fast for."""
    from scipy.fft import next_fast_len

    assert not isinstance(operation.source, Measured)
    steps = np.ceil(SETTINGS.steps * np.log2(max(times, 1.0)) - 1e-6)
    points = LEAST_PER_WAVE * operation.source.modes * 2 ** (steps / SETTINGS.steps)
    number = min(4 * next_fast_len(int(np.ceil(points / 4 - 1e-9)), real=True), MOST_POINTS)
    return operation.on(replace(operation.source, points=number))
