"""Parameters and outputs of the model `mixed_lubrication`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from mdr_dask.errors import DataError
from mdr_dask.models.base import Alternatives, Coordinate, Model, Number, Output, Parameters, deferred, quantity
from mdr_dask.models.mixed_lubrication.lines import MOST_POINTS, GeneratedPair, MeasuredPair, Source, points_for
from mdr_dask.models.mixed_lubrication.oil_data import OilData
from mdr_dask.models.parts.surface import NO_AREA, Surface, without_exponent
from mdr_dask.physics.lubrication.film_formulas import STEEL, HertzLine, hertz_line
from mdr_dask.physics.lubrication.oil import OILS, Oil
from mdr_dask.units import shown

Positive = Annotated[float, Field(gt=0)]
#: Circumference of a roller divided by the shortest wavelength, for `shortest_wavelength: auto` with `points: auto`.
WAVES = 100_000
#: Positions at which the profiles are stored, divided by the half width of the contact.
POSITIONS = np.linspace(-1.5, 1.5, 1501)


class MixedLubrication(Parameters):
    """Two equal rough rollers with an oil film between them.

    The default values describe the twin-disc rig of the thesis.
    """

    renamed: ClassVar[Mapping[str, str]] = {
        "young_modulus": "write contact_modulus, E* = E/(2 (1 - nu^2)) of two rollers of one material",
        "poisson_ratio": "write contact_modulus, E* = E/(2 (1 - nu^2)) of two rollers of one material",
        "measured": "write measured: {table: ...} beside parameters, and run mdr-dask fit STORE calibration",
        "load_share": "write asperity_load_share",
        "turn_error": "write revolution_error",
        "profile_1": "write surface_1: {profile: ...}",
        "profile_2": "write surface_2: {profile: ...}",
        "discretisation_error": "breakthrough_probability comes with breakthrough_probability_error",
    }
    alternatives: ClassVar[tuple[Alternatives, ...]] = ((("rms_roughness",), ("surface_1", "surface_2")),)
    settings: ClassVar[frozenset[str]] = frozenset({"points", "trace_points"})
    normal_force: float = quantity("N", "normal force F_N on the rollers", usual="800 N", gt=0)
    rotation_speed: float = quantity("rad/s", "mean rotation speed of the two rollers", usual="100 rpm", gt=0)
    temperature: float = quantity("K", "temperature of rollers and oil", usual="60 degC", gt=0)
    slide_roll_ratio: float = quantity(
        "1",
        "slide-roll ratio (v1 - v2)/u; v1 and v2 are the velocities of the surfaces, and u is their mean. 0 is pure "
        "rolling",
        default=0.0,
        ge=-2,
        le=2,
    )
    rms_roughness: Positive | None = quantity(
        "m",
        "rms height of each roller; required unless surface_1 and surface_2 are given",
        usual="0.2 um",
        default=None,
    )
    hurst: float | None = quantity("1", "Hurst exponent H of the roughness", default=0.7, ge=0, le=1)
    points: Annotated[int, Field(ge=64, le=MOST_POINTS)] | Literal["auto"] = quantity(
        "1",
        "number of points of the rough line around each roller; auto takes as many as the accuracy requires",
        default="auto",
    )
    longest_wavelength: Positive | Literal["auto"] = quantity(
        "m",
        "longest wavelength of the roughness. The pressure on the asperities at a given film thickness is inversely "
        "proportional to this wavelength. auto means the width 2a of the Hertzian contact under cutoff_force. "
        "Measured profiles are not filtered",
        usual="0.4 mm",
        default="auto",
    )
    cutoff_force: float = quantity(
        "N",
        "normal force, used only with longest_wavelength: auto. The contact width under this force is the longest "
        "wavelength. This force is usually the largest force of the rig",
        usual="1600 N",
        default=1600,
        gt=0,
    )
    shortest_wavelength: Positive | Literal["auto"] = quantity(
        "m",
        "shortest wavelength of the roughness. If `points` is a number, auto means ten times the distance between "
        "neighbouring points. If `points` is auto, auto means the circumference of a roller divided by 100 000",
        usual="3 um",
        default="auto",
    )
    surface_1: Surface | None = Field(default=None, description="measured surface of roller 1")
    surface_2: Surface | None = Field(default=None, description="measured surface of roller 2")
    layer_thickness: float = quantity(
        "m", "critical thickness h_c; a thinner boundary layer breaks", usual="5 nm", default=5e-9, gt=0
    )
    layer_shear_strength: float = quantity(
        "Pa", "shear strength tau0 of the boundary layer", usual="1 MPa", default=1e6, ge=0
    )
    oil: Literal["mobilgear_shc_xmp_320"] | OilData = Field(
        default="mobilgear_shc_xmp_320", description="a named oil, or the viscosities of a data sheet or a table"
    )
    pressure_viscosity: Positive | Literal["oil"] = quantity(
        "1/Pa",
        "pressure-viscosity coefficient alpha; with oil, alpha is computed from the viscosity by the oil's correlation",
        usual="20 1/GPa",
        default="oil",
    )
    film_formula: Literal["pan_hamrock", "pan_hamrock_minimum", "dowson_higginson", "ehl"] = Field(
        default="pan_hamrock",
        description="formula for the film thickness; with ehl, the contact is solved as in the model ehl_line",
    )
    film_thickness: Positive | None = quantity(
        "m", "film thickness h0, if it is known; film_formula is then not used", usual="100 nm", default=None
    )
    roller_radius: float = quantity("m", "radius of each roller", usual="50 mm", default=0.05, gt=0)
    roller_width: float = quantity(
        "m", "width of the rollers, equal to the length L' of the contact", usual="10 mm", default=0.01, gt=0
    )
    contact_modulus: float = quantity(
        "Pa",
        "contact modulus E*; for two rollers of the same material, E* = E/(2 (1 - nu^2))",
        usual="115 GPa",
        default=STEEL,
        gt=0,
    )
    resistivity: float = quantity(
        "ohm m", "electrical resistivity of the rollers", usual="2e-7 ohm m", default=2e-7, gt=0
    )
    boundary_friction: float = quantity(
        "1", "coefficient of friction where the rollers are in intimate contact", default=0.1, ge=0
    )
    eyring_stress: float = quantity("Pa", "Eyring stress of the oil", usual="5 MPa", default=5e6, gt=0)
    viscosity_law: Literal["barus", "roelands"] = Field(
        default="barus",
        description="law by which the viscosity grows with the pressure. Friction always depends on this law; the film "
        "depends on this law only with film_formula: ehl",
    )
    trace_points: int = quantity(
        "1", "number of angles in one revolution at which contact_length_trace is stored", default=3600, ge=2, le=10**6
    )

    @model_validator(mode="before")
    @classmethod
    def _no_exponent_of_measured_surfaces(cls, value: Any) -> Any:
        return without_exponent(value, "surface_1")

    @model_validator(mode="after")
    def _holds_together(self) -> Self:
        problem = self.problem()
        if problem:
            raise ValueError(problem)
        return self

    @property
    def perimeter(self) -> float:
        """Circumference of a roller in m."""
        return 2 * float(np.pi) * self.roller_radius

    @property
    def radius(self) -> float:
        """Reduced radius of curvature of the two equal rollers in m."""
        return self.roller_radius / 2

    def source(self) -> Source:
        """Return the object that makes the rough lines of the case. Cases with equal objects have the same lines."""
        one, two = self.surface_1, self.surface_2
        if one is not None and two is not None and one.profile is not None and two.profile is not None:
            return MeasuredPair(one.profile, two.profile, self.rms_roughness is not None)
        shortest, points = self.shortest_wavelength, self.points
        if shortest == "auto":
            shortest = self.perimeter / (WAVES if points == "auto" else points / 10)
        modes = int(self.perimeter / shortest * (1 + 1e-12))
        grids: tuple[int, ...]
        if points == "auto":
            grids = points_for(modes)
        elif points < 4 * modes:  # the coarser grid, with half of the points, does not resolve the shortest wave
            grids = (points,)
        else:
            grids = (points // 2, points)
        roughness = (one, two) if one is not None and two is not None else self.hurst
        assert roughness is not None
        return GeneratedPair(grids, self.perimeter, self.perimeter / self.longest(), modes, roughness)

    def longest(self) -> float:
        """Return the longest wavelength of the roughness in m."""
        if self.longest_wavelength == "auto":
            return 2 * float(self.dry_contact(self.cutoff_force).half_width)
        return self.longest_wavelength

    def problem(self) -> str:
        """Return the reason why the case cannot be computed, or an empty string."""
        problem = self._problem_of_surfaces() or self.oil_data().outside(self.temperature)
        if problem:
            return problem
        try:
            source = self.source()
            return source.problem() or self._problem_of_width(source)
        except DataError as error:
            return str(error)

    def _problem_of_surfaces(self) -> str:
        one, two = self.surface_1, self.surface_2
        if one is None and two is None:
            missing = self.rms_roughness is None or self.hurst is None
            return "expected rms_roughness with hurst, or surface_1 with surface_2, got neither" if missing else ""
        if one is None or two is None:
            return "expected surface_1 and surface_2 together, got only one of them"
        if (one.profile is None) != (two.profile is None):
            return "expected profiles for both rollers or spectra for both, got one of each"
        if one.profile is None and self.rms_roughness is not None:
            return "surface_1 and surface_2 replace rms_roughness: leave out rms_roughness, or both surfaces"
        return "" if self.hurst is None else "surface_1 and surface_2 replace hurst: leave out hurst, or both surfaces"

    def _problem_of_width(self, source: Source) -> str:
        width = 2 * float(self.dry_contact(self.normal_force).half_width)
        if width > source.length:
            return (
                f"expected a contact width 2a of at most the length of the line, {source.length:.9g} m, "
                f"got {width:.9g} m"
            )
        return ""

    def oil_data(self) -> Oil:
        """Return the named oil, or the oil that the data in the campaign define."""
        return OILS[self.oil] if isinstance(self.oil, str) else self.oil.oil

    def dry_contact(self, force: float) -> HertzLine:
        """Return the Hertzian contact of smooth rollers under the normal force `force` in N."""
        return hertz_line(force / self.roller_width, self.contact_modulus, self.radius)


def notes(sets: Sequence[MixedLubrication]) -> tuple[str, ...]:
    """Return notes on measured lines, and a note if the longest wavelength exceeds the largest contact width."""
    pairs = dict.fromkeys(one.source() for one in sets)
    lines = tuple(pair.note() for pair in pairs if isinstance(pair, MeasuredPair))
    longest = max(one.longest() for one in sets)
    width = max(2 * float(one.dry_contact(one.normal_force).half_width) for one in sets)
    if longest <= width * (1 + 1e-9):
        return lines
    wave, widest = shown(longest, "m", 9), shown(width, "m", 9)
    return (
        *lines,
        f"the longest wavelength, {wave}, exceeds the largest contact width 2a, {widest}: the load on the asperities "
        "may be far too low (see 'The longest wavelength' in docs/mixed-lubrication.md)",
    )


OUTPUTS = (
    Output(
        "breakthrough_probability",
        "1",
        "fraction of time in which the boundary layer is broken somewhere on one line (P of the thesis)",
        has_error=True,
        scatter="revolution_error",
    ),
    Output("contact_length", "m", "mean length in intimate contact on one line", has_error=True, comment=NO_AREA),
    Output("film", "m", "film thickness h0", has_error=True),
    Output("film_ratio", "1", "film thickness divided by the combined rms height of the rollers", has_error=True),
    Output("asperity_load_share", "1", "fraction of the load that asperities carry", has_error=True),
    Output(
        "independent_squares",
        "1",
        "number of independent squares across the width of the rollers: this width divided by the longest wavelength. "
        "One rough line represents one square",
    ),
    Output(
        "revolution_error",
        "1",
        "standard error of breakthrough_probability, from the scatter between the parts of one revolution",
        default=False,
    ),
    Output(
        "contact_conductance",
        "S",
        "electrical conductance of all contact spots across the rollers together, averaged over one revolution",
        default=False,
        has_error=True,
    ),
    Output(
        "contact_resistance",
        "ohm",
        "electrical contact resistance: the reciprocal of contact_conductance; infinite if there is no contact",
        default=False,
        has_error=True,
    ),
    Output(
        "friction_coefficient",
        "1",
        "coefficient of friction, from asperities and oil film together",
        default=False,
        has_error=True,
    ),
    Output("contact_half_width", "m", "half width a of the Hertzian contact", default=False),
    Output(
        "contact_length_trace",
        "m",
        "length in intimate contact as a function of the rolling angle",
        ("angle",),
        default=False,
    ),
    Output(
        "upper_profile",
        "m",
        "profile of roller 1 at the angle at which the length in intimate contact is largest",
        ("position",),
        default=False,
    ),
    Output(
        "lower_profile",
        "m",
        "profile of roller 2 at the angle at which the length in intimate contact is largest",
        ("position",),
        default=False,
    ),
)


DRAWN = {output.name for output in OUTPUTS if output.dims}


def coordinates(parameters: MixedLubrication) -> dict[str, Coordinate]:
    """Return the coordinates of the outputs: rolling angles, and positions divided by the half width of the contact."""
    angles = 2 * np.pi * np.arange(parameters.trace_points) / parameters.trace_points
    return {
        "angle": Coordinate(angles, "rad", "rolling angle"),
        "position": Coordinate(POSITIONS, "1", "distance from the middle of the contact divided by its half width a"),
    }


_SOLVE = "mdr_dask.models.mixed_lubrication.solve"
MODEL = Model(
    name="mixed_lubrication",
    version=14,
    summary="breakthrough of the boundary layer between two rough rollers on an oil film",
    parameters=MixedLubrication,
    outputs=OUTPUTS,
    compute=deferred(_SOLVE, "compute"),
    operations=deferred(_SOLVE, "operations"),
    whole=(
        "normal_force",
        "rotation_speed",
        "temperature",
        "slide_roll_ratio",
        "rms_roughness",
        "pressure_viscosity",
        "layer_thickness",
        "layer_shear_strength",
        "film_formula",
        "film_thickness",
    ),
    coordinates=coordinates,
    notes=notes,
    numbers=(
        Number(
            "load_parameter",
            "normal_force / (roller_width * contact_modulus * roller_radius)",
            "load parameter W = w/(E' R), with the line load w, E' = 2 E*, and R, half the radius of a roller",
        ),
        Number(
            "rig_probability",
            "1 - (1 - breakthrough_probability) ** independent_squares",
            "fraction of time in which the layer is broken somewhere across the rollers, if squares are independent",
        ),
    ),
)
