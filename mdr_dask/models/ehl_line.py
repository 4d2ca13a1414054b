"""The lubricated line contact: film, pressure and traction over load, speed and material parameter."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from mdr_dask.arrays import FloatArray
from mdr_dask.models.base import Block, Coordinate, Model, Output, Parameters, Result, Status, quantity

if TYPE_CHECKING:
    from mdr_dask.physics.lubrication.line_contact import LineContact, LineSolution

#: Contact modulus of steel on steel, 210 GPa and 0.3 each.
STEEL = 210e9 / (2 * (1 - 0.3**2))
#: Relative error of the films where the campaign names none.
ACCURACY = 1e-3

#: Each dimensionless number, its dimensional counterpart, and what that one needs beside it.
_PAIRS = (
    ("load_parameter", "line_load", ("radius",)),
    ("speed_parameter", "mean_velocity", ("radius", "viscosity")),
    ("material_parameter", "pressure_viscosity", ()),
)


class EhlLineParameters(Parameters):
    """A line contact by dimensionless numbers or by dimensional quantities: one of each pair."""

    load_parameter: float | None = quantity("1", "load parameter W = w/(E' R), E' = 2 E*", gt=0, default=None)
    speed_parameter: float | None = quantity("1", "speed parameter U = eta0 u/(E' R)", gt=0, default=None)
    material_parameter: float | None = quantity("1", "material parameter G = alpha E'", ge=0, default=None)
    line_load: float | None = quantity("N/m", "normal force per length of the line w", gt=0, default=None)
    mean_velocity: float | None = quantity("m/s", "mean velocity of the surfaces u = (u1 + u2)/2", gt=0, default=None)
    pressure_viscosity: float | None = quantity("1/Pa", "pressure-viscosity coefficient alpha", ge=0, default=None)
    radius: float | None = quantity("m", "reduced radius of curvature R", gt=0, default=None)
    viscosity: float | None = quantity("Pa*s", "viscosity at ambient pressure eta0", gt=6.4e-5, default=None)
    contact_modulus: float = quantity("Pa", "contact modulus E*", gt=0, default=STEEL)
    viscosity_law: Literal["barus", "roelands"] = Field("barus", description="viscosity over pressure")
    compressible: bool = Field(True, description="whether the density follows the law of Dowson and Higginson")
    inlet: float | None = quantity(
        "1", "where the oil begins, over the half width (negative); fully flooded if not given", lt=0, default=None
    )
    neighbours: bool = Field(
        False,
        description="whether a case borrows grids and fine solutions from the nearest point of a fixed lattice, "
        "three a decade: for sweeps denser than that",
    )
    slide_roll_ratio: float = quantity("1", "slide-roll ratio (u1 - u2)/u", ge=0, default=0.0)
    shear_law: Literal["newtonian", "eyring"] = Field("newtonian", description="shear stress over shear rate")
    eyring_stress: float = quantity("Pa", "Eyring stress of the shear law eyring", gt=0, default=5e6)
    profile_start: float = quantity("1", "first position of film and pressure, over the half width", default=-4.0)
    profile_end: float = quantity("1", "last position of film and pressure, over the half width", default=2.0)
    profile_points: int = quantity("1", "number of positions of film and pressure", ge=2, default=241)

    @model_validator(mode="after")
    def _one_of_each_pair(self) -> Self:
        """Demand one of each pair and what it needs."""
        for number, dimensional, companions in _PAIRS:
            given = [name for name in (number, dimensional) if getattr(self, name) is not None]
            if len(given) != 1:
                raise ValueError(f"expected either {number} or {dimensional}, got {' and '.join(given) or 'neither'}")
            missing = [name for name in companions if given == [dimensional] and getattr(self, name) is None]
            if missing:
                raise ValueError(f"{dimensional} needs {' and '.join(missing)}")
        if self.viscosity_law == "roelands" and self.viscosity is None:
            raise ValueError("viscosity_law roelands needs viscosity, which it refers to a pole in Pa s")
        if self.profile_end <= self.profile_start:
            raise ValueError(
                f"expected profile_end above profile_start {self.profile_start:g}, got {self.profile_end:g}"
            )
        return self


OUTPUTS = (
    Output("central_film", "1", "central film thickness over the radius h_c/R"),
    Output("minimum_film", "1", "minimum film thickness over the radius h_min/R"),
    Output("discretisation_error", "1", "estimated relative error of the worse of the two films"),
    Output("central_film_thickness", "m", "central film thickness h_c (needs radius)", default=False),
    Output("minimum_film_thickness", "m", "minimum film thickness h_min (needs radius)", default=False),
    Output(
        "film", "1", "film thickness over the radius h/R; where the film is torn, the gap", ("position",), default=False
    ),
    Output("pressure", "Pa", "pressure in the film", ("position",), default=False),
    Output("formula_central_film", "1", "h_c/R by Pan and Hamrock", default=False),
    Output("formula_minimum_film", "1", "h_min/R by Pan and Hamrock", default=False),
    Output("moes_load", "1", "Moes' load parameter M = W (2U)^(-1/2)", default=False),
    Output("moes_lubricant", "1", "Moes' lubricant parameter L = G (2U)^(1/4)", default=False),
    Output("minimum_position", "1", "position of the minimum film over the half width", default=False),
    Output("rupture_position", "1", "position where the film ends over the half width", default=False),
    Output("spike_position", "1", "position of the pressure spike over the half width", default=False),
    Output(
        "spike_pressure", "Pa", "pressure of the spike; its height does not converge with Barus' law", default=False
    ),
    Output("load_error", "1", "relative deviation of the pressure's integral from the load", default=False),
    Output("traction_coefficient", "1", "shear force at mid-film over the load", default=False),
    Output("traction_error", "1", "change of the traction coefficient from the coarser grid", default=False),
    Output("rolling_coefficient", "1", "rolling friction of each surface over the load", default=False),
)


def groups(lookup: Callable[[str], Any]) -> tuple[Any, Any, Any]:
    """Return W, U and G from one quantity of each pair.

    Parameters
    ----------
    lookup : callable, str -> array or None
        Gives the values of a parameter, None for one that is not given.
    """
    modulus = 2 * lookup("contact_modulus")
    W, U, G = lookup("load_parameter"), lookup("speed_parameter"), lookup("material_parameter")
    if W is None:
        W = lookup("line_load") / (modulus * lookup("radius"))
    if U is None:
        U = lookup("viscosity") * lookup("mean_velocity") / (modulus * lookup("radius"))
    if G is None:
        G = lookup("pressure_viscosity") * modulus
    return W, U, G


def _groups(block: Block[EhlLineParameters]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return W, U and G of every case."""

    def lookup(name: str) -> FloatArray | None:
        return None if getattr(block.parameters, name) is None else block.column(name).astype(np.float64)

    return groups(lookup)


