"""The model ``fretting_wear``: a body of revolution that oscillates tangentially and wears where it slips."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from mdr_dask.models.base import Block, Coordinate, Model, NamedFile, Output, Parameters, Result, Status, quantity

if TYPE_CHECKING:
    from mdr_dask.physics.profiles import Profile, TableProfile
    from mdr_dask.physics.wear import Worn
    from mdr_dask.physics.wear_history import Record

FloatArray = NDArray[np.float64]

EXPONENTS = {"cone": 1.0, "parabola": 2.0}
_OVER = {"worn_profile": "radius", "worn_image": "position", "pressure": "radius"}
#: Numerical error of the closed forms, in d0 (tests/physics/test_wear.py).
_CLOSED_FORM_ERROR = 2e-6


class PowerShape(Parameters):
    """A power law, f = R (r / R)^n / n with the curvature radius R."""

    exponent: float = quantity("1", "exponent n of the profile", gt=0.1, le=50)


class TableShape(Parameters):
    """A measured profile: a CSV table with two columns, radius and height, in metres, and a header line."""

    table: NamedFile


class LoadStep(Parameters):
    """One block of a load history."""

    cycles: float = quantity("1", "cycles of the block (N in a dimensionless campaign)", ge=0)
    amplitude_factor: float = quantity("1", "amplitude over the campaign's amplitude", gt=0, default=1.0)
    load_factor: float = quantity("1", "depth or force over its first value", gt=0, default=1.0)


class FrettingWear(Parameters):
    """Parameters of fretting wear, dimensionless (`stick_radius`) or dimensional (`amplitude` and the rest)."""

    shape: Literal["parabola", "cone"] | PowerShape | TableShape = Field("parabola", description="virgin profile")
    method: Literal["limit", "fast", "exact", "literal"] = Field("fast", description="way to the worn profile")
    hold: Literal["depth", "force"] = Field("depth", description="what stays constant while the body wears")
    cycles: float = quantity("1", "number of cycles; N = cycles / N0 in a dimensionless campaign", ge=0, default=1.0)
    stick_radius: float | None = quantity(
        "1", "stick radius c over the first contact radius a0", gt=0, lt=1, default=None
    )
    amplitude: float | None = quantity("m", "amplitude U0 of the tangential oscillation", gt=0, default=None)
    curvature_radius: float | None = quantity("m", "radius of curvature of a parabola or power law", gt=0, default=None)
    angle: float | None = quantity(
        "rad", "inclination of a cone's flank against the surface", gt=0, lt=1.5, default=None
    )
    modulus: float | None = quantity("Pa", "effective normal modulus E*", gt=0, default=None)
    shear_modulus: float | None = quantity("Pa", "effective tangential modulus G*", gt=0, default=None)
    friction: float | None = quantity("1", "coefficient of friction", gt=0, default=None)
    load: float | None = quantity("N", "normal force of the virgin contact", gt=0, default=None)
    depth: float | None = quantity("m", "indentation depth of the virgin contact", gt=0, default=None)
    hardness: float | None = quantity("Pa", "hardness in the wear law", gt=0, default=None)
    wear_coefficient: float | None = quantity(
        "1", "wear coefficient k of the law V = k F u / hardness", ge=0, default=None
    )
    xi: float = quantity("1", "factor of the fast rule; docs/wear.md has its error", gt=0, default=0.8)
    tolerance: float = quantity("1", "error of the exact profile wanted, in d0", ge=1e-6, le=1e-2, default=1e-3)
    cells: int = quantity(
        "1", "cells of the grid of method literal, of hold force and of histories", ge=20, le=2000, default=200
    )
    friction_scatter: float = quantity("1", "relative scatter of friction (log-normal)", ge=0, le=2, default=0.0)
    amplitude_scatter: float = quantity("1", "relative scatter of the amplitude (log-normal)", ge=0, le=2, default=0.0)
    wear_coefficient_scatter: float = quantity("1", "relative scatter of the wear coefficient", ge=0, le=2, default=0.0)
    history: Annotated[tuple[LoadStep, ...], Field(strict=False, description="blocks of load instead of `cycles`")] = ()
    extent: float = quantity("1", "last radius of the profiles, over a0", gt=0, le=10, default=1.6)
    points: int = quantity("1", "points of the profiles", ge=2, le=10000, default=161)

    @field_validator("history", mode="before")
    @classmethod
    def _as_tuple(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value

    @model_validator(mode="after")
    def _one_kind(self) -> FrettingWear:
        missing = [name for name in self._dimensional() if getattr(self, name) is None]
        given = [name for name in (*self._dimensional(), "load", "depth") if getattr(self, name) is not None]
        if self.stick_radius is not None and given:
            raise ValueError(
                f"a dimensionless campaign has stick_radius only, got {', '.join(given)} as well; leave one kind out"
            )
        if self.stick_radius is None and missing:
            raise ValueError(f"give stick_radius, or for a dimensional campaign also {', '.join(missing)}")
        if self.stick_radius is None and (self.load is None) == (self.depth is None):
            raise ValueError(f"give either load or depth, got load {self.load!r} and depth {self.depth!r}")
        if isinstance(self.shape, TableShape) and self.depth is None:
            raise ValueError("a table of a profile needs a dimensional campaign with its depth")
        return self

    def _dimensional(self) -> tuple[str, ...]:
        size = {"cone": ("angle",), "parabola": ("curvature_radius",)}.get(str(self.shape), ("curvature_radius",))
        if isinstance(self.shape, TableShape):
            size = ()
        return (*size, "modulus", "shear_modulus", "friction", "amplitude", "hardness", "wear_coefficient")


@dataclass(frozen=True)
class _Numbers:
    """What the physics needs of every case and realisation, and the units of the case; shape (cases, realisations).

    `level` is g_c = 1 - eta, the image at the stick border; `advance` is the factor from cycles to N.
    """

    exponent: FloatArray
    level: FloatArray
    advance: FloatArray
    cycles: FloatArray
    xi: FloatArray
    length: FloatArray
    height: FloatArray
    force: FloatArray


def compute(block: Block[FrettingWear]) -> Result:
    """Compute all cases of a block; each distinct (shape, c, N, method) is solved once."""
    numbers, messages = _reduce(block)
    status = np.full(numbers.level.shape, Status.DONE, dtype=np.int8)
    wanted = [name for name in block.outputs if name != "status"]
    values = {
        name: np.full(status.shape + ((block.parameters.points,) if name in _OVER else ()), np.nan) for name in wanted
    }
    _refuse_gross_slip(block, numbers, messages)
    for position in messages:
        status[position] = Status.FAILED
    if _is_plain(block):
        solves = _solve_plain(block, numbers, values, status == Status.DONE)
    else:
        solves = _solve_each(block, numbers, values, status, messages)
    _scale(values, numbers)
    return Result(values, status, messages, solves)


def _scale(values: dict[str, FloatArray], numbers: _Numbers) -> None:
    """Give the outputs of dimensional cases their units; dimensionless cases have units of one."""
    units = {
        "contact_radius": numbers.length,
        "stick_border": numbers.length,
        "wear_volume": numbers.length**2 * numbers.height,
        "normal_force": numbers.force,
        "worn_profile": numbers.height,
        "worn_image": numbers.height,
        "worn_depth": numbers.height,
        "pressure": numbers.force / numbers.length**2,
    }
    for name, array in values.items():
        if name in units:
            array *= units[name].reshape(units[name].shape + (1,) * (array.ndim - 2))


def _is_plain(block: Block[FrettingWear]) -> bool:
    """Tell whether every case is a power law with scalar outputs by the limit or the fast rule at constant depth."""
    methods = set(block.columns.get("method", [block.parameters.method]))
    holds = set(block.columns.get("hold", [block.parameters.hold]))
    tables = any(isinstance(shape, TableShape) for shape in set(_shapes(block)))
    plain_load = holds == {"depth"} and not block.parameters.history and "history" not in block.columns
    return (
        methods <= {"limit", "fast"} and plain_load and not tables and not set(block.outputs) & {*_OVER, "worn_depth"}
    )


def _shapes(block: Block[FrettingWear]) -> list[object]:
    """Return the shape of every case, or the one that all share."""
    return list(block.columns["shape"]) if "shape" in block.columns else [block.parameters.shape]


def _exponents(block: Block[FrettingWear]) -> FloatArray:
    if "shape.exponent" in block.columns:
        return np.asarray(block.columns["shape.exponent"], dtype=float)
    powers = [s.exponent if isinstance(s, PowerShape) else EXPONENTS.get(str(s), np.nan) for s in _shapes(block)]
    return np.broadcast_to(np.array(powers, dtype=float), (block.cases,))


def _column(block: Block[FrettingWear], name: str) -> FloatArray:
    """Return a number of every case, NaN where it is not given."""
    if name not in block.columns:
        value = getattr(block.parameters, name)
        return np.full(block.cases, np.nan if value is None else float(value))
    return np.array([np.nan if v is None else v for v in block.columns[name]], dtype=float)


def _scatter(block: Block[FrettingWear]) -> FloatArray:
    """Return standard normal numbers for friction, amplitude and wear coefficient, shape (realisations, 3)."""
    return np.array(
        [
            np.random.Generator(np.random.Philox(np.random.SeedSequence(block.seed, spawn_key=(r,)))).standard_normal(3)
            for r in block.realisations
        ]
    ).reshape(-1, 3)


def _factor(block: Block[FrettingWear], name: str, normal: FloatArray) -> FloatArray:
    """Return log-normal factors of mean one, shape (cases, realisations)."""
    width = np.sqrt(np.log1p(_column(block, name) ** 2))[:, None]
    return np.asarray(np.exp(width * normal - 0.5 * width**2))


def _reduce(block: Block[FrettingWear]) -> tuple[_Numbers, dict[tuple[int, int], str]]:
    """Turn every case into n, g_c and N, and keep its units a0, d0 and E* d0 a0."""
    n, normal = _exponents(block), _scatter(block)
    amplitude = _factor(block, "amplitude_scatter", normal[:, 1])
    widening = amplitude / _factor(block, "friction_scatter", normal[:, 0])
    advance = amplitude * _factor(block, "wear_coefficient_scatter", normal[:, 2])
    messages: dict[tuple[int, int], str] = {}
    if block.parameters.stick_radius is not None or "stick_radius" in block.columns:
        level = (1.0 - widening) + widening * (_column(block, "stick_radius") ** n)[:, None]
        length = height = force = np.ones(block.cases)
    else:
        modulus = _column(block, "modulus")
        length, height = _first_contact(block, n, modulus, messages)
        force = modulus * height * length
        share = _column(block, "shear_modulus") * _column(block, "amplitude")
        level = 1.0 - widening * (share / (_column(block, "friction") * modulus * height))[:, None]
        rate = 4.0 * _column(block, "amplitude") * _column(block, "wear_coefficient") * modulus
        advance = advance * (rate / (length * _column(block, "hardness")))[:, None]
    columns = (n, _column(block, "cycles"), _column(block, "xi"), length, height, force)
    n, cycles, xi, length, height, force = (np.broadcast_to(c[:, None], level.shape) for c in columns)
    return _Numbers(n, level, advance, cycles * advance, xi, length, height, force), messages


def _first_contact(
    block: Block[FrettingWear], n: FloatArray, modulus: FloatArray, messages: dict[tuple[int, int], str]
) -> tuple[FloatArray, FloatArray]:
    """Return a0 and d0 of dimensional cases; a table that cannot be pressed so deep is a message."""
    from mdr_dask.physics import axisymmetric as contact

    depth, load, angle = _column(block, "depth"), _column(block, "load"), _column(block, "angle")
    if any(isinstance(shape, TableShape) for shape in _shapes(block)):
        length = np.full(block.cases, np.nan)
        for case, (shape, deep) in enumerate(zip(_every_shape(block), depth, strict=True)):
            try:
                length[case] = _table_profile(shape, float(deep)).length
            except ValueError as problem:
                messages.update({(case, position): str(problem) for position in range(len(block.realisations))})
        return length, depth
    scale = np.where(np.isnan(angle), _column(block, "curvature_radius") ** (1.0 - n) / n, np.tan(angle))
    from_load = contact.radius_from_force(load, scale, n, modulus)
    length = np.where(np.isnan(depth), from_load, contact.contact_radius(depth, scale, n))
    return length, np.where(np.isnan(depth), contact.depth(length, scale, n), depth)


def _every_shape(block: Block[FrettingWear]) -> list[object]:
    shapes = _shapes(block)
    return shapes if len(shapes) == block.cases else shapes * block.cases


def _table_profile(shape: object, depth: float) -> TableProfile:
    """Read a table and press it; cached by content."""
    if not isinstance(shape, TableShape):
        raise ValueError("tables and formulas of profiles cannot be mixed along one axis")
    return _pressed_table(shape.table.read_text(), depth)


@lru_cache(maxsize=64)
def _pressed_table(text: str, depth: float) -> TableProfile:
    from mdr_dask.physics.profiles import from_table

    rows = [line.split(",") for line in text.splitlines()[1:] if line.strip()]
    try:
        data = np.array([[float(row[0]), float(row[1])] for row in rows])
    except (ValueError, IndexError) as problem:
        raise ValueError(f"a table of a profile needs two columns of numbers below its header: {problem}") from None
    return from_table(data[:, 0], data[:, 1], depth)


def _refuse_gross_slip(block: Block[FrettingWear], numbers: _Numbers, messages: dict[tuple[int, int], str]) -> None:
    """Note every case in which nothing sticks, unless its blocks of load are allowed to slip."""
    if block.parameters.history or "history" in block.columns:
        return
    for case, realisation in np.argwhere(~(numbers.level > 0.0)):
        eta = 1.0 - numbers.level[case, realisation]
        messages.setdefault(
            (int(case), int(realisation)),
            f"the amplitude is in gross slip: it must stay below mu E* d0 / G*, got {eta:.4g} times that; "
            "lower the amplitude or raise friction or load",
        )


def _solve_plain(
    block: Block[FrettingWear], numbers: _Numbers, values: dict[str, FloatArray], good: NDArray[np.bool_]
) -> int:
    """Solve limits and fast rules of power laws, all at once; return how many were distinct."""
    from mdr_dask.physics.wear_cases import fast_cases, limit_cases

    methods = np.asarray(block.column("method") == "fast")
    fast = np.broadcast_to(methods[:, None], good.shape)[good]
    cycles, xi = np.where(fast, numbers.cycles[good], np.inf), np.where(fast, numbers.xi[good], 0.0)
    rows, back = _distinct(np.stack([numbers.exponent[good], numbers.level[good], cycles, xi]))
    pairs, to_pair = _distinct(rows[:2])
    results = np.array(limit_cases(pairs[0], pairs[1] ** (1.0 / pairs[0])))[:, to_pair]
    finite = np.isfinite(rows[2])
    n, level, cycles, xi = rows[:, finite]
    stick = rows[1] ** (1.0 / rows[0])
    results[:, finite] = fast_cases(n, level ** (1.0 / n), cycles, xi, results[0, finite])
    error = np.full(stick.size, _CLOSED_FORM_ERROR)
    names = ("contact_radius", "wear_volume", "normal_force", "stick_border", "discretisation_error")
    for name, result in zip(names, (*results, stick, error), strict=True):
        if name in values:
            values[name][good] = result[back]
    return int(rows.shape[1])


@dataclass(frozen=True)
class _Task:
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


def _solve_each(
    block: Block[FrettingWear],
    numbers: _Numbers,
    values: dict[str, FloatArray],
    status: NDArray[np.int8],
    messages: dict[tuple[int, int], str],
) -> int:
    """Solve one task after the other, with all the cycles asked of it."""
    solves = 0
    for task, wanted in _tasks(block, numbers, status).items():
        try:
            contacts = _contacts(task, list(wanted))
        except (ValueError, ArithmeticError) as problem:
            kind = Status.FAILED if isinstance(problem, ValueError) else Status.NOT_CONVERGED
            for position in (p for positions in wanted.values() for p in positions):
                status[position], messages[position] = kind, str(problem)
            continue
        solves += 1
        for positions, contact in zip(wanted.values(), contacts, strict=True):
            _write(block, values, positions, contact)
    return solves


def _tasks(
    block: Block[FrettingWear], numbers: _Numbers, status: NDArray[np.int8]
) -> dict[_Task, dict[tuple[float, float], list[tuple[int, int]]]]:
    """Gather the positions of each task by (N, xi)."""
    tasks: dict[_Task, dict[tuple[float, float], list[tuple[int, int]]]] = {}
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


def _task(parameters: FrettingWear, numbers: _Numbers, place: tuple[int, int]) -> _Task:
    dimensional = parameters.stick_radius is None
    blocks = tuple(
        (
            step.cycles * float(numbers.advance[place]) * (step.amplitude_factor if dimensional else 1.0),
            step.amplitude_factor,
            step.load_factor,
        )
        for step in parameters.history
    )
    table = isinstance(parameters.shape, TableShape)
    return _Task(
        parameters.shape if table else None,
        float(numbers.height[place]) if table else 1.0,
        0.0 if table else float(numbers.exponent[place]),
        float(numbers.level[place]),
        parameters.method,
        parameters.hold,
        parameters.tolerance if parameters.method == "exact" else 0.0,
        parameters.cells if parameters.method == "literal" or parameters.hold == "force" or blocks else 0,
        blocks,
    )


def _contacts(task: _Task, wanted: list[tuple[float, float]]) -> list[Worn | Record]:
    """Solve a task for all its (N, xi)."""
    from mdr_dask.physics import wear
    from mdr_dask.physics.profiles import PowerProfile
    from mdr_dask.physics.wear_exact import exact
    from mdr_dask.physics.wear_literal import literal

    profile = PowerProfile(task.exponent) if task.shape is None else _table_profile(task.shape, task.depth)
    if task.blocks or task.hold == "force":
        return [_loaded(task, profile, cycles) for cycles, _ in wanted]
    stick = profile.inside(task.level)
    if task.method == "limit":
        return [wear.limit(profile, stick)] * len(wanted)
    if task.method == "fast":
        return [wear.fast(profile, stick, cycles, xi) for cycles, xi in wanted]
    if task.method == "exact":
        return list(exact(profile, stick, [cycles for cycles, _ in wanted], task.tolerance))
    return [literal(profile, stick, cycles, cells=task.cells) for cycles, _ in wanted]


def _loaded(task: _Task, profile: Profile, cycles: float) -> Record:
    """Run the blocks of a history, or one block at constant force."""
    from mdr_dask.physics.transforms import gauss
    from mdr_dask.physics.wear_history import LoadBlock, history

    if task.method in {"limit", "fast"}:
        raise ValueError(
            f"the {task.method} method holds for one block at constant depth only; use method exact for hold force "
            "and for histories"
        )
    abscissa, weight = gauss(64)
    first = 2.0 * float((1.0 - profile.image(abscissa)) @ weight)
    blocks = [
        LoadBlock(
            path,
            (1.0 - task.level) * amplitude,
            depth=factor if task.hold == "depth" else None,
            force=first * factor if task.hold == "force" else None,
        )
        for path, amplitude, factor in (task.blocks or ((cycles, 1.0, 1.0),))
    ]
    deepest = max(block.depth or 1.0 for block in blocks) if task.hold == "depth" else 2.0
    return history(profile, blocks, cells=task.cells, reach=min(1.7 * deepest, profile.largest_radius))[-1]


def _write(
    block: Block[FrettingWear],
    values: dict[str, FloatArray],
    positions: list[tuple[int, int]],
    contact: Worn | Record,
) -> None:
    """Write one solution to every case that shares it, dimensionless."""
    axes = _axes(block.parameters)
    for name, array in values.items():
        answer = _answer(contact, name, axes)
        for position in positions:
            array[position] = answer


def _answer(contact: Worn | Record, name: str, x: FloatArray) -> float | FloatArray:
    """Return one output of a solution."""
    from mdr_dask.physics.wear import Worn

    if isinstance(contact, Worn):
        if name == "worn_profile":
            return contact.height(x)
        if name == "worn_image":
            return contact.image(x)
        if name == "pressure":
            return contact.pressure(x)
        if name == "worn_depth":
            return contact.worn_depth()
        plain = {"stick_border": "stick_radius", "discretisation_error": "error"}.get(name, name)
        return float(getattr(contact, plain))
    fields = {"worn_profile": contact.height, "worn_image": contact.image, "pressure": contact.pressure}
    if name in fields:
        return np.asarray(np.interp(x, contact.radius, fields[name], right=np.nan))
    if name == "worn_depth":
        return contact.worn_depth
    plain = {"stick_border": "stick_radius", "discretisation_error": "error"}.get(name, name)
    return float(getattr(contact, plain))


def _axes(parameters: FrettingWear) -> FloatArray:
    return np.linspace(0.0, parameters.extent, parameters.points)


def _distinct(rows: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the distinct columns and where each column stands among them."""
    if rows.shape[1] == 0:
        return rows, np.zeros(0, dtype=np.intp)
    order = np.lexsort(rows)
    ordered = rows[:, order]
    new = np.append(True, np.any(ordered[:, 1:] != ordered[:, :-1], axis=0))
    back = np.empty(order.size, dtype=np.intp)
    back[order] = np.cumsum(new) - 1
    return ordered[:, new], back


