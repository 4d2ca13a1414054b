"""Compute the outputs of a block of rough rollers on an oil film."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.models.base import Block, Result, Status
from mdr_dask.models.mixed_lubrication import revolution
from mdr_dask.models.mixed_lubrication.declaration import MODEL, MixedLubrication, coordinates
from mdr_dask.models.mixed_lubrication.lines import Source
from mdr_dask.models.mixed_lubrication.operation import NoFilmError, Operation, fixed_values, operation_of
from mdr_dask.models.mixed_lubrication.revolution import Revolution
from mdr_dask.models.parts.accuracy import missed_accuracy

#: Film ratio below which overlapping asperities merge into large clusters that do not break the layer.
LEAST_FILM_RATIO = 0.5
#: Outputs that need the rough lines.
_OF_LINES = {"breakthrough_probability", "revolution_error"} | revolution.OF_LENGTH
#: Outputs, each with a magnitude. If the output is smaller, its error is relative to this magnitude.
_FLOORS = {"asperity_load_share": 1.0}
_PROFILES = {"upper_profile", "lower_profile"}
_ELECTRICAL = {"contact_conductance", "contact_resistance"}


def compute(block: Block[MixedLubrication]) -> Result:
    """Return the values of a block; one realisation is one revolution of the rollers with random lines.

    Cases that differ in load, speed, temperature, rms height or layer use the same lines in each realisation.
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
            operation = revolution.with_first_points(operation_of(case, block.accuracy), block.accuracy)
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
    if _OF_LINES & set(block.outputs):
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
    """Set the status of a case for all realisations, and give the reason as message."""
    result.status[index] = status
    result.messages.update({(index, position): why for position in range(result.status.shape[1])})


def _store(
    result: Result, block: Block[MixedLubrication], index: int, position: int | slice, found: Mapping[str, Any]
) -> None:
    for name in found.keys() & set(block.outputs):
        result.values[name][index, position] = found[name]


def _note(result: Result, index: int, position: int, note: str) -> None:
    """Append a note to the message of one case in one realisation."""
    if note:
        before = result.messages.get((index, position))
        result.messages[index, position] = f"{before}; {note}" if before else note


def _missed(
    block: Block[MixedLubrication],
    found: Mapping[str, float],
    advice: str = "",
    floors: Mapping[str, float] | None = None,
) -> str:
    """Return a message about requested outputs that miss the accuracy of the campaign, or an empty string."""
    if block.accuracy is None:
        return ""
    known = [name for name in block.outputs if np.isfinite(found.get(name, np.nan))]
    values, errors = (
        {name: [found[name]] for name in known},
        {name: [found.get(f"{name}_error", 0.0)] for name in known},
    )
    text = missed_accuracy(values, errors, block.accuracy, {**_FLOORS, **(floors or {})}).get(0, "")
    return f"{text}{advice}" if text else ""


def _realise(
    result: Result,
    block: Block[MixedLubrication],
    source: Source,
    members: list[tuple[int, Operation]],
    position: int,
) -> None:
    """Compute one realisation of all cases that share lines; repeat cases that miss the accuracy with more points."""
    drawn = block.seed, block.realisations[position]
    lines, together = cache(partial(source.lines, *drawn)), cache(partial(source.together, *drawn))

    def solve(operation: Operation, sample: bool = False) -> Revolution:
        if operation.case.slide_roll_ratio == 0:
            return revolution.rolling(operation, together(sample), sample)
        return revolution.creeping(operation, lines(sample), sample)

    def errors_of(operation: Operation, found: Revolution) -> FloatArray:
        return found.errors(solve(operation, sample=True))

    again: dict[Source, list[tuple[int, Operation]]] = {}
    for index, operation in members:
        window = solve(operation)
        errors = cache(partial(errors_of, operation, window))
        finer = revolution.with_more_points(operation, window, errors, block.accuracy, block.outputs)
        if finer is not None:
            again.setdefault(finer.source, []).append((index, finer))
            continue
        found: dict[str, Any] = revolution.values(operation, window, errors, block.outputs)
        advice = "" if operation.case.points == "auto" else "; raise points"
        sizes = window.sizes()
        if window.length:  # conductance and resistance have the relative error of the length
            factor = sizes["contact_length"] / window.length
            sizes |= {name: factor * found[name] for name in _ELECTRICAL & found.keys()}
        _note(result, index, position, _missed(block, found, advice, sizes))
        if "contact_length_trace" in block.outputs:
            found["contact_length_trace"] = revolution.trace(operation, window, partial(lines, False))
        if _PROFILES & set(block.outputs):
            found |= revolution.profiles(operation, window, lines(False))
        _store(result, block, index, position, found)
    for finer_source, members_again in again.items():
        _realise(result, block, finer_source, members_again, position)


def _warn(result: Result, block: Block[MixedLubrication], index: int, operation: Operation) -> None:
    """Add a warning to realisation 0 if an assumption of the model is violated."""
    if 0 not in block.realisations:
        return
    position = block.realisations.index(0)
    _note(result, index, position, operation.warning)
    if operation.film / operation.rms < LEAST_FILM_RATIO:
        text = (
            f"the film ratio is below {LEAST_FILM_RATIO}: asperities merge into large clusters that do not "
            "break the layer, so the "
        )
        _note(result, index, position, f"{text}probability is too low")
