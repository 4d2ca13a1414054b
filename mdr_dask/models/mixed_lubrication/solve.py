"""Solution of a block of cases of mixed lubrication of two rough rollers."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.models.base import Block, Result, Status
from mdr_dask.models.mixed_lubrication.declaration import DRAWN, MODEL, WAVES, MixedLubrication
from mdr_dask.models.mixed_lubrication.lines import LEAST_PER_WAVE, Source
from mdr_dask.models.mixed_lubrication.operation import NoFilmError, Operation, fixed_values, operation_of
from mdr_dask.models.mixed_lubrication.revolution import WINDOWS, Revolution, drawn, revolve, values
from mdr_dask.models.parts.accuracy import missed_accuracy
from mdr_dask.physics.lubrication import line_contact
from mdr_dask.physics.refine import Solution, refine

#: `_OF_LENGTH`: outputs that need the length in intimate contact. `_OF_LINES`: outputs that need rough lines.
_OF_LENGTH = {"contact_length", "contact_conductance", "contact_resistance", *DRAWN}
_OF_LINES = {"breakthrough_probability", "revolution_error", *_OF_LENGTH}
#: Outputs that can be zero, each with a floor. If an output is below its floor, its absolute error is divided by the
#: floor and not by the output. The floor of the contact length is a fraction of the width of the contact.
_FLOORS = {"asperity_load_share": 1.0, "breakthrough_probability": 0.1, "contact_length": 0.01}
#: Parameters on which the rough lines depend. Cases have the same lines if all these parameters are equal.
_SHARED = {
    *("points", "hurst", "longest_wavelength", "shortest_wavelength", "cutoff_force", "surface_1", "surface_2"),
    *("roller_radius", "roller_width", "contact_modulus"),
}


def compute(block: Block[MixedLubrication]) -> Result:
    """Solve the cases of a block. One realisation is one revolution of the rollers.

    The lines have random phases, or they are measured lines that begin at random points.

    In each realisation, cases that differ only in load, speed, temperature, rms height or boundary layer have the same
    lines, apart from the scale of the heights.
    """
    shape = (block.cases, len(block.realisations))
    result = Result(MODEL.empty_arrays(block, shape), np.full(shape, Status.MISSING, dtype=np.int8))
    groups: dict[Source, list[tuple[int, Operation]]] = {}
    for index in range(block.cases):
        case = block.case(index)
        problem, status = case.problem(), Status.FAILED
        if not problem:
            try:
                operation = operation_of(case, block.accuracy)
            except NoFilmError as error:
                problem, status = str(error), Status.NOT_CONVERGED
        if problem:
            result.status[index] = status
            result.messages.update({(index, position): problem for position in range(len(block.realisations))})
            continue
        groups.setdefault(operation.source, []).append((index, operation))
        fixed = fixed_values(operation)
        if 0 in block.realisations:
            for warning in _warnings(operation, block.outputs):
                result.add_message(index, block.realisations.index(0), warning)
        relative = {
            name: fixed[f"{name}_error"] / max(fixed[name], _FLOORS.get(name, 0.0))
            for name in fixed
            if fixed.get(f"{name}_error", 0.0) > 0
        }
        for position in range(len(block.realisations)):
            _store(result, block, (index, position), fixed, relative)
        result.status[index] = Status.DONE
    if _OF_LINES & set(block.outputs):
        for source, members in groups.items():
            for position in range(len(block.realisations)):
                _realise(result, block, source, members, position)
    return replace(result, solves=sum(map(len, groups.values())) * len(block.realisations))


def _store(
    result: Result,
    block: Block[MixedLubrication],
    at: tuple[int, int],
    found: Mapping[str, Any],
    errors: Mapping[str, float],
    advice: str = "",
) -> None:
    """Store outputs of a case and realisation, and add a message if the relative `errors` miss the accuracy."""
    for name in found.keys() & set(block.outputs):
        result.values[name][at] = found[name]
    if block.accuracy is not None:
        stated = {name: [error] for name, error in errors.items() if name in block.outputs}
        for text in missed_accuracy({name: [1.0] for name in stated}, stated, block.accuracy).values():
            result.add_message(*at, text + advice)


def _realise(
    result: Result,
    block: Block[MixedLubrication],
    source: Source,
    members: list[tuple[int, Operation]],
    position: int,
) -> None:
    """Compute one realisation of all cases with the same lines."""
    lines = lru_cache(maxsize=1)(partial(source.lines, block.seed, block.realisations[position]))
    found: list[Revolution] = [None] * len(members)  # type: ignore[list-item]
    arrays: list[dict[str, FloatArray]] = [{}] * len(members)
    with_length = bool(_OF_LENGTH & set(block.outputs))

    def solve(points: int, which: IntArray) -> Solution:
        for k in which:
            operation = members[k][1]
            found[k] = revolve(operation, lines(points))
            arrays[k] = drawn(operation, found[k], lines(points), block.outputs)
        outputs = [np.array([found[k].probability for k in which])]
        if with_length:
            outputs.append(np.array([found[k].length / members[k][1].width for k in which]))
        return Solution(outputs, np.zeros(which.size, np.int8))

    floors = [_FLOORS["breakthrough_probability"], _FLOORS["contact_length"]][: 1 + with_length]
    points = source.points
    if block.accuracy is None:  # two grids if errors are requested, otherwise one grid
        points = points[:2] if any(f"{name}_error" in block.outputs for name in _OF_LINES) else points[:2][-1:]
    accuracy = block.accuracy or np.inf
    # The assumed order of convergence is only 1, because a single cluster may break the layer on one grid but not on
    # the next grid, and because contact may begin between two windows. The splines themselves converge faster.
    errors = refine(solve, len(members), points, accuracy, order=1, floors=floors).errors
    for k, (index, operation) in enumerate(members):
        of_length = errors[-1, k] * operation.width if with_length else np.nan
        numbers = values(operation, found[k], np.array([errors[0, k], of_length])) | arrays[k]
        relative = {
            "breakthrough_probability": errors[0, k] / max(found[k].probability, _FLOORS["breakthrough_probability"])
        }
        if with_length:  # conductance and resistance have the same relative error as the length
            of_all = errors[-1, k] / max(found[k].length / operation.width, _FLOORS["contact_length"])
            relative |= dict.fromkeys(("contact_length", "contact_conductance", "contact_resistance"), of_all)
        advice = "" if operation.case.points == "auto" else " (increase `points`)"
        _store(result, block, (index, position), numbers, relative, advice)


def _warnings(operation: Operation, outputs: Collection[str]) -> Iterator[str]:
    """Yield a warning for each assumption of the model that does not hold in a case."""
    if operation.warning:
        yield operation.warning
    if operation.squares < 1:
        yield (
            "a rough line represents a square with the longest wavelength as edge, but the rollers are narrower than "
            "this square (give a smaller longest_wavelength)"
        )
    if operation.film / operation.rms < 0.5 and _OF_LINES & set(outputs):
        yield (
            "the film ratio is below 0.5: asperities merge into large clusters that do not "
            "break the layer, so the probability is too low"
        )


def operations(block: Block[MixedLubrication]) -> float:
    """Return the approximate number of operations of a block. Only the two coarsest grids of every case are counted.

    Each point needs about 40 operations to make the lines, and 10 operations in each case. With sliding, a case is
    assumed to need `WINDOWS` times as many operations, because each point lies in several windows. An EHL film needs
    about ten solutions to find the load shares.
    """
    columns = (block.column(name) for name in ("points", "shortest_wavelength", "roller_radius"))
    points_of = np.empty(block.cases)
    for case, (points, shortest, radius) in enumerate(zip(*columns, strict=True)):
        waves = WAVES if shortest == "auto" else 2 * np.pi * radius / shortest
        points_of[case] = 3 * LEAST_PER_WAVE * waves if points == "auto" else 1.5 * points
    sliding = block.numbers("slide_roll_ratio") != 0
    of_cases = 10.0 * float(np.sum(np.where(sliding, WINDOWS, 1) * points_of))
    keys = [path for path in block.columns if path.partition(".")[0] in _SHARED]
    lines = {tuple(str(block.columns[key][k]) for key in keys): points_of[k] for k in range(block.cases)}
    films = 10.0 * line_contact.operations(block.accuracy or line_contact.ACCURACY)
    solved = int(np.sum(block.column("film_formula") == "ehl"))
    return films * solved + len(block.realisations) * float(40.0 * sum(lines.values()) + of_cases)
