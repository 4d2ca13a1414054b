"""The smooth rollers of a case: Hertzian contact, oil film, load shares of film and asperities, and friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from mdr_dask.models.mixed_lubrication.declaration import MixedLubrication
from mdr_dask.models.mixed_lubrication.lines import Source
from mdr_dask.physics.lubrication import breakthrough, film_formulas, line_contact, oil
from mdr_dask.physics.lubrication.film_formulas import HertzLine
from mdr_dask.physics.lubrication.load_sharing import Asperities, SharedLoad, share_load
from mdr_dask.physics.outcome import Outcome


class NoFilmError(Exception):
    """Error that is raised if the film of a case cannot be computed."""


class Film(NamedTuple):
    """Thickness of a film in m, and its estimated relative error."""

    thickness: float
    error: float = 0.0


@dataclass(frozen=True)
class Operation:
    """The smooth contact, the film and the boundary layer of a case.

    `viscosity` is the dynamic viscosity in Pa s. `alpha` is the pressure-viscosity coefficient in 1/Pa. `width` is the
    width of the contact in m. `film_error` is the relative error of the film thickness. The solver uses heights that
    are divided by `scale`, a length in m. `strength` is the strength of the boundary layer, divided by `scale`.
    """

    case: MixedLubrication
    source: Source
    contact: HertzLine
    viscosity: float
    alpha: float
    shared: SharedLoad
    film_error: float
    scale: float
    width: float
    strength: float
    warning: str

    @property
    def film(self) -> float:
        """Film thickness in m."""
        return self.shared.film

    @property
    def level(self) -> float:
        """Film thickness divided by `scale`."""
        return self.film / self.scale

    @property
    def length(self) -> float:
        """Length of the lines in m."""
        return self.source.length(self.case.perimeter)

    @property
    def squares(self) -> float:
        """Number of independent squares across the rollers: roller width divided by the longest wavelength."""
        return self.case.roller_width / self.case.longest()

    @property
    def rms(self) -> float:
        """Rms height in m of the sum of the two lines."""
        return self.scale * self.source.combined_rms()


def operation_of(case: MixedLubrication, accuracy: float | None = None) -> Operation:
    """Return the smooth contact and the film of a case. Raise NoFilmError if the EHL solution fails."""
    data, source = case.oil_data(), case.source()
    viscosity = float(data.dynamic(case.temperature))
    alpha = case.pressure_viscosity
    if isinstance(alpha, str):
        correlation = data.correlation if alpha == "oil" else alpha
        alpha = float(oil.pressure_viscosity(correlation, data.kinematic(case.temperature), viscosity))
    contact = case.dry_contact(case.normal_force)
    scale = case.rms_roughness or 1.0
    asperities = Asperities(scale * source.combined_rms(), case.longest(), case.contact_modulus)
    accuracy = accuracy or line_contact.ACCURACY
    film_of = _film_of(case, viscosity, alpha, accuracy)
    shared, error, warning = _shared_load(case, asperities, film_of, accuracy)
    return Operation(
        case=case,
        source=source,
        contact=contact,
        viscosity=viscosity,
        alpha=alpha,
        shared=shared,
        film_error=error,
        scale=scale,
        width=2 * float(contact.half_width),
        strength=float(
            breakthrough.layer_strength(case.layer_shear_strength, case.contact_modulus, case.layer_thickness)
        )
        / scale,
        warning="; ".join(note for note in (warning, film_formulas.thick_film(shared.film / case.radius)) if note),
    )


def _mean_pressure(case: MixedLubrication) -> float:
    return case.normal_force / (2 * float(case.dry_contact(case.normal_force).half_width) * case.roller_width)


def _shared_load(
    case: MixedLubrication, asperities: Asperities, film_of: tuple[Callable[[float], Film], str], accuracy: float
) -> tuple[SharedLoad, float, str]:
    """Return the film thickness with the load shares, the relative error of the film thickness, and a warning.

    The warning is an empty string unless the case is outside the range of the film formula, or the user gives a film
    thickness at which asperities would carry more than the load.
    """
    pressure = _mean_pressure(case)

    def asperity_share(film: float) -> float:
        return asperities.pressure(film) / pressure

    if case.film_thickness is not None:
        share = asperity_share(case.film_thickness)
        warning = "" if share <= 1 else "at the given film thickness, asperities would carry more than the load"
        return SharedLoad(case.film_thickness, max(0.0, 1 - share), min(share, 1.0)), 0.0, warning
    film_at, warning = film_of
    tolerance = accuracy / 10 if case.film_formula == "ehl" else accuracy / 1e6
    shared = share_load(lambda share: film_at(share).thickness, asperity_share, tolerance)
    if not shared.film > 0:
        raise NoFilmError("the film is too thin for the EHL solution, even if asperities carry the whole load")
    return shared, film_at(shared.film_share).error, warning


def _film_of(
    case: MixedLubrication, viscosity: float, alpha: float, accuracy: float
) -> tuple[Callable[[float], Film], str]:
    """Return a function that computes the film from the fraction of the load on the film. Also return a warning."""
    E_star, radius = case.contact_modulus, case.radius
    velocity = case.rotation_speed * case.roller_radius
    line_load = case.normal_force / case.roller_width
    groups = film_formulas.dimensionless_groups(line_load, viscosity, velocity, alpha, E_star, radius)
    W, U, G = (float(group) for group in groups)

    def by_solution(share: float) -> Film:
        contact = line_contact.line_contact(
            (W, U / share, G * share), E_star * share, viscosity_law=case.viscosity_law, viscosity=viscosity
        )
        found = _solved(contact, accuracy)
        return Film(found.thickness * film_formulas.square_of_half_width(W) * radius, found.error)

    def by_formula(share: float) -> Film:
        return Film(float(formula(W, U / share, G * share)) * radius)

    if case.film_formula == "ehl":
        return by_solution, ""
    formula = film_formulas.FORMULAS[case.film_formula]
    return by_formula, formula.outside(W, U, G)


@lru_cache(maxsize=1024)
def _solved(contact: line_contact.LineContact, accuracy: float) -> Film:
    """Return the central film thickness of the EHL solution in units of ``a^2/R``, and its relative error."""
    solution = line_contact.solve_film(contact, accuracy)
    if solution.outcome == Outcome.FILM_COLLAPSED:
        return Film(0.0)  # the film is too thin for the grids: the asperities will carry nearly the whole load
    if solution.reason:
        raise NoFilmError(solution.reason)
    film = solution.central_film
    return Film(float(film.value), float(film.error / film.value))


def fixed_values(operation: Operation) -> dict[str, float]:
    """Return the outputs that do not depend on the realisation, with their errors."""
    film, share, error = operation.film, operation.shared.asperity_share, operation.film_error
    values = {
        "film": film,
        "film_ratio": film / operation.rms,
        "asperity_load_share": share,
        "friction_coefficient": friction(operation, film, share),
    }
    errors = dict.fromkeys(values, 0.0)
    if error > 0:
        # error of the asperity load: change of this load if the film is thinner by the error of the film thickness
        asperities = Asperities(operation.rms, operation.case.longest(), operation.case.contact_modulus)
        loaded = asperities.pressure(film * (1 - error)) / _mean_pressure(operation.case)
        errors = {
            "film": error * film,
            "film_ratio": error * film / operation.rms,
            "asperity_load_share": abs(loaded - share),
            "friction_coefficient": abs(
                friction(operation, film * (1 - error), min(loaded, 1.0)) - values["friction_coefficient"]
            ),
        }
    values |= {f"{name}_error": value for name, value in errors.items()}
    return values | {
        "contact_half_width": float(operation.contact.half_width),
        "independent_squares": operation.squares,
    }


def friction(operation: Operation, film: float, asperity_share: float) -> float:
    """Return the coefficient of friction: boundary friction of the asperities plus shear of the film."""
    case = operation.case
    sliding = case.slide_roll_ratio * case.rotation_speed * case.roller_radius
    if sliding == 0:
        return 0.0
    liquid = film_formulas.fluid_friction(
        operation.contact,
        film,
        sliding,
        lambda pressure: oil.log_viscosity(case.viscosity_law, pressure, operation.viscosity, operation.alpha),
        case.eyring_stress,
        1 - asperity_share,
    )
    return case.boundary_friction * asperity_share + liquid
