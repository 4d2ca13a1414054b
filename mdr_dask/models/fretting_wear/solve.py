"""Solution of a block of cases of fretting wear.

With the exact rule and no load history, cases with the same body, stick radius and `hold` share one solution. This
solution gives the results at all numbers of cycles.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.models.base import Block, Result, Status
from mdr_dask.models.fretting_wear.declaration import FAST_AT_DEPTH, MODEL, FrettingWear, Indenter, Table
from mdr_dask.models.fretting_wear.reduction import (
    Numbers,
    has_tables,
    indenters,
    reduce_block,
    table_profile,
)
from mdr_dask.models.parts.accuracy import ACCURACY, missed_accuracy
from mdr_dask.physics.mdr.revolution import PowerProfile, Profile
from mdr_dask.physics.wear import rules
from mdr_dask.physics.wear.accuracy import Checked, checked, checked_exact, checked_history
from mdr_dask.physics.wear.exact import operations as exact_operations
from mdr_dask.physics.wear.history import LoadBlock
from mdr_dask.physics.wear.worn import virgin_load

#: Quantities that `rules.limit_cases` and `rules.fast_cases` compute for many cases at once, and the stick border.
_CLOSED_FORMS = ("contact_radius", "wear_volume", "normal_force", "stick_border")
#: For each output that has another name in `Worn`, the name in `Worn`. The output `contact_force` cannot be called
#: `normal_force`, because a parameter already has this name.
_RENAMED = {"contact_force": "normal_force", "worn_profile": "height", "worn_image": "image"}

#: Indices (case, realisation) in a block.
Places = list[tuple[int, int]]


@dataclass(frozen=True)
class Task:
    """The body before wear, and all data of a case except the number of cycles N and the factor xi of the fast rule.

    Several cases can have the same task. `extent` is the last radius of the profiles, divided by a0.
    """

    profile: Profile
    level: float
    rule: str
    hold: str
    cells: int
    blocks: tuple[LoadBlock, ...]
    extent: float


def compute(block: Block[FrettingWear]) -> Result:
    """Compute all cases of a block."""
    numbers, messages, status = _reduced(block)
    wanted = [name for name in block.outputs if name != "status"]
    values = {name: np.full(status.shape + _sizes(block.parameters, name), np.nan) for name in wanted}
    if _is_plain(block):
        solves = _solve_plain(block, numbers, values, status == Status.DONE)
    else:
        solves = _solve_each(block, numbers, values, status, messages)
    _scale(values, numbers)
    return Result(values, status, messages, solves)


def operations(block: Block[FrettingWear]) -> float:
    """Return the approximate number of operations of a block."""
    parameters, size = block.parameters, block.cases * len(block.realisations)
    if _is_plain(block):
        return 1e4 * size  # about ten integrals with 64 nodes
    if parameters.history:
        return 120.0 * parameters.cells**3 * size  # 12 n^2 operations in each of about 10 n steps, for n cells
    numbers, _ = reduce_block(block)
    of_profiles = 1e4 * parameters.points  # integrals over about 20 pieces, with 24 nodes each
    total = 0.0
    for force in (False, True):
        held = np.asarray((block.column("hold") == "force") == force)
        marched = held & np.asarray(force | (block.column("wear_rule") == "exact"))
        if marched.any():
            solution = exact_operations(block.accuracy or ACCURACY, constant_force=force)
            total += solution * _count(numbers.exponent[marched], numbers.level[marched])
        if held.any():
            every = numbers.exponent, numbers.level, numbers.cycles, numbers.xi
            total += of_profiles * _count(*(part[held] for part in every))
    return 2 * total  # the coarser solutions of the error estimate together need about as many operations


def _reduced(block: Block[FrettingWear]) -> tuple[Numbers, dict[tuple[int, int], str], NDArray[np.int8]]:
    """Return the dimensionless numbers of a block, messages about invalid cases, and the status of every case."""
    numbers, messages = reduce_block(block)
    status = np.full(numbers.level.shape, Status.DONE, dtype=np.int8)
    for position in messages:
        status[position] = Status.FAILED
    return numbers, messages, status


def _plain_name(name: str) -> tuple[str, bool]:
    """Return the quantity of `Worn` for the output `name`, and whether the output is the error of this quantity."""
    owners = {companion.name: owner for owner, companion in MODEL.companions.items()}
    plain = owners.get(name, name).removeprefix("block_")
    return _RENAMED.get(plain, plain), name in owners


def _sizes(parameters: FrettingWear, name: str) -> tuple[int, ...]:
    """Return the shape that an output has for one case and one realisation."""
    lengths = {"block": max(len(parameters.history), 1)}
    return tuple(lengths.get(dim, parameters.points) for dim in MODEL.output(name).dims)


def _scale(values: dict[str, FloatArray], numbers: Numbers) -> None:
    """Multiply the outputs of each case, and their errors, by their units. The arrays in `values` are changed.

    The units follow from those of length, height and force. In a dimensionless campaign, they are 1.
    """
    units = {
        "contact_radius": numbers.length,
        "stick_border": numbers.length,
        "depth": numbers.height,
        "wear_volume": numbers.length**2 * numbers.height,
        "normal_force": numbers.force,
        "height": numbers.height,
        "image": numbers.height,
        "worn_depth": numbers.height,
        "pressure": numbers.force / numbers.length**2,
    }
    for name, array in values.items():
        unit = units[_plain_name(name)[0]]
        array *= unit.reshape(unit.shape + (1,) * (array.ndim - 2))


def _is_plain(block: Block[FrettingWear]) -> bool:
    """Return whether `rules.limit_cases` and `rules.fast_cases` can compute all requested outputs of a block.

    These functions are for power laws at constant depth without a load history, with the wear rule `limit` or `fast`.
    """
    simple = set(block.columns.get("wear_rule", [block.parameters.wear_rule])) <= {"limit", "fast"}
    depth = set(block.columns.get("hold", [block.parameters.hold])) == {"depth"}
    wanted = {
        name if name == "status" else _plain_name(name)[0] for name in block.outputs if not name.startswith("block")
    }
    blocks = any(name.startswith("block") for name in block.outputs)
    plain_load = depth and not block.parameters.history and "history" not in block.columns
    return simple and plain_load and not blocks and not has_tables(block) and wanted <= {*_CLOSED_FORMS, "status"}


def _solve_plain(
    block: Block[FrettingWear], numbers: Numbers, values: dict[str, FloatArray], good: NDArray[np.bool_]
) -> int:
    """Compute the cases of a block together, by `rules.limit_cases` and `rules.fast_cases`.

    `good` is the mask of the cases and realisations to compute. Write the results to `values`, and return the number of
    distinct cases. Each distinct case is computed only once.
    """
    is_fast = np.asarray(block.column("wear_rule") == "fast")
    fast = np.broadcast_to(is_fast[:, None], good.shape)[good]
    cycles, xi = np.where(fast, numbers.cycles[good], np.inf), np.where(fast, numbers.xi[good], 0.0)
    rows, back = _distinct(np.stack([numbers.exponent[good], numbers.level[good], cycles, xi]))
    pairs, to_pair = _distinct(rows[:2])
    results = rules.limit_cases(pairs[0], pairs[1] ** (1.0 / pairs[0]))[:, to_pair]
    finite = np.isfinite(rows[2])
    n, level, cycles, xi = rows[:, finite]
    stick = rows[1] ** (1.0 / rows[0])
    results[:, finite] = rules.fast_cases(n, level ** (1.0 / n), cycles, xi, results[0, finite])
    found = dict(zip(_CLOSED_FORMS, (*results, stick), strict=True))
    for name, array in values.items():
        plain, is_error = _plain_name(name)
        array[good] = (rules.ERROR if is_error else 1.0) * found[plain][back]
    return int(rows.shape[1])


def _distinct(rows: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the distinct columns of an array, and for every column its index among the distinct columns."""
    columns, back = np.unique(rows, axis=1, return_inverse=True)
    return columns, back.ravel()


