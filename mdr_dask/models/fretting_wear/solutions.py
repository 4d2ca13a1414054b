"""Solutions that several cases share: each is computed once, for all the cycles asked of it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.models.base import Block, Status
from mdr_dask.models.fretting_wear.parameters import FrettingWear, TableShape
from mdr_dask.models.fretting_wear.reduction import Numbers, table_profile

if TYPE_CHECKING:
    from mdr_dask.physics.mdr.revolution import Profile
    from mdr_dask.physics.wear.exact import Slid
    from mdr_dask.physics.wear.history import Record
    from mdr_dask.physics.wear.worn import Worn

Contact: TypeAlias = "Worn | Slid | Loaded"


#: Outputs with a value for every block of a history, and what they are of one contact.
BLOCK_OUTPUTS = {
    "block_contact_radius": "contact_radius",
    "block_stick_border": "stick_border",
    "block_depth": "depth",
    "block_normal_force": "normal_force",
    "block_wear_volume": "wear_volume",
    "block_worn_profile": "worn_profile",
}


@dataclass(frozen=True)
class Loaded:
    """The contact at the end of every block of load."""

    records: Sequence[Record]


@dataclass(frozen=True)
class Task:
    """What makes a solution that several cases share: everything but the number of cycles and xi."""

    shape: object
    depth: float
    exponent: float
    level: float
    method: str
    hold: str
    tolerance: float
    cells: int
    blocks: tuple[tuple[float, float, float], ...]


def solve_each(
    block: Block[FrettingWear],
    numbers: Numbers,
    values: dict[str, FloatArray],
    status: NDArray[np.int8],
    messages: dict[tuple[int, int], str],
) -> int:
    """Solve one task after the other, with all the cycles asked of it."""
    solves = 0
    for task, wanted in tasks(block, numbers, status).items():
        try:
            contacts = _contacts(task, list(wanted))
        except (ValueError, ArithmeticError) as problem:
            kind = Status.FAILED if isinstance(problem, ValueError) else Status.NOT_CONVERGED
            for position in (p for positions in wanted.values() for p in positions):
                status[position], messages[position] = kind, str(problem)
            continue
        solves += solves_of(task, wanted)
        for positions, contact in zip(wanted.values(), contacts, strict=True):
            _write(block, values, positions, contact)
    return solves


def solves_of(task: Task, wanted: Collection[tuple[float, float]]) -> int:
    """Return how many solutions a task takes: one for all cycles if they are moments of one march, or none matter."""
    marched = task.method == "sliding" or (task.method == "exact" and not task.blocks)
    return 1 if marched or task.method == "limit" else len(wanted)


def tasks(
    block: Block[FrettingWear], numbers: Numbers, status: NDArray[np.int8]
) -> dict[Task, dict[tuple[float, float], list[tuple[int, int]]]]:
    """Gather the positions of each task by (N, xi)."""
    tasks: dict[Task, dict[tuple[float, float], list[tuple[int, int]]]] = {}
    for case in range(block.cases):
        parameters = block.case(case)
        for position in range(len(block.realisations)):
            place = (case, position)
            if status[place] != Status.DONE:
                continue
            task = _task(parameters, numbers, place)
            key = (float(numbers.cycles[place]), float(numbers.xi[place]) if task.method == "fast" else 0.0)
            tasks.setdefault(task, {}).setdefault(key, []).append(place)
    return tasks


def _task(parameters: FrettingWear, numbers: Numbers, place: tuple[int, int]) -> Task:
    dimensional = not parameters.dimensionless
    blocks = tuple(
        (
            step.cycles * float(numbers.advance[place]) * (step.amplitude_factor if dimensional else 1.0),
            step.amplitude_factor,
            step.load_factor,
        )
        for step in parameters.history
    )
    table = isinstance(parameters.shape, TableShape)
    return Task(
        parameters.shape if table else None,
        float(numbers.height[place]) if table else 1.0,
        0.0 if table else float(numbers.exponent[place]),
        float(numbers.level[place]),
        "sliding" if parameters.path is not None else parameters.method,
        parameters.hold,
        parameters.tolerance if _has_tolerance(parameters) else 0.0,
        parameters.cells if on_grid(parameters) else 0,
        blocks,
    )


def on_grid(parameters: FrettingWear) -> bool:
    """Tell whether a case is solved on the uniform grid."""
    return parameters.path is None and (parameters.method == "literal" or bool(parameters.history))


def _has_tolerance(parameters: FrettingWear) -> bool:
    """Tell whether the tolerance matters: under constant force the limit depends on the way to it."""
    return parameters.method == "exact" or (parameters.method == "limit" and parameters.hold == "force")


def _contacts(task: Task, wanted: list[tuple[float, float]]) -> Sequence[Contact]:
    """Solve a task for all its (N, xi), or all paths of sliding."""
    from mdr_dask.physics.mdr.revolution import PowerProfile
    from mdr_dask.physics.wear import worn as wear
    from mdr_dask.physics.wear.exact import exact, gross
    from mdr_dask.physics.wear.literal import literal

    profile = PowerProfile(task.exponent) if task.shape is None else table_profile(task.shape, task.depth)
    if task.method == "sliding":
        return gross(
            profile, [path for path, _ in wanted], constant_force=task.hold == "force", tolerance=task.tolerance
        )
    if task.blocks:
        return [_loaded(task, profile)] * len(wanted)
    stick = profile.inside(task.level)
    if task.hold == "force":
        return _forced(task, profile, stick, wanted)
    if task.method == "limit":
        return [wear.limit(profile, stick)] * len(wanted)
    if task.method == "fast":
        return [wear.fast(profile, stick, cycles, xi) for cycles, xi in wanted]
    if task.method == "exact":
        return list(exact(profile, stick, [cycles for cycles, _ in wanted], task.tolerance))
    return [literal(profile, stick, cycles, cells=task.cells) for cycles, _ in wanted]


def _forced(task: Task, profile: Profile, stick: float, wanted: list[tuple[float, float]]) -> Sequence[Contact]:
    """Solve a task under constant force."""
    from mdr_dask.physics.wear.forced import exact_forced, limit_forced
    from mdr_dask.physics.wear.forced_fast import fast_forced
    from mdr_dask.physics.wear.literal import literal

    if task.method == "limit":
        return [limit_forced(profile, stick, task.tolerance)] * len(wanted)
    if task.method == "fast":
        return [fast_forced(profile, stick, cycles, xi) for cycles, xi in wanted]
    if task.method == "exact":
        return list(exact_forced(profile, stick, [cycles for cycles, _ in wanted], task.tolerance))
    return [literal(profile, stick, cycles, cells=task.cells, constant_force=True) for cycles, _ in wanted]


def _loaded(task: Task, profile: Profile) -> Loaded:
    """Run the blocks of a history."""
    from mdr_dask.physics.mdr.transforms import gauss
    from mdr_dask.physics.wear.history import LoadBlock, history

    if task.method in {"limit", "fast"}:
        raise ValueError(f"the {task.method} method holds for one block of load only; use method exact for histories")
    abscissa, weight = gauss(64)
    first = 2.0 * float((1.0 - profile.image(abscissa)) @ weight)
    blocks = [
        LoadBlock(
            path,
            (1.0 - task.level) * amplitude,
            depth=factor if task.hold == "depth" else None,
            force=first * factor if task.hold == "force" else None,
        )
        for path, amplitude, factor in task.blocks
    ]
    deepest = max(block.depth or 1.0 for block in blocks) if task.hold == "depth" else 2.0
    return Loaded(history(profile, blocks, cells=task.cells, reach=min(1.7 * deepest, profile.largest_radius)))


def _write(
    block: Block[FrettingWear],
    values: dict[str, FloatArray],
    positions: list[tuple[int, int]],
    contact: Contact,
) -> None:
    """Write one solution to every case that shares it, dimensionless."""
    places = axes(block.parameters)
    for name, array in values.items():
        answer = _answer(contact, name, places)
        for position in positions:
            array[position] = answer


def _answer(contact: Contact, name: str, x: FloatArray) -> float | FloatArray:
    """Return one output of a solution; those of the blocks of a history have a row for each block."""
    records = contact.records if isinstance(contact, Loaded) else (contact,)
    if name in BLOCK_OUTPUTS:
        return np.array([_of_one(record, BLOCK_OUTPUTS[name], x) for record in records])
    return _of_one(records[-1], name, x)


def _of_one(contact: Worn | Record | Slid, name: str, x: FloatArray) -> float | FloatArray:
    from mdr_dask.physics.wear.exact import Slid
    from mdr_dask.physics.wear.worn import Worn

    border = "stick_border" if isinstance(contact, Worn) else "stick_radius"
    plain = {"stick_border": border, "discretisation_error": "error"}.get(name, name)
    if name not in {"worn_profile", "worn_image", "pressure", "worn_depth"}:
        return float(getattr(contact, plain, 1.0))  # what has no depth of its own keeps the first one
    if isinstance(contact, Worn):
        functions = {"worn_profile": contact.height, "worn_image": contact.image, "pressure": contact.pressure}
        return contact.worn_depth() if name == "worn_depth" else functions[name](x)
    if name == "worn_depth":
        return contact.worn_depth
    field = {"worn_profile": "height", "worn_image": "image", "pressure": "pressure"}[name]
    if isinstance(contact, Slid):
        return contact.curve(field, x)
    return np.asarray(np.interp(x, contact.radius, getattr(contact, field), right=np.nan))


def axes(parameters: FrettingWear) -> FloatArray:
    """Return the radii, or positions, of the profiles, over a0."""
    return np.linspace(0.0, parameters.extent, parameters.points)
