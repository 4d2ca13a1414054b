"""Mixed lubrication of two rough rollers with breakthrough of the boundary layer (thesis chapter 5)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mdr_dask.models.base import Block, Coordinate, Model, Output, Result, Status
from mdr_dask.models.mixed_lubrication.lines import Source
from mdr_dask.models.mixed_lubrication.operation import Operation, fixed_values, operation_of
from mdr_dask.models.mixed_lubrication.parameters import MixedLubrication
from mdr_dask.models.mixed_lubrication.turn import POSITIONS, Turn, creeping, profiles, rolling, trace, turn_values

if TYPE_CHECKING:
    from mdr_dask.physics.lubrication.breakthrough import Excursions

LOAD_SHARE_WARNING = 0.03  # of the load on asperities, beyond which the film formula no longer holds
FILM_RATIO_WARNING = 0.5  # below it overlapping asperities merge into clusters that no longer break


OUTPUTS = (
    Output("breakthrough_probability", "1", "share of time with the boundary layer broken anywhere"),
    Output("contact_length", "m", "mean length in intimate contact"),
    Output("film", "m", "film thickness h0"),
    Output("film_ratio", "1", "film thickness over combined rms height"),
    Output("load_share", "1", "share of the load on overlapping asperities"),
    Output("discretisation_error", "1", "breakthrough probability less that on every second point"),
    Output("turn_error", "1", "standard error of the probability of one turn, from its batches", default=False),
    Output("contact_conductance", "S", "mean electrical conductance of the spots in contact", default=False),
    Output("contact_resistance", "ohm", "reciprocal of the mean conductance, infinite without contact", default=False),
    Output("friction_coefficient", "1", "coefficient of friction of film and spots in contact", default=False),
    Output("contact_half_width", "m", "half width a of the Hertzian contact", default=False),
    Output("contact_length_trace", "m", "length in intimate contact over the turn", ("angle",), default=False),
    Output("upper_profile", "m", "surface of roller 1 where contact is greatest", ("position",), default=False),
    Output("lower_profile", "m", "surface of roller 2 where contact is greatest", ("position",), default=False),
)


def coordinates(parameters: MixedLubrication) -> dict[str, Coordinate]:
    """Return the angles of a trace and the places, in half widths, of the profiles."""
    angles = 2 * np.pi * np.arange(parameters.trace_points) / parameters.trace_points
    return {
        "angle": Coordinate(angles, "rad", "rolling angle"),
        "position": Coordinate(POSITIONS, "1", "distance from the middle of the contact over its half width"),
    }


_UNROUGH = {"film", "film_ratio", "contact_half_width"}
_PROFILES = {"upper_profile", "lower_profile"}


def compute(block: Block[MixedLubrication]) -> Result:
    """Return the values of a block; one realisation is one turn of the rollers with lines of its own.

    Cases that differ in load, speed, temperature, rms height or layer share the lines of a realisation and, in pure
    rolling, the search for points above the film: it goes from the thinnest film to the thickest.
    """
    result = _empty(block)
    groups: dict[Source, list[tuple[int, Operation]]] = {}
    for index in range(block.cases):
        case = block.case(index)
        problem = case.problem()
        if problem:
            _refuse(result, index, Status.FAILED, problem)
            continue
        operation = operation_of(case)
        if operation.problem:
            _refuse(result, index, Status.NOT_CONVERGED, operation.problem)
            continue
        groups.setdefault(operation.source, []).append((index, operation))
        _store(result, block, index, slice(None), fixed_values(operation))
    shares: dict[int, float] = {}
    if set(block.outputs) - _UNROUGH:
        for source, members in groups.items():
            members.sort(key=lambda member: member[1].level)
            for position, realisation in enumerate(block.realisations):
                carried = _realise(result, block, source, members, position)
                shares |= carried if realisation == 0 else {}
    for members in groups.values():
        for index, operation in members:
            result.status[index] = Status.DONE
            _warn(result, block, index, operation, shares.get(index, 0.0))
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


def _realise(
    result: Result,
    block: Block[MixedLubrication],
    source: Source,
    members: list[tuple[int, Operation]],
    position: int,
) -> dict[int, float]:
    """Compute the cases of one pair of lines in one realisation, from the thinnest film to the thickest.

    Returns the share of the load on asperities of each case.
    """
    from mdr_dask.physics.lubrication import breakthrough

    lines = source.lines(block.seed, block.realisations[position])
    above: Excursions | None = None
    shares = {}
    wanted = {"load_share", *block.outputs}
    for index, operation in members:
        solve: Callable[..., Turn] = partial(creeping, operation, lines)
        if operation.case.slide_roll_ratio == 0:
            level = operation.level
            above = breakthrough.excursions(lines[0] + lines[1], level) if above is None else above.above(level)
            solve = partial(rolling, operation, above)
        turn = solve()
        found = turn_values(operation, turn, partial(solve, coarser=2), wanted)
        shares[index] = found["load_share"]
        _store(result, block, index, position, found)
        if "contact_length_trace" in block.outputs:
            _store(result, block, index, position, {"contact_length_trace": trace(operation, turn, lines)})
        if _PROFILES & set(block.outputs):
            _store(result, block, index, position, profiles(operation, turn, lines))
    return shares


def _warn(result: Result, block: Block[MixedLubrication], index: int, operation: Operation, share: float) -> None:
    """Say once a case, at realisation 0, where an assumption behind it fails, whatever outputs are wanted."""
    if 0 not in block.realisations:
        return
    position = block.realisations.index(0)
    ratio = operation.film / (operation.scale * operation.source.combined_rms())
    warnings = [operation.warning] if operation.warning else []
    if ratio < FILM_RATIO_WARNING:
        warnings.append(
            f"film ratio {ratio:.2g} is below {FILM_RATIO_WARNING}: overlaps merge into clusters that do not break, "
            "the probability is too low"
        )
    if share > LOAD_SHARE_WARNING:
        warnings.append(
            f"asperities carry {share:.1%} of the load, more than {LOAD_SHARE_WARNING:.0%}: the film is no longer that "
            "of smooth rollers"
        )
    if warnings:
        result.messages[index, position] = "; ".join(warnings)


def seconds(block: Block[MixedLubrication]) -> float:
    """Estimate the time of a block from points, cases and creep."""
    millions = np.asarray(block.column("points"), dtype=np.float64) / 1e6
    creep = np.asarray(block.column("slide_roll_ratio"), dtype=np.float64) != 0
    lines = 0.06 * float(millions.max())
    return len(block.realisations) * (lines + float(np.sum(millions * np.where(creep, 0.06, 0.002))))


MODEL = Model(
    name="mixed_lubrication",
    version=2,
    summary="breakthrough of the boundary layer between two rough rollers on an oil film",
    parameters=MixedLubrication,
    outputs=OUTPUTS,
    compute=compute,
    seconds=seconds,
    whole=(
        "normal_force",
        "rotation_speed",
        "temperature",
        "slide_roll_ratio",
        "rms_roughness",
        "pressure_viscosity",
        "layer_thickness",
        "layer_shear_strength",
        "film_formula",
        "film_thickness",
    ),
    coordinates=coordinates,
)