def _count(*parts: FloatArray) -> int:
    return int(np.unique(np.stack([np.nan_to_num(part).ravel() for part in parts]), axis=1).shape[1])


def _solve_each(
    block: Block[FrettingWear],
    numbers: Numbers,
    values: dict[str, FloatArray],
    status: NDArray[np.int8],
    messages: dict[tuple[int, int], str],
) -> int:
    """Solve each task for all its pairs (N, xi) and write the results. Return the number of solutions."""
    solves = 0
    for task, wanted in _tasks(block, numbers, status).items():
        places = np.linspace(0.0, task.extent, block.parameters.points)
        try:
            contacts = _contacts(task, list(wanted), block, places)
        except (ValueError, ArithmeticError) as problem:
            kind = Status.FAILED if isinstance(problem, ValueError) else Status.NOT_CONVERGED
            for position in (p for positions in wanted.values() for p in positions):
                status[position], messages[position] = kind, str(problem)
            continue
        solves += _solves_of(task, wanted)
        for positions, records in zip(wanted.values(), contacts, strict=True):
            remarks = _missed(records, block, places), _cut_off(records, block, task.extent)
            text = "; ".join(remark for remark in remarks if remark)
            for name, array in values.items():
                answer = _answer(records, name, places)
                for position in positions:
                    array[position] = answer
            messages.update(dict.fromkeys(positions, text) if text else {})
    return solves


def _answer(records: Sequence[Checked], name: str, places: FloatArray) -> float | FloatArray:
    """Return one output of a solution, or the error of an output.

    An output ``block_...`` has one row for each block of the load history. Any other output belongs to the last block.
    """
    plain, is_error = _plain_name(name)
    answers = []
    for one in records if name.startswith("block_") else records[-1:]:
        value = one.worn.value(plain, places)
        answers.append(np.where(np.isfinite(value), one.errors[plain], np.nan) if is_error else value)
    return np.array(answers) if name.startswith("block_") else answers[0]


