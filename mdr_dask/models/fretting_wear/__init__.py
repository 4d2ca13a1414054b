"""The model ``fretting_wear``: a body of revolution that oscillates tangentially and wears where it slips."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.models.base import Block, Coordinate, Model, Output, Result, Status
from mdr_dask.models.fretting_wear.parameters import FrettingWear, TableShape
from mdr_dask.models.fretting_wear.reduction import Numbers, reduce_block, refuse_gross_slip, shapes
from mdr_dask.models.fretting_wear.solutions import BLOCK_OUTPUTS, axes, on_grid, solve_each, solves_of, tasks

#: Outputs that are computed for many cases at once.
_CLOSED_FORMS = ("contact_radius", "wear_volume", "normal_force", "stick_border", "discretisation_error")
#: Numerical error of the closed forms, in d0 (tests/physics/test_wear.py).
_CLOSED_FORM_ERROR = 2e-6


def compute(block: Block[FrettingWear]) -> Result:
    """Compute all cases of a block; each distinct (shape, c, N, method) is solved once."""
    numbers, messages = reduce_block(block)
    status = np.full(numbers.level.shape, Status.DONE, dtype=np.int8)
    wanted = [name for name in block.outputs if name != "status"]
    values = {name: np.full(status.shape + _sizes(block.parameters, name), np.nan) for name in wanted}
    refuse_gross_slip(block, numbers, messages)
    for position in messages:
        status[position] = Status.FAILED
    if _is_plain(block):
        solves = _solve_plain(block, numbers, values, status == Status.DONE)
    else:
        solves = solve_each(block, numbers, values, status, messages)
    _scale(values, numbers)
    return Result(values, status, messages, solves)


def _sizes(parameters: FrettingWear, name: str) -> tuple[int, ...]:
    """Return the lengths of the dimensions that an output has of its own."""
    lengths = {"block": max(len(parameters.history), 1)}
    return tuple(lengths.get(dim, parameters.points) for dim in MODEL.output(name).dims)


def _scale(values: dict[str, FloatArray], numbers: Numbers) -> None:
    """Give the outputs of dimensional cases their units; dimensionless cases have units of one."""
    units = {
        "contact_radius": numbers.length,
        "stick_border": numbers.length,
        "depth": numbers.height,
        "wear_volume": numbers.length**2 * numbers.height,
        "normal_force": numbers.force,
        "worn_profile": numbers.height,
        "worn_image": numbers.height,
        "worn_depth": numbers.height,
        "pressure": numbers.force / numbers.length**2,
    }
    for name, array in values.items():
        unit = units.get(BLOCK_OUTPUTS.get(name, name))
        if unit is not None:
            array *= unit.reshape(unit.shape + (1,) * (array.ndim - 2))


def _is_plain(block: Block[FrettingWear]) -> bool:
    """Tell whether every case is a power law with scalar outputs by the limit or the fast rule at constant depth."""
    methods = set(block.columns.get("method", [block.parameters.method]))
    holds = set(block.columns.get("hold", [block.parameters.hold]))
    tables = any(isinstance(shape, TableShape) for shape in set(shapes(block)))
    plain_load = holds == {"depth"} and not block.parameters.history and "history" not in block.columns
    return (
        methods <= {"limit", "fast"} and plain_load and not tables and set(block.outputs) <= {*_CLOSED_FORMS, "status"}
    )


def _solve_plain(
    block: Block[FrettingWear], numbers: Numbers, values: dict[str, FloatArray], good: NDArray[np.bool_]
) -> int:
    """Solve limits and fast rules of power laws, all at once; return how many were distinct."""
    from mdr_dask.physics.wear.rules import fast_cases, limit_cases

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
    for name, result in zip(_CLOSED_FORMS, (*results, stick, error), strict=True):
        if name in values:
            values[name][good] = result[back]
    return int(rows.shape[1])


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
    axis = axes(parameters)
    return {
        "radius": Coordinate(axis, "1", "radius over the first contact radius a0"),
        "position": Coordinate(axis, "1", "position over the first contact radius a0"),
        "block": Coordinate(np.arange(1.0, max(len(parameters.history), 1) + 1.0), "1", "block of the load history"),
    }


def _units(parameters: FrettingWear) -> dict[str, str]:
    """Return the units of a dimensionless campaign: every output is a pure number, and so is the path."""
    return {"path": "1"} | {output.name: "1" for output in OUTPUTS} if parameters.dimensionless else {}


def _distinct_solutions(block: Block[FrettingWear]) -> int:
    """Count the different solutions among the cases of a block, those of `compute`."""
    numbers, messages = reduce_block(block)
    if _is_plain(block):
        return _count(numbers.exponent, numbers.level, numbers.cycles, numbers.xi)
    status = np.full(numbers.level.shape, Status.DONE, dtype=np.int8)
    refuse_gross_slip(block, numbers, messages)
    for position in messages:
        status[position] = Status.FAILED
    return sum(solves_of(task, wanted) for task, wanted in tasks(block, numbers, status).items())


def _count(*parts: FloatArray) -> int:
    return int(_distinct(np.stack([np.nan_to_num(part).ravel() for part in parts]))[0].shape[1])


def _seconds(block: Block[FrettingWear]) -> float:
    """Estimate the time of a block."""
    size = block.cases * len(block.realisations)
    if _is_plain(block):
        return 0.01 + 3e-5 * size
    method, tolerance = block.parameters.method, block.parameters.tolerance
    cells = block.parameters.cells
    if on_grid(block.parameters):
        return 0.01 + (3e-7 if method == "literal" else 1e-7) * cells**3 * size
    accurate = (1e-3 / tolerance) ** 0.6
    each = {"limit": 3e-3, "fast": 6e-3, "exact": 0.1 * accurate}[method]
    if block.parameters.hold == "force":
        each = {"limit": 0.5 * accurate, "fast": 0.03, "exact": accurate}[method]
    numbers, _ = reduce_block(block)
    moments = _count(numbers.exponent, numbers.level, numbers.cycles, numbers.xi)
    solves = moments if method == "fast" else _count(numbers.exponent, numbers.level)
    return float(0.01 + each * solves + 2e-3 * moments + 5e-5 * size)


OUTPUTS = (
    Output("contact_radius", "m", "radius of the wear scar (a0 = 1 in a dimensionless campaign)"),
    Output("wear_volume", "m^3", "worn volume (a0^2 d0 = 1 in a dimensionless campaign)"),
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
    Output("block_contact_radius", "m", "contact radius after every block of load", ("block",), default=False),
    Output("block_stick_border", "m", "stick radius at the end of every block of load", ("block",), default=False),
    Output("block_depth", "m", "depth at the end of every block of load", ("block",), default=False),
    Output("block_normal_force", "N", "normal force at the end of every block of load", ("block",), default=False),
    Output("block_wear_volume", "m^3", "worn volume after every block of load", ("block",), default=False),
    Output("block_worn_profile", "m", "worn profile after every block of load", ("block", "radius"), default=False),
)

MODEL = Model(
    name="fretting_wear",
    version=3,
    summary="fretting wear of bodies of revolution: limit, fast, exact and literal",
    parameters=FrettingWear,
    outputs=OUTPUTS,
    compute=compute,
    seconds=_seconds,
    whole=(
        *("cycles", "path", "wear_coefficient", "hardness"),
        *("friction", "amplitude", "shear_modulus", "modulus", "depth", "load", "curvature_radius", "angle"),
    ),
    coordinates=_coordinates,
    distinct=_distinct_solutions,
    units=_units,
)