def _line_contacts(block: Block[EhlLineParameters]) -> list[tuple[LineContact, bool]]:
    """Return the dimensionless case of every case, and whether it is solved beside the lattice; equal ones share."""
    from mdr_dask.physics.lubrication.line_contact import line_contact

    names = ("contact_modulus", "viscosity_law", "viscosity", "compressible", "inlet")
    columns = zip(*(block.column(name).tolist() for name in names), strict=True)
    cases = [
        line_contact(
            W, U, G, modulus, viscosity_law=law, viscosity=viscosity, compressible=bool(compressible), inlet=inlet
        )
        for W, U, G, (modulus, law, viscosity, compressible, inlet) in zip(
            *(group.tolist() for group in _groups(block)), columns, strict=True
        )
    ]
    return list(zip(cases, block.column("neighbours").tolist(), strict=True))


def _case_outputs(
    parameters: EhlLineParameters, W: float, solution: LineSolution, wanted: tuple[str, ...]
) -> dict[str, FloatArray | float]:
    """Return what a solution says in the units of the outputs; only profiles and traction that are wanted."""
    height = 8 * W / np.pi
    p0 = 2 * parameters.contact_modulus * float(np.sqrt(W / (2 * np.pi)))
    radius = np.nan if parameters.radius is None else parameters.radius
    values: dict[str, FloatArray | float] = {
        "central_film": solution.central_film * height,
        "minimum_film": solution.minimum_film * height,
        "central_film_thickness": solution.central_film * height * radius,
        "minimum_film_thickness": solution.minimum_film * height * radius,
        "discretisation_error": solution.error,
        "minimum_position": solution.minimum_position,
        "rupture_position": solution.rupture_position,
        "spike_position": solution.spike_position,
        "spike_pressure": solution.spike_pressure * p0,
        "load_error": solution.load_error,
    }
    position = _positions(parameters)
    if "film" in wanted:
        values["film"] = np.where(position >= solution.nodes[0], solution.film_at(position) * height, np.nan)
    if "pressure" in wanted:
        values["pressure"] = solution.pressure_at(position) * p0
    if {"traction_coefficient", "traction_error", "rolling_coefficient"} & set(wanted):
        from mdr_dask.physics.lubrication.traction import traction

        stress = parameters.eyring_stress / p0 if parameters.shear_law == "eyring" else None
        friction = traction(solution, W, parameters.slide_roll_ratio, stress)
        values["traction_coefficient"] = friction.sliding
        values["traction_error"] = friction.sliding_error
        values["rolling_coefficient"] = friction.rolling
    return values


