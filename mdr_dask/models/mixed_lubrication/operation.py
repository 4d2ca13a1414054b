"""Results that are the same in all realisations of a case: Hertzian contact, oil film, load sharing and friction."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from mdr_dask.models.mixed_lubrication.declaration import MixedLubrication
from mdr_dask.models.mixed_lubrication.lines import Source
from mdr_dask.physics.lubrication import film_formulas, traction
from mdr_dask.physics.lubrication.breakthrough import layer_strength
from mdr_dask.physics.lubrication.film_formulas import HertzLine
from mdr_dask.physics.lubrication.line_contact import ACCURACY, LineContact, line_contact, solve_film
from mdr_dask.physics.lubrication.load_sharing import asperity_pressure, share_load
from mdr_dask.physics.outcome import Outcome


class NoFilmError(Exception):
    """Error that is raised if the film of a case cannot be computed."""


@dataclass(frozen=True)
class Operation:
    """The smooth contact and the film of a case.

    `viscosity` is the dynamic viscosity in Pa s at ambient pressure. `smooth` is the contact in dimensionless numbers.
    `film` is the film thickness in m, and `film_error` its relative error. `asperity_share` is the fraction of the load
    that asperities carry. `warning` is empty if there is none.
    """

    case: MixedLubrication
    source: Source
    contact: HertzLine
    viscosity: float
    smooth: LineContact
    film: float
    film_error: float
    asperity_share: float
    warning: str

    @property
    def width(self) -> float:
        """Width of the contact in m."""
        return 2 * float(self.contact.half_width)

    @property
    def scale(self) -> float:
        """Height in m by which the heights of the lines are divided, or 1 if the lines have heights in m."""
        return self.case.rms_roughness or 1.0

    @property
    def strength(self) -> float:
        """Strength s = pi tau0 / (12 E* h_c) of the boundary layer in 1/m, divided by `scale`."""
        case = self.case
        return float(layer_strength(case.layer_shear_strength, case.contact_modulus, case.layer_thickness)) / self.scale

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
    alpha = case.pressure_viscosity if case.pressure_viscosity != "oil" else float(data.alpha(case.temperature))
    velocity, line_load = case.rotation_speed * case.roller_radius, case.normal_force / case.roller_width
    groups = film_formulas.dimensionless_groups(
        line_load, viscosity, velocity, alpha, case.contact_modulus, case.radius
    )
    W, U, G = (float(group) for group in groups)
    accuracy = accuracy or ACCURACY

    def smooth(share: float) -> LineContact:
        """Return the smooth contact with load and modulus multiplied by the film's `share` of the load.

        This is the scaling of `load_sharing`.
        """
        numbers, modulus = (W, U / share, G * share), case.contact_modulus * share
        return line_contact(numbers, modulus, viscosity_law=case.viscosity_law, viscosity=viscosity)

    def film_by_solution(share: float) -> tuple[float, float]:
        film, error = _solved(smooth(share), accuracy)
        return film * film_formulas.square_of_half_width(W) * case.radius, error

    def film_by_formula(share: float) -> tuple[float, float]:
        return float(film_formulas.FORMULAS[case.film_formula](W, U / share, G * share)) * case.radius, 0.0

    rms = (case.rms_roughness or 1.0) * source.combined_rms()
    error, warning = 0.0, ""
    if case.film_thickness is not None:
        film = case.film_thickness
        share = _asperity_share(case, rms, film)
        if share > 1:
            share, warning = 1.0, "at the given film thickness, asperities would carry more than the whole load"
    else:
        by_solution = case.film_formula == "ehl"
        film_at = film_by_solution if by_solution else film_by_formula
        film, film_share, share = share_load(
            lambda share: film_at(share)[0],
            lambda film: _asperity_share(case, rms, film),
            accuracy / 10 if by_solution else accuracy / 1e6,
        )
        if not film > 0:
            raise NoFilmError("the film is too thin for the EHL solution, even if asperities carry the whole load")
        error = film_at(film_share)[1]
        warning = "" if by_solution else film_formulas.FORMULAS[case.film_formula].outside(W, U, G)
    warning = "; ".join(note for note in (warning, film_formulas.thick_film(film / case.radius)) if note)
    contact = case.dry_contact(case.normal_force)
    return Operation(case, source, contact, viscosity, smooth(1.0), film, error, share, warning)


def _asperity_share(case: MixedLubrication, rms: float, film: float) -> float:
    """Return the load on the asperities, divided by the normal force; `film` is the film thickness in m."""
    width = 2 * float(case.dry_contact(case.normal_force).half_width)
    pressure = asperity_pressure(film, rms, case.longest(), case.contact_modulus)
    return pressure / (case.normal_force / (width * case.roller_width))


@lru_cache(maxsize=1024)
def _solved(contact: LineContact, accuracy: float) -> tuple[float, float]:
    """Return the central film thickness of the EHL solution in units of ``a^2/R``, and its relative error.

    Return zeros if the film is too thin for the grids. Raise NoFilmError if there is no solution for another reason.
    """
    solution = solve_film(contact, accuracy)
    if solution.outcome == Outcome.FILM_COLLAPSED:
        return 0.0, 0.0  # `share_load` then tries a smaller load share of the film
    if solution.reason:
        raise NoFilmError(solution.reason)
    film = solution.central_film
    return float(film.value), float(film.error / film.value)


def fixed_values(operation: Operation) -> dict[str, float]:
    """Return the outputs that do not depend on the realisation, with their errors."""
    film, share, error = operation.film, operation.asperity_share, operation.film_error
    values = {
        "film": film,
        "film_ratio": film / operation.rms,
        "asperity_load_share": share,
        "friction_coefficient": friction(operation, film, share),
    }
    errors = dict.fromkeys(values, 0.0)
    if error > 0:
        # error of the asperity load: change of this load if the film is thinner by the error of the film thickness
        thinner = film * (1 - error)
        loaded = _asperity_share(operation.case, operation.rms, thinner)
        errors = {
            "film": error * film,
            "film_ratio": error * film / operation.rms,
            "asperity_load_share": abs(loaded - share),
            "friction_coefficient": abs(
                friction(operation, thinner, min(loaded, 1.0)) - values["friction_coefficient"]
            ),
        }
    values |= {f"{name}_error": value for name, value in errors.items()}
    return values | {
        "contact_half_width": float(operation.contact.half_width),
        "independent_squares": operation.squares,
    }


def friction(operation: Operation, film: float, asperity_share: float) -> float:
    """Return the coefficient of friction: boundary friction of the asperities plus shear of the film.

    In pure rolling, the coefficient is 0.
    """
    case = operation.case
    sliding = abs(case.slide_roll_ratio) * case.rotation_speed * case.roller_radius
    if sliding == 0:
        return 0.0
    stress = operation.viscosity * sliding / film
    liquid = traction.uniform_film_coefficient(
        operation.contact, stress, operation.smooth.liquid, case.eyring_stress, 1 - asperity_share
    )
    return case.boundary_friction * asperity_share + liquid
