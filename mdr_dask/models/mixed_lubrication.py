"""Mixed lubrication of two rough rollers with breakthrough of the boundary layer (thesis chapter 5)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from mdr_dask.errors import DataError
from mdr_dask.models.base import (
    Block,
    Coordinate,
    DataFile,
    FloatArray,
    Model,
    NamedFile,
    Output,
    Parameters,
    Result,
    Status,
    quantity,
)

if TYPE_CHECKING:
    from mdr_dask.physics.breakthrough import Excursions
    from mdr_dask.physics.film import HertzLine
    from mdr_dask.physics.oil import Oil

LOAD_SHARE_WARNING = 0.03  # of the load on asperities, beyond which the film formula no longer holds
FILM_RATIO_WARNING = 0.5  # below it overlapping asperities merge into clusters that no longer break
STRIDES = 8  # windows with creep that overlap by more than 1 - 1/8 tell the same
POSITIONS = np.linspace(-1.5, 1.5, 1501)

Positive = Annotated[float, Field(gt=0)]


class OilData(Parameters):
    """An oil by the numbers of its data sheet."""

    temperature_1: float = quantity("K", "first temperature of the two viscosities", gt=0)
    viscosity_1: float = quantity("m^2/s", "kinematic viscosity at temperature_1", gt=0)
    temperature_2: float = quantity("K", "second temperature of the two viscosities", gt=0)
    viscosity_2: float = quantity("m^2/s", "kinematic viscosity at temperature_2", gt=0)
    density: float = quantity("kg/m^3", "density at density_temperature", gt=0)
    density_temperature: float = quantity("K", "temperature of the density", default=288.15, gt=0)
    correlation: Literal["gold_mineral", "gold_polyalphaolefin", "gold_ester", "gold_polyglycol", "wooster"] = Field(
        default="gold_mineral", description="pressure-viscosity correlation"
    )
    lowest_temperature: float | None = quantity("K", "where the data begin; the lower of the two", default=None, gt=0)
    highest_temperature: float | None = quantity("K", "where the data end; the higher of the two", default=None, gt=0)

    @model_validator(mode="after")
    def _falls(self) -> Self:
        from mdr_dask.physics.oil import walther_constants

        walther_constants(self.temperature_1, self.viscosity_1, self.temperature_2, self.viscosity_2)
        return self


class MixedLubrication(Parameters):
    """Two equal rough rollers pressed together on an oil film; the defaults are the twin-disc rig of the thesis."""

    normal_force: float = quantity("N", "normal force F_N on the rollers", gt=0)
    rotation_speed: float = quantity("rad/s", "mean rotation speed of the two rollers", gt=0)
    temperature: float = quantity("K", "temperature of rollers and oil", gt=0)
    slide_roll_ratio: float = quantity(
        "1", "creep (v1 - v2)/u with the mean velocity u; 0 is pure rolling", default=0.0, ge=-2, le=2
    )
    rms_roughness: Positive | None = quantity(
        "m", "rms height of each roller; needed unless profiles are given", default=None
    )
    hurst: float = quantity("1", "Hurst exponent H of the roughness", default=0.7, ge=0, le=1)
    points: int = quantity("1", "points of each line around the roller", default=1_000_000, ge=64, le=10**7)
    longest_wavelength: Positive | Literal["auto"] = quantity(
        "m", "wavelength above which there is no roughness; auto is 2a at cutoff_force", default="auto"
    )
    cutoff_force: float = quantity(
        "N", "normal force whose contact width is the longest wavelength", default=1600, gt=0
    )
    shortest_wavelength: Positive | Literal["auto"] = quantity(
        "m", "wavelength below which there is no roughness; auto is ten spacings of the points", default="auto"
    )
    profile_1: NamedFile | None = Field(default=None, description="measured line of roller 1: two columns x, z in m")
    profile_2: NamedFile | None = Field(default=None, description="measured line of roller 2: two columns x, z in m")
    layer_thickness: float = quantity("m", "critical thickness h_c of the boundary layer", default=5e-9, gt=0)
    layer_shear_strength: float = quantity("Pa", "limiting shear stress tau0 of the boundary layer", default=1e6, ge=0)
    oil: Literal["mobilgear_shc_xmp_320"] | OilData = Field(
        default="mobilgear_shc_xmp_320", description="a named oil, or the numbers of a data sheet"
    )
    pressure_viscosity: (
        Positive | Literal["oil", "gold_mineral", "gold_polyalphaolefin", "gold_ester", "gold_polyglycol", "wooster"]
    ) = quantity("1/Pa", "pressure-viscosity coefficient alpha, or the correlation that gives it", default="oil")
    film_formula: Literal["pan_hamrock", "pan_hamrock_minimum", "dowson_higginson"] = Field(
        default="pan_hamrock", description="where the film thickness comes from"
    )
    film_thickness: Positive | None = quantity("m", "film thickness, instead of the formula's", default=None)
    edge_rule: Literal["part", "clip", "whole", "inside"] = Field(
        default="part", description="what becomes of a cluster that the edge of the contact cuts"
    )
    roller_radius: float = quantity("m", "radius of each roller", default=0.05, gt=0)
    roller_width: float = quantity("m", "length L' of the contact line", default=0.01, gt=0)
    young_modulus: float = quantity("Pa", "Young's modulus of the rollers", default=210e9, gt=0)
    poisson_ratio: float = quantity("1", "Poisson's ratio of the rollers", default=0.3, ge=0, le=0.5)
    resistivity: float = quantity("ohm m", "electrical resistivity of the rollers", default=2e-7, gt=0)
    boundary_friction: float = quantity("1", "coefficient of friction of intimate contact", default=0.1, ge=0)
    eyring_stress: float = quantity("Pa", "Eyring stress of the oil under shear", default=5e6, gt=0)
    viscosity_law: Literal["barus", "roelands"] = Field(
        default="barus", description="viscosity under pressure, for the friction of the film"
    )
    trace_points: int = quantity("1", "angles of contact_length_trace in a turn", default=3600, ge=2, le=10**6)
    measured: NamedFile | None = Field(
        default=None, description="table of measured contact probabilities, for the fit `breakthrough`"
    )

    @model_validator(mode="after")
    def _holds_together(self) -> Self:
        problem = _problem(self)
        if problem:
            raise ValueError(problem)
        return self


OUTPUTS = (
    Output("breakthrough_probability", "1", "share of time with the boundary layer broken anywhere"),
    Output("contact_length", "m", "mean length in intimate contact"),
    Output("film", "m", "film thickness h0"),
    Output("film_ratio", "1", "film thickness over combined rms height"),
    Output("load_share", "1", "share of the load on overlapping asperities"),
    Output("discretisation_error", "1", "breakthrough probability less that on every second point", default=True),
    Output("contact_conductance", "S", "mean electrical conductance of the spots in contact", default=False),
    Output("contact_resistance", "ohm", "reciprocal of the mean conductance, infinite without contact", default=False),
    Output("friction_coefficient", "1", "coefficient of friction of film and spots in contact", default=False),
    Output("contact_half_width", "m", "half width a of the Hertzian contact", default=False),
    Output("contact_length_trace", "m", "length in intimate contact over the turn", ("angle",), default=False),
    Output("upper_profile", "m", "surface of roller 1 where contact is greatest", ("position",), default=False),
    Output("lower_profile", "m", "surface of roller 2 where contact is greatest", ("position",), default=False),
)


def coordinates(parameters: MixedLubrication) -> dict[str, Coordinate]:
    """Return the angles of a trace and the places, in half widths, of the profiles."""
    angles = 2 * np.pi * np.arange(parameters.trace_points) / parameters.trace_points
    return {
        "angle": Coordinate(angles, "rad", "rolling angle"),
        "position": Coordinate(POSITIONS, "1", "distance from the middle of the contact over its half width"),
    }


def _oil(case: MixedLubrication) -> Oil:
    from mdr_dask.physics import oil

    data = case.oil
    if isinstance(data, str):
        return oil.OILS[data]
    low, high = sorted((data.temperature_1, data.temperature_2))
    return oil.Oil(
        data.temperature_1,
        data.viscosity_1,
        data.temperature_2,
        data.viscosity_2,
        data.density,
        data.density_temperature,
        data.correlation,
        data.lowest_temperature or low,
        data.highest_temperature or high,
        "campaign file",
    )


def _dry_contact(case: MixedLubrication, force: float) -> HertzLine:
    from mdr_dask.physics import film

    modulus = float(film.reduced_modulus(*(case.young_modulus, case.poisson_ratio) * 2))
    return film.hertz_line(force / case.roller_width, modulus, case.roller_radius / 2)


@dataclass(frozen=True)
class _Spectrum:
    """What fixes the two generated lines but for their phases, in units of the rms height."""

    points: int
    hurst: float
    longest: float  # harmonic number of the longest wavelength
    modes: int  # harmonic number of the shortest wavelength

    def lines(self, seed: int, realisation: int) -> tuple[FloatArray, FloatArray]:
        """Return the lines of both rollers; one stream feeds them in turn, so that more modes leave the first ones."""
        from mdr_dask.physics import roughness

        amplitude = roughness.amplitudes(self.modes, self.hurst, longest=self.longest)
        phase = roughness.phases(seed, realisation, 2 * self.modes).reshape(-1, 2)
        return (
            roughness.line(amplitude, phase[:, 0].copy(), self.points),
            roughness.line(amplitude, phase[:, 1].copy(), self.points),
        )


def _spectrum(case: MixedLubrication) -> _Spectrum:
    perimeter = 2 * np.pi * case.roller_radius
    longest = case.longest_wavelength
    if longest == "auto":
        longest = 2 * float(_dry_contact(case, case.cutoff_force).half_width)
    shortest = 10 * perimeter / case.points if case.shortest_wavelength == "auto" else case.shortest_wavelength
    return _Spectrum(case.points, case.hurst, perimeter / longest, int(perimeter / shortest * (1 + 1e-12)))


def _problem(case: MixedLubrication) -> str:
    """Say why a case cannot be computed, in one sentence; an empty string if it can."""
    if (case.profile_1 is None) != (case.profile_2 is None):
        return "expected the profiles of both rollers or of none, got one"
    if case.film_thickness is None or case.pressure_viscosity == "oil":
        outside = _oil(case).outside(case.temperature)
        if outside:
            return outside
    return "" if case.profile_1 else _problem_of_lines(case)


def _problem_of_lines(case: MixedLubrication) -> str:
    if case.rms_roughness is None:
        return "expected rms_roughness, or the measured profiles of both rollers, got neither"
    perimeter, spectrum = 2 * np.pi * case.roller_radius, _spectrum(case)
    if spectrum.longest > spectrum.modes:
        return (
            f"expected the longest wavelength above the shortest, got {perimeter / spectrum.longest:.4g} m and "
            f"{perimeter / max(spectrum.modes, 1):.4g} m"
        )
    if 2 * spectrum.modes > case.points:
        return (
            f"expected a shortest wavelength of at least two spacings, {2 * perimeter / case.points:.4g} m, "
            f"got {perimeter / spectrum.modes:.4g} m; raise points"
        )
    width = 2 * float(_dry_contact(case, case.normal_force).half_width)
    if width > perimeter:
        return f"the contact is wider than the line: expected 2a of at most {perimeter:.4g} m, got {width:.4g} m"
    return ""
