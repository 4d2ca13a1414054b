"""Parameters and outputs of the model `ehl_line`.

This module does not import the solver, so the module loads quickly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from mdr_dask.arrays import FloatArray
from mdr_dask.models.base import Alternatives, Coordinate, Model, Number, Output, Parameters, deferred, quantity
from mdr_dask.physics.lubrication.film_formulas import STEEL

#: Each row contains a dimensionless number, the dimensional quantity that a user can give instead, and the other
#: parameters that the dimensional quantity needs. For example, `line_load` with `radius` replaces `load_parameter`.
_PAIRS = (
    ("load_parameter", "line_load", ("radius",)),
    ("speed_parameter", "mean_velocity", ("radius", "viscosity")),
    ("material_parameter", "pressure_viscosity", ()),
)


class EhlLineParameters(Parameters):
    """A lubricated line contact.

    For the load, the speed and the material, a user gives either the dimensionless number (W, U or G) or a quantity
    with a unit.
    """

    renamed: ClassVar[Mapping[str, str]] = {
        "neighbours": "leave it out, because every case is solved independently of the others",
        "discretisation_error": "central_film and minimum_film come with central_film_error and minimum_film_error",
        "traction_error": "traction_coefficient comes with traction_coefficient_error",
    }
    alternatives: ClassVar[tuple[Alternatives, ...]] = tuple(
        ((dimensional, *companions), (number,)) for number, dimensional, companions in _PAIRS
    )
    settings: ClassVar[frozenset[str]] = frozenset({"profile_start", "profile_end", "profile_points"})
    load_parameter: float | None = quantity(
        "1",
        "load parameter W = w/(E' R), with the line load w, the radius R and twice the contact modulus, E' = 2 E*",
        usual="2e-5",
        gt=0,
        default=None,
    )
    speed_parameter: float | None = quantity(
        "1",
        "speed parameter U = eta0 u/(E' R), with the viscosity eta0, the mean velocity u, the radius R and E' = 2 E*",
        usual="1e-11",
        gt=0,
        default=None,
    )
    material_parameter: float | None = quantity(
        "1",
        "material parameter G = alpha E', with the pressure-viscosity coefficient alpha and E' = 2 E*",
        usual="5000",
        ge=0,
        default=None,
    )
    line_load: float | None = quantity(
        "N/m", "line load w, the normal force per length of the contact", usual="100 N/mm", gt=0, default=None
    )
    mean_velocity: float | None = quantity(
        "m/s", "mean velocity of the surfaces (entrainment) u = (u1 + u2)/2", usual="1 m/s", gt=0, default=None
    )
    pressure_viscosity: float | None = quantity(
        "1/Pa", "pressure-viscosity coefficient alpha", usual="20 1/GPa", ge=0, default=None
    )
    radius: float | None = quantity(
        "m", "reduced radius of curvature R of the two bodies, 1/R = 1/R1 + 1/R2", usual="10 mm", gt=0, default=None
    )
    viscosity: float | None = quantity(
        "Pa*s", "dynamic viscosity eta0 at ambient pressure", usual="80 mPa s", gt=6.4e-5, default=None
    )
    contact_modulus: float = quantity(
        "Pa", "contact modulus E*, 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2", usual="115 GPa", gt=0, default=STEEL
    )
    viscosity_law: Literal["barus", "roelands"] = Field(
        "barus", description="law by which the viscosity grows with the pressure"
    )
    compressible: bool = Field(
        True, description="whether the density grows with the pressure according to the law of Dowson and Higginson"
    )
    inlet: float | None = quantity(
        "1",
        "position x/a at which the oil film begins, with the Hertzian half width a. The position is negative, because "
        "the middle of the contact is at 0. If inlet is not given, the contact is fully flooded",
        lt=0,
        default=None,
    )
    slide_roll_ratio: float = quantity(
        "1",
        "slide-roll ratio (u1 - u2)/u; u1 and u2 are the velocities of the surfaces, and u is their mean. 0 is pure "
        "rolling",
        usual="0.25, 25 %",
        ge=0,
        default=0.0,
    )
    shear_law: Literal["newtonian", "eyring"] = Field(
        "newtonian", description="law of the shear stress as a function of the shear rate"
    )
    eyring_stress: float = quantity(
        "Pa", "Eyring stress of the oil, used only with shear_law: eyring", usual="5 MPa", gt=0, default=5e6
    )
    profile_start: float = quantity(
        "1", "first position x/a at which film and pressure are stored, in Hertzian half widths a", default=-4.0
    )
    profile_end: float = quantity(
        "1", "last position x/a at which film and pressure are stored, in Hertzian half widths a", default=2.0
    )
    profile_points: int = quantity("1", "number of positions at which film and pressure are stored", ge=2, default=241)

    @model_validator(mode="after")
    def _one_of_each_pair(self) -> Self:
        for number, dimensional, companions in _PAIRS:
            given = [name for name in (number, dimensional) if getattr(self, name) is not None]
            if len(given) != 1:
                raise ValueError(f"expected either {number} or {dimensional}, got {' and '.join(given) or 'neither'}")
            missing = [name for name in companions if given == [dimensional] and getattr(self, name) is None]
            if missing:
                raise ValueError(f"{dimensional} needs {' and '.join(missing)}")
        if self.viscosity_law == "roelands" and self.viscosity is None:
            raise ValueError("`viscosity_law: roelands` needs the parameter `viscosity`")
        if self.profile_end <= self.profile_start:
            raise ValueError(
                f"expected a profile_end above the profile_start {self.profile_start:.9g}, got {self.profile_end:.9g}"
            )
        return self


OUTPUTS = (
    Output("central_film", "1", "relative central film thickness h_c/R", has_error=True),
    Output("minimum_film", "1", "relative minimum film thickness h_min/R", has_error=True),
    Output("central_film_thickness", "m", "central film thickness h_c (needs radius)", default=False, has_error=True),
    Output("minimum_film_thickness", "m", "minimum film thickness h_min (needs radius)", default=False, has_error=True),
    Output(
        "film",
        "1",
        "relative film thickness h/R; behind the end of the film, h is the gap between the surfaces",
        ("position",),
        default=False,
        has_error=True,
    ),
    Output("pressure", "Pa", "pressure in the film", ("position",), default=False, has_error=True),
    Output(
        "formula_central_film",
        "1",
        "relative central film thickness h_c/R from the formula of Pan and Hamrock",
        default=False,
    ),
    Output(
        "formula_minimum_film",
        "1",
        "relative minimum film thickness h_min/R from the formula of Pan and Hamrock",
        default=False,
    ),
    Output("spike_position", "1", "position x/a of the pressure spike", default=False, has_error=True),
    Output(
        "traction_coefficient",
        "1",
        "traction coefficient: integral of the shear stress in the middle of the film, divided by the load",
        default=False,
        has_error=True,
    ),
)


def groups(lookup: Callable[[str], Any]) -> tuple[Any, Any, Any]:
    """Return the dimensionless parameters W (load), U (speed) and G (material).

    If the user does not give one of these numbers, it is computed from quantities with units. ``lookup(name)`` returns
    the values of the parameter `name`, or None if the user does not give this parameter.
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


