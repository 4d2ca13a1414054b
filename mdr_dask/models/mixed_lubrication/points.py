"""How many points a line gets where a case asks for an accuracy instead of points."""

from __future__ import annotations

from collections.abc import Callable
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


class Settings(NamedTuple):
    """Numbers of the choice, from ``python -m benchmarks mixed honesty``.

    Parameters
    ----------
    first, order : float
        The error stated with one spacing a shortest wave, over the coarseness of that spacing, and the power of the
        spacing that it falls like.
    steps : int
        First numbers of points in a factor of two: few, so that cases of other layers share lines.
    further : int
        Times the first points that a turn gets at most.
    once : float
        Errors over the accuracy up to which twice the points are tried before four times.
    rare : float
        Probability below which an accuracy is that of this probability.
    """

    first: float = 15.0
    order: float = 1.5
    steps: int = 4
    further: int = 4
    once: float = 3.0
    rare: float = 0.01


SETTINGS = Settings()


def first(operation: Operation, accuracy: float | None) -> Operation:
    """Return the case on the points that its layer and its shortest wave ask for, or as it is if it names them."""
    source = operation.source
    if isinstance(source, Measured) or operation.case.points != "auto":
        return operation
    waves = source.modes
    of_a_wave = operation.coarseness * source.points / waves
    per_wave = max(LEAST_PER_WAVE, (SETTINGS.first * of_a_wave / (accuracy or ACCURACY)) ** (1 / SETTINGS.order))
    steps = np.ceil(SETTINGS.steps * np.log2(per_wave / LEAST_PER_WAVE) - 1e-9)
    return _on(operation, waves * LEAST_PER_WAVE * 2 ** (steps / SETTINGS.steps))


def finer(
    operation: Operation, turn: Turn, errors: Callable[[], FloatArray], accuracy: float | None
) -> Operation | None:
    """Return the case on more points if its turn misses the accuracy and may have more, None otherwise."""
    begun = first(operation, accuracy)
    if begun is operation:
        return None
    most = _on(begun, begun.source.points * SETTINGS.further)
    if operation.source.points >= most.source.points:
        return None
    miss = _relative(turn, errors()) / (accuracy or ACCURACY)
    if miss <= 1:
        return None
    return most if miss > SETTINGS.once else _on(operation, min(operation.source.points * 2, most.source.points))


def _relative(turn: Turn, errors: FloatArray) -> float:
    """Return the larger relative error of probability and contact length."""
    common = min(1.0, turn.probability / SETTINGS.rare)
    of_points = errors[1] / turn.points * common if turn.points else 0.0
    return float(max(errors[0] / max(turn.probability, SETTINGS.rare), of_points))


def _on(operation: Operation, points: float) -> Operation:
    """Return a case on at least so many points, of a number that Fourier transforms are fast for."""
    from scipy.fft import next_fast_len

    assert not isinstance(operation.source, Measured)
    number = min(4 * next_fast_len(int(np.ceil(points / 4 - 1e-9)), real=True), MOST_POINTS)
    return operation.on(replace(operation.source, points=number))