def _coordinates(parameters: FrettingWear) -> dict[str, Coordinate]:
    axis = _axes(parameters)
    return {
        "radius": Coordinate(axis, "1", "radius over the first contact radius a0"),
        "position": Coordinate(axis, "1", "position over the first contact radius a0"),
    }


def _distinct_solutions(block: Block[FrettingWear]) -> int:
    """Count the different tasks, or for the closed forms the different cases."""
    numbers, _ = _reduce(block)
    parts = [np.nan_to_num(numbers.exponent), numbers.level]
    if _is_plain(block):
        parts += [numbers.cycles, numbers.xi]
    return int(_distinct(np.stack([part.ravel() for part in parts]))[0].shape[1])


def _seconds(block: Block[FrettingWear]) -> float:
    """Estimate the time of a block."""
    size = block.cases * len(block.realisations)
    if _is_plain(block):
        return 0.01 + 3e-5 * size
    method, tolerance = block.parameters.method, block.parameters.tolerance
    loaded = block.parameters.hold == "force" or bool(block.parameters.history)
    cells = block.parameters.cells
    each = {"limit": 3e-3, "fast": 6e-3, "exact": 0.1 * (1e-3 / tolerance) ** 0.6, "literal": 3e-7 * cells**3}[method]
    sharing = {len(column) for name, column in block.columns.items() if name == "cycles"}
    solves = max(size // max(sharing, default=1), 1) if method == "exact" else size
    return 0.01 + (1e-7 * cells**3 * size if loaded else each * solves) + 2e-3 * size


OUTPUTS = (
    Output("contact_radius", "m", "radius of the wear scar (a0 = 1 in a dimensionless campaign)"),
    Output("wear_volume", "m3", "worn volume (a0^2 d0 = 1 in a dimensionless campaign)"),
    Output("normal_force", "N", "normal force (E* d0 a0 = 1 in a dimensionless campaign)"),
    Output("stick_border", "m", "stick radius (a0 = 1 in a dimensionless campaign)", default=False),
    Output("worn_depth", "m", "largest worn depth (d0 = 1 in a dimensionless campaign)", default=False),
    Output("worn_profile", "m", "worn profile f(r), from the virgin apex", ("radius",), default=False),
    Output("worn_image", "m", "worn one-dimensional image g(x)", ("position",), default=False),
    Output(
        "pressure",
        "Pa",
        "contact pressure p(r) (E* d0 / a0 = 1 in a dimensionless campaign)",
        ("radius",),
        default=False,
    ),
    Output("discretisation_error", "1", "error expected of the profile, over d0"),
)

MODEL = Model(
    name="fretting_wear",
    version=1,
    summary="fretting wear of bodies of revolution: limit, fast, exact and literal",
    parameters=FrettingWear,
    outputs=OUTPUTS,
    compute=compute,
    seconds=_seconds,
    whole=("cycles",),
    coordinates=_coordinates,
    distinct=_distinct_solutions,
)