def _positions(parameters: EhlLineParameters) -> FloatArray:
    return np.linspace(parameters.profile_start, parameters.profile_end, parameters.profile_points)


def compute(block: Block[EhlLineParameters]) -> Result:
    """Solve every different case of a block once; realisations of a case are the same."""
    from mdr_dask.physics.lubrication.film_formulas import PAN_HAMROCK_CENTRAL, PAN_HAMROCK_MINIMUM, moes_parameters
    from mdr_dask.physics.lubrication.lattice import solve_beside_lattice
    from mdr_dask.physics.lubrication.line_contact import solve

    W, U, G = _groups(block)
    moes = moes_parameters(W, U, G)
    given = {
        "formula_central_film": PAN_HAMROCK_CENTRAL(W, U, G),
        "formula_minimum_film": PAN_HAMROCK_MINIMUM(W, U, G),
        "moes_load": moes.M,
        "moes_lubricant": moes.L,
    }
    shape = (block.cases, len(block.realisations))
    lengths = {"position": block.parameters.profile_points}
    values = {
        name: np.full(shape + tuple(lengths[dim] for dim in MODEL.output(name).dims), np.nan) for name in block.outputs
    }
    status = np.full(shape, Status.DONE, dtype=np.int8)
    messages: dict[tuple[int, int], str] = {}
    solved: dict[tuple[LineContact, bool], LineSolution] = {}
    for index, (case, neighbours) in enumerate(_line_contacts(block)):
        if (case, neighbours) not in solved:
            solver = solve_beside_lattice if neighbours else solve
            solved[case, neighbours] = solver(case, block.accuracy or ACCURACY)
        solution = solved[case, neighbours]
        found: dict[str, FloatArray | float] = {name: float(column[index]) for name, column in given.items()}
        notes = [solution.reason] if solution.reason else []
        if solution.status == 0:
            found |= _case_outputs(block.case(index), float(W[index]), solution, block.outputs)
        else:
            status[index] = Status.NOT_CONVERGED
        notes += _warnings(block, index, (float(W[index]), float(U[index]), float(G[index])))
        for name in block.outputs:
            values[name][index] = found.get(name, np.nan)
        if notes:
            messages |= {(index, position): "; ".join(notes) for position in range(shape[1])}
    return Result(values, status, messages, len(solved))


def _warnings(block: Block[EhlLineParameters], index: int, groups: tuple[float, float, float]) -> list[str]:
    """Return what a user of the wanted outputs should know about one case."""
    from mdr_dask.physics.lubrication.film_formulas import PAN_HAMROCK_CENTRAL

    notes = []
    if {"formula_central_film", "formula_minimum_film"} & set(block.outputs):
        notes.append(PAN_HAMROCK_CENTRAL.outside(*groups))
    if {"central_film_thickness", "minimum_film_thickness"} & set(block.outputs) and block.case(index).radius is None:
        notes.append("a film thickness in metres needs radius; without it only h/R is known")
    return [note for note in notes if note]


def distinct(block: Block[EhlLineParameters]) -> int:
    """Return the number of different solutions among the cases of a block."""
    return len(set(_line_contacts(block)))


def seconds(block: Block[EhlLineParameters]) -> float:
    """Return the estimated time of `compute`: a solution takes about 20 ms, more for a tighter accuracy."""
    accuracy = block.accuracy or ACCURACY
    return 0.02 * block.cases * float(max(1.0, (ACCURACY / accuracy) ** 0.4))


def memory(_: Block[EhlLineParameters]) -> float:
    """Return the memory of one solution on the finest grid allowed: some 1100 numbers a node."""
    return 1100.0 * 8 * 10241


def coordinates(parameters: EhlLineParameters) -> dict[str, Coordinate]:
    """Return the positions of film and pressure."""
    return {"position": Coordinate(_positions(parameters), "1", "position over the half width x/a, flow to the right")}


MODEL = Model(
    name="ehl_line",
    version=2,
    summary="film, pressure and traction of a lubricated line contact (elastohydrodynamic)",
    parameters=EhlLineParameters,
    outputs=OUTPUTS,
    compute=compute,
    seconds=seconds,
    whole=("slide_roll_ratio", "eyring_stress"),
    coordinates=coordinates,
    distinct=distinct,
    memory=memory,
)
