"""Solution of a block of lubricated line contacts."""

from __future__ import annotations

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
from mdr_dask.physics.lubrication.grid_solution import cell_around
from mdr_dask.physics.lubrication.line_contact import (
    ACCURACY,
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

#: Floors of outputs (see `solve_film`). The output is x/a, where a is the half width. Inside the contact, the accuracy
#: is therefore the allowed error of x, divided by a.
_FLOORS = {"spike_position": 1.0}


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


def _readings(block: Block[EhlLineParameters], index: int, W: float, contact: LineContact) -> dict[str, Reading]:
    """Return functions that compute film, pressure, spike position and traction from the solution on one grid.

    The keys are the names of the outputs. Only requested outputs are included.
    """
    case, film = block.case(index), square_of_half_width(W)
    p0 = 2 * case.contact_modulus * float(np.sqrt(W / (2 * np.pi)))
    stress = case.eyring_stress / p0 if case.shear_law == "eyring" else None
    place = positions(case)
    readings: dict[str, Reading] = {
        "film": lambda grid: film * grid.film_between(place),
        "pressure": lambda grid: p0 * grid.pressure_between(place),
        "spike_position": lambda grid: grid.spike,
        "traction_coefficient": lambda grid: traction.sliding_coefficient(
            contact, grid, W, case.slide_roll_ratio, stress
        ),
    }
    return {name: reading for name, reading in readings.items() if name in block.outputs}


def _estimates(
    block: Block[EhlLineParameters], index: int, W: float, solution: LineSolution, read: dict[str, Estimate]
) -> dict[str, Estimate]:
    """Return the requested outputs of a case, except those from formulas, with their errors.

    `read` contains the outputs that the functions of `_readings` compute. A film thickness in m is NaN if the campaign
    does not give the radius.
    """
    found, radius = dict(read), block.case(index).radius
    for name, film in (("central_film", solution.central_film), ("minimum_film", solution.minimum_film)):
        found[name] = film.scaled(square_of_half_width(W))
        found[f"{name}_thickness"] = found[name].scaled(np.nan if radius is None else radius)
    if "spike_position" in found:
        found["spike_position"] = _spike(solution)
    return {name: estimate for name, estimate in found.items() if name in block.outputs}


def _spike(solution: LineSolution) -> Estimate:
    """Return the position of the spike and its error.

    The error is the sum of two numbers. The first is the width of the cell around the spike. The second is the change
    of the position from the second finest to the finest grid, or, if larger, half of the change one grid earlier.
    The error is infinite if there are fewer than three grids, or if one of the two finest grids has no spike.
    """
    places = np.array([grid.spike for grid in solution.grids[-3:]])
    moves = np.abs(np.diff(places))
    moved = float(max(moves[-1], 0.5 * moves[-2])) if moves.size > 1 else np.inf
    before, after = cell_around(solution.finest.nodes, places[-1])
    return Estimate(places[-1], np.asarray((np.inf if np.isnan(moved) else moved) + (after - before)))


def compute(block: Block[EhlLineParameters]) -> Result:
    """Solve the cases of a block. All realisations of a case have the same result.

    Cases with the same contact share a solution, even if their slide-roll ratios differ. If the traction must meet
    an accuracy, every case is solved separately.
    """
    parameters, contacts = _groups(block), _line_contacts(block)
    formulas = {"formula_central_film": PAN_HAMROCK_CENTRAL, "formula_minimum_film": PAN_HAMROCK_MINIMUM}
    shape = (block.cases, len(block.realisations))
    values = MODEL.empty_arrays(block, shape)
    for name in formulas.keys() & values.keys():
        values[name][:] = formulas[name](*parameters)[:, None]
    result = Result(values, np.full(shape, Status.DONE, dtype=np.int8))
    accuracy = block.accuracy or ACCURACY
    alone = block.accuracy is not None and "traction_coefficient" in block.outputs
    equal: dict[tuple[LineContact, int], list[int]] = {}
    for index, contact in enumerate(contacts):
        equal.setdefault((contact, index if alone else 0), []).append(index)
    for cases in equal.values():
        readings = [_readings(block, index, float(parameters.W[index]), contacts[index]) for index in cases]
        solution = solve_film(
            contacts[cases[0]],
            accuracy,
            [reading for each in readings for reading in each.values()],
            [_FLOORS.get(name, 0.0) for each in readings for name in each],
            films_only=block.accuracy is None,
        )
        estimates = iter(solution.readings)
        for index, names in zip(cases, readings, strict=True):
            notes = [solution.reason]
            if solution.outcome == Outcome.CONVERGED:
                W, read = float(parameters.W[index]), {name: next(estimates) for name in names}
                found = _estimates(block, index, W, solution, read)
                for name, estimate in found.items():
                    values[name][index] = estimate.value
                    if f"{name}_error" in values:
                        values[f"{name}_error"][index] = np.where(np.isnan(estimate.value), np.nan, estimate.error)
                missed = missed_accuracy(
                    {name: [estimate.value] for name, estimate in found.items()},
                    {name: [estimate.error] for name, estimate in found.items()},
                    accuracy,
                    _FLOORS,
                    f" on {solution.finest.nodes.size} nodes",
                )
                notes += [missed.get(0, ""), thick_film(float(solution.central_film.value) * square_of_half_width(W))]
                if "traction_coefficient" in found and found["traction_coefficient"].value > 1:
                    notes.append(
                        "the traction coefficient is above 1, which no oil reaches, and its error is unknown: use "
                        "shear_law: eyring"
                    )
            else:
                result.status[index] = Status.NOT_CONVERGED
            notes += _warnings(block, index, [float(group[index]) for group in parameters])
            message = "; ".join(note for note in notes if note)
            if message:
                result.messages.update({(index, position): message for position in range(shape[1])})
    return Result(values, result.status, result.messages, len(equal))


def _warnings(block: Block[EhlLineParameters], index: int, parameters: list[float]) -> list[str]:
    """Return warnings about the requested outputs of one case."""
    notes = []
    if {"formula_central_film", "formula_minimum_film"} & set(block.outputs):
        notes.append(PAN_HAMROCK_CENTRAL.outside(*parameters))
    if {"central_film_thickness", "minimum_film_thickness"} & set(block.outputs) and block.case(index).radius is None:
        notes.append("a film thickness in metres needs the parameter `radius`; without `radius`, only h/R is known")
    return notes


def operations(block: Block[EhlLineParameters]) -> float:
    """Return the approximate number of operations of a block.

    The number is proportional to the number of matrix entries in all Newton steps. If the campaign gives an accuracy,
    the pressure and the position of the spike are assumed to need the finest grid.
    """
    is_sharp = block.accuracy is not None and {"pressure", "spike_position"} & set(block.outputs)
    return solution_operations(0.0 if is_sharp else block.accuracy or ACCURACY) * len(set(_line_contacts(block)))