def positions(parameters: EhlLineParameters) -> FloatArray:
    """Return the positions at which film and pressure are stored, divided by the half width of the contact."""
    return np.linspace(parameters.profile_start, parameters.profile_end, parameters.profile_points)


def coordinates(parameters: EhlLineParameters) -> dict[str, Coordinate]:
    """Return the positions at which film and pressure are stored, as a coordinate."""
    return {
        "position": Coordinate(
            positions(parameters), "1", "position x/a in Hertzian half widths, positive in the direction of flow"
        )
    }


_SOLVE = "mdr_dask.models.ehl_line.solve"
MODEL = Model(
    name="ehl_line",
    version=11,
    summary="film, pressure and traction of a lubricated line contact (elastohydrodynamic)",
    parameters=EhlLineParameters,
    outputs=OUTPUTS,
    compute=deferred(_SOLVE, "compute"),
    operations=deferred(_SOLVE, "operations"),
    whole=("slide_roll_ratio", "eyring_stress"),
    coordinates=coordinates,
    numbers=(
        Number("load_parameter", "line_load / (2 * contact_modulus * radius)", "load parameter W = w/(E' R)"),
        Number(
            "speed_parameter",
            "viscosity * mean_velocity / (2 * contact_modulus * radius)",
            "speed parameter U = eta0 u/(E' R)",
        ),
        Number("material_parameter", "2 * contact_modulus * pressure_viscosity", "material parameter G = alpha E'"),
        Number("moes_load", "load_parameter * (2 * speed_parameter) ** -0.5", "Moes' load parameter M = W (2U)^(-1/2)"),
        Number(
            "moes_lubricant",
            "material_parameter * (2 * speed_parameter) ** 0.25",
            "Moes' lubricant parameter L = G (2U)^(1/4)",
        ),
    ),
)
