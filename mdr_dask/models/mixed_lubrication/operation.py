"""What a case is before its roughness: contact, film, oil, layer; and the friction that follows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mdr_dask.models.mixed_lubrication.lines import Source
from mdr_dask.models.mixed_lubrication.parameters import MixedLubrication

if TYPE_CHECKING:
    from mdr_dask.physics.lubrication.film_formulas import Groups, HertzLine
    from mdr_dask.physics.lubrication.line_contact import LineContact


class Film(NamedTuple):
    """Thickness over R*, a warning, and why there is none (then it is NaN)."""

    thickness: float
    warning: str = ""
    problem: str = ""


@dataclass(frozen=True)
class Operation:
    """What a case is before any roughness: contact, film, and how the layer stands to the unit lines."""

    case: MixedLubrication
    source: Source
    contact: HertzLine
    E_star: float
    film: float
    viscosity: float
    alpha: float
    scale: float  # heights of the lines in m
    spacing: float
    window: int
    strength: float  # of the layer, for lines in units of `scale`
    warning: str
    problem: str

    @property
    def level(self) -> float:
        """Film thickness in units of the lines."""
        return self.film / self.scale


def operation_of(case: MixedLubrication) -> Operation:
    """Return the smooth contact of a case and its film, case by case: the value must not know its neighbours."""
    from mdr_dask.physics.lubrication import breakthrough, oil
    from mdr_dask.physics.lubrication import film_formulas as film

    data, source = case.oil_data(), case.source()
    viscosity = float(data.dynamic(case.temperature))
    alpha = case.pressure_viscosity
    if isinstance(alpha, str):
        correlation = data.correlation if alpha == "oil" else alpha
        alpha = float(oil.pressure_viscosity(correlation, data.kinematic(case.temperature), viscosity))
    E_star = case.contact_modulus()
    radius = case.roller_radius / 2
    velocity = case.rotation_speed * case.roller_radius
    line_load = case.normal_force / case.roller_width
    groups = film.dimensionless_groups(line_load, viscosity, velocity, alpha, E_star, radius)
    smooth = Film(case.film_thickness / radius) if case.film_thickness else _film(case, groups, E_star, viscosity)
    contact = case.dry_contact(case.normal_force)
    spacing = source.spacing(case.perimeter)
    scale = case.rms_roughness or 1.0
    return Operation(
        case=case,
        source=source,
        contact=contact,
        E_star=E_star,
        film=case.film_thickness or smooth.thickness * radius,
        viscosity=viscosity,
        alpha=alpha,
        scale=scale,
        spacing=spacing,
        window=breakthrough.window_points(float(contact.half_width), spacing, source.points),
        strength=float(breakthrough.layer_strength(case.layer_shear_strength, E_star, case.layer_thickness)) / scale,
        warning=smooth.warning,
        problem=smooth.problem,
    )


def _film(case: MixedLubrication, groups: Groups, E_star: float, viscosity: float) -> Film:
    from mdr_dask.physics.lubrication import film_formulas as film
    from mdr_dask.physics.lubrication import line_contact

    W, U, G = (float(group) for group in groups)
    if case.film_formula == "ehl":
        law = case.viscosity_law
        return _solved(line_contact.line_contact(W, U, G, E_star, viscosity_law=law, viscosity=viscosity), W)
    formula = film.FORMULAS[case.film_formula]
    return Film(float(formula(W, U, G)), formula.outside(W, U, G))


@lru_cache(maxsize=1024)
def _solved(contact: LineContact, W: float) -> Film:
    """Return the central film of the EHL solution, once for all realisations: Hertz units are ``a^2/R^2 = 8 W/pi``."""
    from mdr_dask.physics.lubrication import line_contact

    solution = line_contact.solve(contact)
    if solution.reason:
        return Film(np.nan, problem=solution.reason)
    return Film(float(solution.central_film.value) * 8 * W / np.pi)


def fixed_values(operation: Operation) -> dict[str, float]:
    """Return the outputs that no roughness enters."""
    rms = operation.scale * operation.source.combined_rms()
    half_width = float(operation.contact.half_width)
    return {"film": operation.film, "film_ratio": operation.film / rms, "contact_half_width": half_width}


def friction(operation: Operation, share: float) -> float:
    """Return the coefficient of friction: solid over the share of the width in intimate contact, film elsewhere."""
    from mdr_dask.physics.lubrication import film_formulas as film
    from mdr_dask.physics.lubrication import oil

    case = operation.case
    sliding = case.slide_roll_ratio * case.rotation_speed * case.roller_radius
    if sliding == 0:
        return 0.0
    liquid = film.fluid_friction(
        operation.contact,
        operation.film,
        sliding,
        lambda pressure: oil.log_viscosity(case.viscosity_law, pressure, operation.viscosity, operation.alpha),
        case.eyring_stress,
    )
    return share * case.boundary_friction + (1 - share) * liquid
