"""From a block of rough rollers on a film of oil to arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import distinguishable
from mdr_dask.models.base import Block, Result, Status
from mdr_dask.models.mixed_lubrication import points
from mdr_dask.models.mixed_lubrication.declaration import MODEL, MixedLubrication, coordinates
from mdr_dask.models.mixed_lubrication.lines import Source
from mdr_dask.models.mixed_lubrication.operation import NoFilmError, Operation, fixed_values, operation_of
from mdr_dask.models.mixed_lubrication.turn import (
    SETTINGS,
    Turn,
    creeping,
    profiles,
    rolling,
    trace,
    turn_values,
)
from mdr_dask.models.parts.accuracy import missed, share

#: Film ratio below which overlapping asperities merge into clusters that no longer break.
FILM_RATIO_WARNING = 0.5
#: Outputs of the turn of two lines, beside traces and profiles.
_OF_TURN = {"breakthrough_probability", "turn_error"} | points.OF_LENGTH
#: What a value that is zero within its error is a part of.
_WHOLE = {"asperity_load_share": 1.0}
_PROFILES = {"upper_profile", "lower_profile"}


def compute(block: Block[MixedLubrication]) -> Result:
    """Return the values of a block; one realisation is one turn of the rollers with lines of its own.

    Cases that differ in load, speed, temperature, rms height or layer share the lines of a realisation.
    """
    result = _empty(block)
    groups: dict[Source, list[tuple[int, Operation]]] = {}
    for index in range(block.cases):
        case = block.case(index)
        problem = case.problem()
        if problem:
            _refuse(result, index, Status.FAILED, problem)
            continue
        try:
            operation = points.first(operation_of(case, block.accuracy), block.accuracy)
        except NoFilmError as error:
            _refuse(result, index, Status.NOT_CONVERGED, str(error))
            continue
        groups.setdefault(operation.source, []).append((index, operation))
        fixed = fixed_values(operation)
        _store(result, block, index, slice(None), fixed)
        _warn(result, block, index, operation)
        for position in range(len(block.realisations)):
            _note(result, index, position, _missed(block, fixed))
        result.status[index] = Status.DONE
    if _OF_TURN & set(block.outputs):
        for source, members in groups.items():
            for position in range(len(block.realisations)):
                _realise(result, block, source, members, position)
    return replace(result, solves=sum(map(len, groups.values())) * len(block.realisations))


def _empty(block: Block[MixedLubrication]) -> Result:
    sizes = {name: coordinate.values.size for name, coordinate in coordinates(block.parameters).items()}
    shape = (block.cases, len(block.realisations))
    values = {
        name: np.full((*shape, *(sizes[dim] for dim in MODEL.output(name).dims)), np.nan) for name in block.outputs
    }
    return Result(values, np.full(shape, Status.MISSING, dtype=np.int8))


def _refuse(result: Result, index: int, status: Status, why: str) -> None:
    """Give up a case in all its realisations."""
    result.status[index] = status
    result.messages.update({(index, position): why for position in range(result.status.shape[1])})


def _store(
    result: Result, block: Block[MixedLubrication], index: int, position: int | slice, found: Mapping[str, Any]
) -> None:
    for name in found.keys() & set(block.outputs):
        result.values[name][index, position] = found[name]


def _note(result: Result, index: int, position: int, note: str) -> None:
    """Add a sentence to the message of one case in one realisation."""
    if note:
        before = result.messages.get((index, position))
        result.messages[index, position] = f"{before}; {note}" if before else note


def _missed(
    block: Block[MixedLubrication],
    found: Mapping[str, float],
    advice: str = "",
    judged_by: Mapping[str, float] | None = None,
) -> str:
    """Say which outputs asked for miss the accuracy of the campaign and by how much; an empty string if none does.

    Some are judged by another value than their own.
    """
    if block.accuracy is None:
        return ""
    values = {**found, **(judged_by or {})}
    known = {name: values[name] for name in block.outputs if np.isfinite(values.get(name, np.nan))}
    shares = {
        name: float(share(found.get(f"{name}_error", 0.0), value, _WHOLE.get(name, 0.0)))
        for name, value in known.items()
    }
    told = missed(shares, block.accuracy)
    return f"{told}{advice}" if told else ""


def _realise(
    result: Result,
    block: Block[MixedLubrication],
    source: Source,
    members: list[tuple[int, Operation]],
    position: int,
) -> None:
    """Compute the cases of one pair of lines in one realisation.

    Those that miss the accuracy, where it chooses the points, follow on finer lines.
    """
    drawn = block.seed, block.realisations[position]
    lines, together = cache(partial(source.lines, *drawn)), cache(partial(source.together, *drawn))

    def solve(operation: Operation, compared: int = 0) -> Turn:
        if operation.case.slide_roll_ratio == 0:
            return rolling(operation, together(compared > 0), compared)
        return creeping(operation, lines(compared > 0), compared)

    again: dict[Source, list[tuple[int, Operation]]] = {}
    for index, operation in members:
        turn = solve(operation)
        errors = cache(partial(_errors, turn, partial(solve, operation), block))
        finer = points.finer(operation, turn, errors, block.accuracy, block.outputs)
        if finer is not None:
            again.setdefault(finer.source, []).append((index, finer))
            continue
        found = turn_values(operation, turn, errors, block.outputs)
        _store(result, block, index, position, found)
        advice = "" if operation.case.points == "auto" else "; raise points"
        _note(result, index, position, _missed(block, found, advice, points.judged_by(turn)))
        if "contact_length_trace" in block.outputs:
            _store(
                result, block, index, position, {"contact_length_trace": trace(operation, turn, partial(lines, False))}
            )
        if _PROFILES & set(block.outputs):
            _store(result, block, index, position, profiles(operation, turn, lines(False)))
    for finer_source, members_again in again.items():
        _realise(result, block, finer_source, members_again, position)


def _errors(turn: Turn, solve: Callable[[int], Turn], block: Block[MixedLubrication]) -> FloatArray:
    """Return the errors of a turn from its first parts on other lines, or from all parts where those miss the accuracy.

    All parts know change and scatter better, and cost less than a turn on more points.
    """
    other = solve(SETTINGS.sample)
    errors = turn.errors(other)
    if block.accuracy is None or other.parts == turn.parts:
        return errors
    if points.miss(turn, errors, block.accuracy, block.outputs) <= 1:
        return errors
    return turn.errors(solve(1))


def _warn(result: Result, block: Block[MixedLubrication], index: int, operation: Operation) -> None:
    """Say once a case, at realisation 0, where an assumption behind it fails, whatever outputs are asked for."""
    if 0 not in block.realisations:
        return
    position = block.realisations.index(0)
    ratio = operation.film / operation.rms
    _note(result, index, position, operation.warning)
    if ratio < FILM_RATIO_WARNING:
        told, least = distinguishable(ratio, FILM_RATIO_WARNING, digits=2)
        what = f"film ratio {told} is below {least}: overlaps merge into clusters that do not break"
        _note(result, index, position, f"{what}, the probability is too low")