def _cut_off(records: Sequence[Checked], block: Block[FrettingWear], extent: float) -> str:
    """Return a message if a requested profile ends inside the wear scar, or else an empty string."""
    widest = max(one.worn.contact_radius for one in records)
    if widest <= extent or not any({"radius", "position"} & {*MODEL.output(name).dims} for name in block.outputs):
        return ""
    name = "extent" if block.parameters.last_radius is None else "last_radius"
    return (
        f"the profiles end at {extent:.4g} a0, inside the wear scar, which has the radius {widest:.4g} a0; raise {name}"
    )


def _missed(records: Sequence[Checked], block: Block[FrettingWear], places: FloatArray) -> str:
    """Return a message about the outputs that miss the accuracy, or an empty string if there are no such outputs."""
    if block.accuracy is None:
        return ""

    def finite(name: str) -> FloatArray:
        """Return an output as an array with one row. Infinite values, such as pressures at sharp tips, become NaN."""
        answer = np.asarray(_answer(records, name, places))
        return np.where(np.isfinite(answer), answer, np.nan)[None]

    errors = {name: error.name for name, error in MODEL.companions.items() if name in block.outputs}
    values = {name: finite(name) for name in errors}
    return missed_accuracy(values, {name: finite(error) for name, error in errors.items()}, block.accuracy).get(0, "")


def _solves_of(task: Task, wanted: Collection[tuple[float, float]]) -> int:
    """Return the number of solutions of a task: 1, or the number of pairs (N, xi) if each pair needs a solution."""
    marched = task.rule == "sliding" or (task.rule == "exact" and not task.blocks)
    return 1 if marched or task.rule == "limit" else len(wanted)


def _tasks(
    block: Block[FrettingWear], numbers: Numbers, status: NDArray[np.int8]
) -> dict[Task, dict[tuple[float, float], Places]]:
    """Return, for every task and every pair (N, xi) of the task, the indices (case, realisation) of the results."""
    tasks: dict[Task, dict[tuple[float, float], Places]] = {}
    bodies = indenters(block)
    for case in range(block.cases):
        parameters = block.case(case)
        for position in range(len(block.realisations)):
            place = (case, position)
            if status[place] != Status.DONE:
                continue
            task = _task(parameters, bodies[case % len(bodies)], numbers, place)
            key = (float(numbers.cycles[place]), float(numbers.xi[place]) if task.rule == "fast" else 0.0)
            tasks.setdefault(task, {}).setdefault(key, []).append(place)
    return tasks


def _task(parameters: FrettingWear, indenter: Indenter, numbers: Numbers, place: tuple[int, int]) -> Task:
    n, level, height = (float(part[place]) for part in (numbers.exponent, numbers.level, numbers.height))
    profile = table_profile(indenter, height) if isinstance(indenter, Table) else PowerProfile(n)
    is_force = parameters.hold == "force"
    held = 2.0 * virgin_load(profile, 1.0) if is_force and parameters.history else 1.0
    blocks = tuple(
        LoadBlock(
            step.cycles * float(numbers.advance[place]) * (1.0 if parameters.dimensionless else step.amplitude_factor),
            (1.0 - level) * step.amplitude_factor,
            **{"force" if is_force else "depth": held * step.load_factor},
        )
        for step in parameters.history
    )
    return Task(
        profile,
        level,
        "sliding" if parameters.path is not None else parameters.wear_rule,
        parameters.hold,
        parameters.cells if blocks else 0,
        blocks,
        parameters.extent if parameters.last_radius is None else parameters.last_radius / float(numbers.length[place]),
    )


def _judged(block: Block[FrettingWear]) -> set[str]:
    """Return the quantities of `Worn` whose errors are stored or must meet the accuracy."""
    return {
        _plain_name(name)[0]
        for name, companion in MODEL.companions.items()
        if companion.name in block.outputs or (name in block.outputs and block.accuracy is not None)
    }


def _contacts(
    task: Task, wanted: Sequence[tuple[float, float]], block: Block[FrettingWear], places: FloatArray
) -> list[list[Checked]]:
    """Solve a task for the pairs (N, xi) in `wanted`.

    Return the contacts of every pair: one for each block of a load history, or a single contact without a history.
    """
    profile, is_force = task.profile, task.hold == "force"
    outputs = sorted(_judged(block))
    if task.blocks:
        deepest = 2.0 if is_force else max(block.depth or 1.0 for block in task.blocks)
        reach = min(1.7 * deepest, profile.largest_radius)
        return [checked_history(profile, task.blocks, outputs, places, task.cells, reach)] * len(wanted)
    stick = profile.inside(task.level) if task.level > 0.0 else 0.0
    if task.rule == "fast":
        if is_force:
            raise ValueError(FAST_AT_DEPTH)
        return [[checked(rules.fast(profile, stick, cycles, xi), outputs, places)] for cycles, xi in wanted]
    amounts = [np.inf if task.rule == "limit" else amount for amount, _ in wanted]
    contacts = checked_exact(profile, stick, amounts, outputs, places, block.accuracy, constant_force=is_force)
    return [[contact] for contact in contacts]
