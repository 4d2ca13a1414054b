"""Solution of a block of lubricated line contacts."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.models.base import Block, Result, Status
from mdr_dask.models.ehl_line.declaration import MODEL, EhlLineParameters, groups, positions
from mdr_dask.models.parts.accuracy import missed_accuracy
from mdr_dask.physics.lubrication import traction
from mdr_dask.physics.lubrication.film_formulas import (
    PAN_HAMROCK_CENTRAL,
    PAN_HAMROCK_MINIMUM,
    Groups,
    square_of_half_width,
    thick_film,
)
from mdr_dask.physics.lubrication.line_contact import (
    ACCURACY,
    NODES,
    LineContact,
    LineSolution,
    Reading,
    line_contact,
    solve_film,
)
from mdr_dask.physics.lubrication.line_contact import (
    operations as solution_operations,
)
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import Estimate

#: Outputs that are positions x/a. The relative error of a position is the error of x/a, divided by the absolute value
#: of x/a. If this absolute value is below 1, the error is not divided.
_POSITIONS = {"minimum_position", "rupture_position", "spike_position"}


def _groups(block: Block[EhlLineParameters]) -> Groups:
    """Return W, U and G of every case."""

    def lookup(name: str) -> FloatArray | None:
        return None if getattr(block.parameters, name) is None else block.numbers(name)

    return Groups(*groups(lookup))


def _line_contacts(block: Block[EhlLineParameters]) -> list[LineContact]:
    names = ("contact_modulus", "viscosity_law", "viscosity", "compressible", "inlet")
    columns = zip(*(block.column(name).tolist() for name in names), strict=True)
    return [
        line_contact(
            (W, U, G), modulus, viscosity_law=law, viscosity=viscosity, compressible=bool(compressible), inlet=inlet
        )
        for W, U, G, (modulus, law, viscosity, compressible, inlet) in zip(
            *(group.tolist() for group in _groups(block)), columns, strict=True
        )
    ]


def _readings(case: EhlLineParameters, W: float, contact: LineContact) -> dict[str, Reading]:
    """Return, for each output, a function that computes the output from the solution on one grid.

    The functions return positions divided by the half width a, film thicknesses divided by a^2/R, and pressures
    divided by Hertz' maximum pressure.
    """
    p0 = highest_pressure(case.contact_modulus, W)
    stress = case.eyring_stress / p0 if case.shear_law == "eyring" else None
    place = positions(case)
    return {
        "film": lambda grid: grid.film_between(place),
        "pressure": lambda grid: grid.pressure_between(place),
        "minimum_position": lambda grid: grid.minimum[0],
        "rupture_position": lambda grid: grid.rupture,
        "spike_position": lambda grid: grid.spike[0],
        "spike_pressure": lambda grid: grid.spike[1],
        "traction_coefficient": lambda grid: traction.sliding_coefficient(
            contact, grid, W, case.slide_roll_ratio, stress
        ),
        "rolling_coefficient": lambda grid: traction.rolling_coefficient(grid, W),
    }


def highest_pressure(contact_modulus: float, W: float) -> float:
    """Return Hertz' maximum pressure p0 in Pa."""
    return 2 * contact_modulus * float(np.sqrt(W / (2 * np.pi)))


def _estimates(
    case: EhlLineParameters, W: float, solution: LineSolution, outputs: Collection[str]
) -> dict[str, Estimate]:
    """Return the requested outputs of a solution, and the errors, both in the units of the outputs."""
    film, p0 = square_of_half_width(W), highest_pressure(case.contact_modulus, W)
    metres = film * (np.nan if case.radius is None else case.radius)
    place, readings = positions(case), _readings(case, W, solution.case)
    found: dict[str, Callable[[], Estimate]] = {
        "central_film": lambda: solution.central_film.scaled(film),
        "minimum_film": lambda: solution.minimum_film.scaled(film),
        "central_film_thickness": lambda: solution.central_film.scaled(metres),
        "minimum_film_thickness": lambda: solution.minimum_film.scaled(metres),
        "film": lambda: solution.profile(lambda grid, x: grid.film_between(x), place).scaled(film),
        "pressure": lambda: solution.profile(lambda grid, x: grid.pressure_between(x), place).scaled(p0),
        "minimum_position": lambda: solution.position(readings["minimum_position"]),
        "rupture_position": lambda: solution.position(readings["rupture_position"]),
        "spike_position": lambda: solution.spike()[0],
        "spike_pressure": lambda: solution.spike()[1].scaled(p0),
        "traction_coefficient": lambda: solution.estimate(readings["traction_coefficient"]),
        "rolling_coefficient": lambda: solution.estimate(readings["rolling_coefficient"]),
    }
    return {name: estimate() for name, estimate in found.items() if name in outputs}


