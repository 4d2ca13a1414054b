"""From a block of lubricated line contacts to arrays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.ndimage import maximum_filter1d

from mdr_dask.arrays import FloatArray
from mdr_dask.models.base import Block, Result, Status
from mdr_dask.models.ehl_line.declaration import ACCURACY, MODEL, EhlLineParameters, groups, positions
from mdr_dask.models.parts.accuracy import missed, share
from mdr_dask.physics.lubrication import traction
from mdr_dask.physics.lubrication.film_formulas import (
    PAN_HAMROCK_CENTRAL,
    PAN_HAMROCK_MINIMUM,
    Groups,
    moes_parameters,
    square_of_half_width,
    thick_film,
)
from mdr_dask.physics.lubrication.limits import Limit
from mdr_dask.physics.lubrication.line_contact import LineContact, LineSolution, line_contact, solve_film
from mdr_dask.physics.outcome import Outcome

#: Outputs whose errors count relative to the half width, in which they are given.
_POSITIONS = {"minimum_position", "rupture_position", "spike_position"}
#: Number of neighbouring positions of a profile that share their largest error.
_AROUND = 5


def _groups(block: Block[EhlLineParameters]) -> Groups:
    """Return W, U and G of every case."""

    def lookup(name: str) -> FloatArray | None:
        return None if getattr(block.parameters, name) is None else block.column(name).astype(np.float64)

    return Groups(*groups(lookup))


def _line_contacts(block: Block[EhlLineParameters]) -> list[LineContact]:
    """Return the dimensionless case of every case; equal ones share a solution."""
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


def _estimates(case: EhlLineParameters, W: float, solution: LineSolution, outputs: tuple[str, ...]) -> dict[str, Limit]:
    """Return those outputs asked for that the solution decides, each with its error, in their units."""
    film, p0 = square_of_half_width(W), 2 * case.contact_modulus * float(np.sqrt(W / (2 * np.pi)))
    metres = film * (np.nan if case.radius is None else case.radius)
    stress = case.eyring_stress / p0 if case.shear_law == "eyring" else None
    place = positions(case)
    read = solution.estimate
    ways: dict[str, Callable[[], Limit]] = {
        "central_film": lambda: solution.central_film.scaled(film),
        "minimum_film": lambda: solution.minimum_film.scaled(film),
        "central_film_thickness": lambda: solution.central_film.scaled(metres),
        "minimum_film_thickness": lambda: solution.minimum_film.scaled(metres),
        "film": lambda: _profile(read(lambda grid: grid.film_between(place)).scaled(film)),
        "pressure": lambda: _profile(read(lambda grid: grid.pressure_between(place)).scaled(p0)),
        "minimum_position": lambda: solution.position(lambda grid: grid.minimum[0]),
        "rupture_position": lambda: solution.position(lambda grid: grid.rupture),
        "spike_position": lambda: solution.position(lambda grid: grid.spike[0]),
        "spike_pressure": lambda: read(lambda grid: grid.spike[1]).scaled(p0),
        "traction_coefficient": lambda: read(
            lambda grid: traction.sliding_coefficient(solution.case, grid, W, case.slide_roll_ratio, stress)
        ),
        "rolling_coefficient": lambda: read(lambda grid: traction.rolling_coefficient(grid, W)),
    }
    return {name: way() for name, way in ways.items() if name in outputs}


def _profile(found: Limit) -> Limit:
    """Give each position the largest error around it: where grids cross each other, they agree by chance."""
    return found._replace(error=maximum_filter1d(found.error, _AROUND))


def _relative_error(name: str, found: Limit) -> float:
    """Return the largest relative error of an output: of a position in half widths, of a pressure in its maximum."""
    error = found.error[np.isfinite(found.value)]
    scale = np.ones_like(found.value) if name in _POSITIONS else np.abs(found.value)
    if name == "pressure":
        scale = np.full_like(scale, np.max(scale))
    return float(np.max(share(error, scale[np.isfinite(found.value)]), initial=0.0))


def _missed(solution: LineSolution, estimates: dict[str, Limit], accuracy: float) -> str:
    """Say which outputs miss the accuracy and by how much; an empty string if none does."""
    errors = {name: _relative_error(name, found) for name, found in estimates.items()}
    return missed(errors, accuracy, f" on {solution.finest.nodes.size} nodes")


def compute(block: Block[EhlLineParameters]) -> Result:
    """Solve every different case of a block once; realisations of a case are the same."""
    parameters = _groups(block)
    given = dict(
        zip(
            ("formula_central_film", "formula_minimum_film", "moes_load", "moes_lubricant"),
            (PAN_HAMROCK_CENTRAL(*parameters), PAN_HAMROCK_MINIMUM(*parameters), *moes_parameters(*parameters)),
            strict=True,
        )
    )
    shape = (block.cases, len(block.realisations))
    lengths = {"position": block.parameters.profile_points}
    values = {
        name: np.full(shape + tuple(lengths[dim] for dim in MODEL.output(name).dims), np.nan) for name in block.outputs
    }
    result = Result(values, np.full(shape, Status.DONE, dtype=np.int8))
    solved: dict[LineContact, LineSolution] = {}
    accuracy = block.accuracy or ACCURACY
    for index, case in enumerate(_line_contacts(block)):
        if case not in solved:
            solved[case] = solve_film(case, accuracy)
        solution = solved[case]
        found: dict[str, FloatArray | float] = {name: float(column[index]) for name, column in given.items()}
        notes = [solution.reason]
        if solution.outcome == Outcome.CONVERGED:
            estimates = _estimates(block.case(index), float(parameters.W[index]), solution, block.outputs)
            for name, estimate in estimates.items():
                found |= {name: estimate.value, f"{name}_error": estimate.error}
            found["load_error"] = solution.load_error
            film = float(solution.central_film.value) * square_of_half_width(float(parameters.W[index]))
            notes += [_missed(solution, estimates, accuracy), thick_film(film)]
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
    """Return what a user of the outputs asked for should know about one case."""
    notes = []
    if {"formula_central_film", "formula_minimum_film"} & set(block.outputs):
        notes.append(PAN_HAMROCK_CENTRAL.outside(*parameters))
    if {"central_film_thickness", "minimum_film_thickness"} & set(block.outputs) and block.case(index).radius is None:
        notes.append("a film thickness in metres needs radius; without it only h/R is known")
    return notes


def distinct(block: Block[EhlLineParameters]) -> int:
    """Return the number of different solutions among the cases of a block."""
    return len(set(_line_contacts(block)))