def compute(block: Block[EhlLineParameters]) -> Result:
    """Solve the cases of a block. Equal cases are solved only once. All realisations of a case have the same result."""
    parameters = _groups(block)
    given = {
        "formula_central_film": PAN_HAMROCK_CENTRAL(*parameters),
        "formula_minimum_film": PAN_HAMROCK_MINIMUM(*parameters),
    }
    shape = (block.cases, len(block.realisations))
    lengths = {"position": block.parameters.profile_points}
    values = {
        name: np.full(shape + tuple(lengths[dim] for dim in MODEL.output(name).dims), np.nan) for name in block.outputs
    }
    result = Result(values, np.full(shape, Status.DONE, dtype=np.int8))
    solved: dict[tuple[object, ...], LineSolution] = {}
    accuracy = block.accuracy or ACCURACY
    for index, contact in enumerate(_line_contacts(block)):
        case, W = block.case(index), float(parameters.W[index])
        readings = {} if block.accuracy is None else _readings(case, W, contact)
        readings = {name: reading for name, reading in readings.items() if name in block.outputs}
        sliding = (W, case.slide_roll_ratio, case.shear_law, case.eyring_stress)
        key = (contact, *(sliding if "traction_coefficient" in readings else ()))
        if key not in solved:
            floors = [1.0 if name in _POSITIONS else 0.0 for name in readings]
            solved[key] = solve_film(contact, accuracy, [*readings.values()], floors)
        solution = solved[key]
        found: dict[str, FloatArray | float] = {name: float(column[index]) for name, column in given.items()}
        notes = [solution.reason]
        if solution.outcome == Outcome.CONVERGED:
            estimates = _estimates(case, W, solution, block.outputs)
            for name, estimate in estimates.items():
                found |= {name: estimate.value, f"{name}_error": estimate.error}

            film = float(solution.central_film.value) * square_of_half_width(W)
            missed = missed_accuracy(
                {name: [estimate.value] for name, estimate in estimates.items()},
                {name: [estimate.error] for name, estimate in estimates.items()},
                accuracy,
                dict.fromkeys(_POSITIONS, 1.0),
                f" on {solution.finest.nodes.size} nodes",
            )
            notes += [missed.get(0, ""), thick_film(film)]
        else:
            result.status[index] = Status.NOT_CONVERGED
        notes += _warnings(block, index, [float(group[index]) for group in parameters])
        for name in block.outputs:
            values[name][index] = found.get(name, np.nan)
        message = "; ".join(note for note in notes if note)
        if message:
            result.messages.update({(index, position): message for position in range(shape[1])})
    return Result(values, result.status, result.messages, len(solved))


def _warnings(block: Block[EhlLineParameters], index: int, parameters: list[float]) -> list[str]:
    """Return warnings about the requested outputs of one case."""
    notes = []
    if {"formula_central_film", "formula_minimum_film"} & set(block.outputs):
        notes.append(PAN_HAMROCK_CENTRAL.outside(*parameters))
    if {"central_film_thickness", "minimum_film_thickness"} & set(block.outputs) and block.case(index).radius is None:
        notes.append("a film thickness in metres needs the parameter radius; without it only h/R is known")
    return notes


def distinct(block: Block[EhlLineParameters]) -> int:
    """Return the number of solutions of a block. Equal cases share one solution."""
    return len(set(_line_contacts(block)))


def operations(block: Block[EhlLineParameters]) -> float:
    """Return the approximate number of operations of a block.

    The number counts the matrix entries in all Newton steps. If a campaign with an accuracy requests the pressure or
    the pressure spike, a solution needs the finest grid.
    """
    is_sharp = block.accuracy is not None and {"pressure", "spike_pressure", "spike_position"} & set(block.outputs)
    return solution_operations(0.0 if is_sharp else block.accuracy or ACCURACY) * distinct(block)


def memory(_: Block[EhlLineParameters]) -> float:
    """Return the memory in bytes of a solution on the finest grid: three matrices of floating-point numbers."""
    return 3.0 * 8 * (NODES[-1] + 1) ** 2
