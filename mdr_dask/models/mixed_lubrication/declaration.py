"""Parameters and outputs of mixed lubrication, with units, bounds and meanings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError, distinguishable
from mdr_dask.models.base import (
    Alternatives,
    Block,
    Coordinate,
    Model,
    Number,
    Output,
    Parameters,
    deferred,
    quantity,
)
from mdr_dask.models.mixed_lubrication.lines import Generated, Measured, OfSurfaces, Source
from mdr_dask.models.mixed_lubrication.oil_data import OilData
from mdr_dask.models.parts.surface import NO_AREA, Surface, without_exponent
from mdr_dask.physics.lubrication.film_formulas import HertzLine, hertz_line
from mdr_dask.physics.lubrication.oil import OILS, Oil

Positive = Annotated[float, Field(gt=0)]
#: Contact modulus of steel on steel in Pa, with E = 210 GPa and nu = 0.3 for both bodies.
STEEL = 210e9 / (2 * (1 - 0.3**2))
#: Largest number of points of a line, and smallest number of spacings per shortest wave if the accuracy determines the
#: points.
MOST_POINTS, LEAST_PER_WAVE = 10**7, 2.5
#: Number of shortest waves around a roller, if neither shortest_wavelength nor points are given.
WAVES = 100_000
#: Positions of the profiles, in half widths of the contact.
POSITIONS = np.linspace(-1.5, 1.5, 1501)


class MixedLubrication(Parameters):
    """Two equal rough rollers pressed together on an oil film; the defaults are the twin-disc rig of the thesis."""

    renamed: ClassVar[Mapping[str, str]] = {
        "young_modulus": "write contact_modulus, E* = E/(2 (1 - nu^2)) of two rollers of one material",
        "poisson_ratio": "write contact_modulus, E* = E/(2 (1 - nu^2)) of two rollers of one material",
        "measured": "write measured: {table: ...} beside parameters, and fit calibration",
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
        "1", "creep (v1 - v2)/u with the mean velocity u; 0 is pure rolling", default=0.0, ge=-2, le=2
    )
    rms_roughness: Positive | None = quantity(
        "m", "rms height of each roller; needed unless surfaces are given", usual="0.2 um", default=None
    )
    hurst: float | None = quantity("1", "Hurst exponent H of the roughness", default=0.7, ge=0, le=1)
    points: Annotated[int, Field(ge=64, le=MOST_POINTS)] | Literal["auto"] = quantity(
        "1",
        "points of each line around the roller; auto has those that the accuracy needs",
        default="auto",
    )
    longest_wavelength: Positive | Literal["auto"] = quantity(
        "m",
        "wavelength above which there is no roughness; auto is 2a at cutoff_force. Of measured lines only the "
        "load on their asperities needs it",
        usual="0.4 mm",
        default="auto",
    )
    cutoff_force: float = quantity(
        "N", "normal force whose contact width is the longest wavelength", usual="1600 N", default=1600, gt=0
    )
    shortest_wavelength: Positive | Literal["auto"] = quantity(
        "m",
        "wavelength below which there is no roughness; auto is ten spacings of points that are given, else the "
        "perimeter over 100 000",
        usual="3 um",
        default="auto",
    )
    surface_1: Surface | None = Field(default=None, description="measured surface of roller 1")
    surface_2: Surface | None = Field(default=None, description="measured surface of roller 2")
    layer_thickness: float = quantity(
        "m", "critical thickness h_c of the boundary layer", usual="5 nm", default=5e-9, gt=0
    )
    layer_shear_strength: float = quantity(
        "Pa", "limiting shear stress tau0 of the boundary layer", usual="1 MPa", default=1e6, ge=0
    )
    oil: Literal["mobilgear_shc_xmp_320"] | OilData = Field(
        default="mobilgear_shc_xmp_320", description="a named oil, or the numbers of a data sheet or a table"
    )
    pressure_viscosity: (
        Positive | Literal["oil", "gold_mineral", "gold_polyalphaolefin", "gold_ester", "gold_polyglycol", "wooster"]
    ) = quantity(
        "1/Pa",
        "pressure-viscosity coefficient alpha, or the correlation that gives it",
        usual="20 1/GPa",
        default="oil",
    )
    film_formula: Literal["pan_hamrock", "pan_hamrock_minimum", "dowson_higginson", "ehl"] = Field(
        default="pan_hamrock", description="formula of the film thickness, or the central film of the EHL solution"
    )
    film_thickness: Positive | None = quantity(
        "m", "film thickness, instead of the formula's", usual="100 nm", default=None
    )
    edge_rule: Literal["part", "clip", "whole", "inside"] = Field(
        default="part", description="what becomes of a cluster that the edge of the contact cuts"
    )
    roller_radius: float = quantity("m", "radius of each roller", usual="50 mm", default=0.05, gt=0)
    roller_width: float = quantity("m", "length L' of the contact line", usual="10 mm", default=0.01, gt=0)
    contact_modulus: float = quantity("Pa", "contact modulus E*", usual="115 GPa", default=STEEL, gt=0)
    resistivity: float = quantity("ohm m", "electrical resistivity of the rollers", default=2e-7, gt=0)
    boundary_friction: float = quantity("1", "coefficient of friction of intimate contact", default=0.1, ge=0)
    eyring_stress: float = quantity("Pa", "Eyring stress of the oil under shear", usual="5 MPa", default=5e6, gt=0)
    viscosity_law: Literal["barus", "roelands"] = Field(
        default="barus", description="viscosity under pressure, for the friction of the film and the EHL solution"
    )
    trace_points: int = quantity("1", "angles of contact_length_trace in one revolution", default=3600, ge=2, le=10**6)

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

    def source(self) -> Source:
        """Return the source of the lines. Cases with equal sources can share lines."""
        one, two = self.surface_1, self.surface_2
        if one is not None and two is not None and one.profile is not None and two.profile is not None:
            return Measured(one.profile, two.profile, self.rms_roughness is not None)
        shortest, points = self.shortest_wavelength, self.points
        if shortest == "auto":
            shortest = self.perimeter / (WAVES if points == "auto" else points / 10)
        modes = int(self.perimeter / shortest * (1 + 1e-12))
        if points == "auto":
            points = int(np.ceil(LEAST_PER_WAVE * modes))
        waves = points, self.perimeter / self.longest(), modes
        if one is not None and two is not None:
            return OfSurfaces(*waves, one, two, self.perimeter)
        assert self.hurst is not None
        return Generated(*waves, self.hurst)

    def longest(self) -> float:
        """Return the longest wavelength of the roughness in m."""
        if self.longest_wavelength == "auto":
            return 2 * float(self.dry_contact(self.cutoff_force).half_width)
        return self.longest_wavelength

    def problem(self) -> str:
        """Return the reason why the case cannot be computed, or an empty string."""
        problem = self._problem_of_surfaces()
        problem = problem or self._problem_of_points()
        if problem:
            return problem
        outside = self.oil_data().outside(self.temperature)
        if outside:
            return outside
        try:
            source = self.source()
            return source.problem(self.perimeter) or self._problem_of_width(source)
        except DataError as error:
            return str(error)

    def _problem_of_surfaces(self) -> str:
        one, two = self.surface_1, self.surface_2
        if one is None and two is None:
            missing = self.rms_roughness is None or self.hurst is None
            return "expected rms_roughness, or surface_1 and surface_2, got neither" if missing else ""
        if one is None or two is None:
            return "expected the surfaces of both rollers or of none, got one"
        if (one.profile is None) != (two.profile is None):
            return "expected the profiles of both rollers or the spectra of both, got one of each"
        if one.profile is None and self.rms_roughness is not None:
            return "the surfaces take the place of rms_roughness: leave out one or the other"
        return "" if self.hurst is None else "the surfaces take the place of hurst: leave out one or the other"

    def _problem_of_points(self) -> str:
        if self.points != "auto" or (self.surface_1 is not None and self.surface_1.profile is not None):
            return ""
        if self.shortest_wavelength == "auto":
            return ""
        least = LEAST_PER_WAVE * self.perimeter / MOST_POINTS
        if self.shortest_wavelength < least:
            wave, limit = distinguishable(self.shortest_wavelength, least, digits=4)
            return (
                f"expected a shortest_wavelength of at least {limit} m, {LEAST_PER_WAVE} spacings of {MOST_POINTS} "
                f"points, got {wave} m"
            )
        return ""

    def _problem_of_width(self, source: Source) -> str:
        length = source.points * source.spacing(self.perimeter)
        width = 2 * float(self.dry_contact(self.normal_force).half_width)
        if width > length:
            got, most = distinguishable(width, length, digits=4)
            return f"the contact is wider than the line: expected 2a of at most {most} m, got {got} m"
        return ""

    def oil_data(self) -> Oil:
        """Return the oil, found by its name or made from the given data."""
        return OILS[self.oil] if isinstance(self.oil, str) else self.oil.oil

    def dry_contact(self, force: float) -> HertzLine:
        """Return the Hertzian contact of the smooth rollers under a normal force in N."""
        return hertz_line(force / self.roller_width, self.contact_modulus, self.roller_radius / 2)


OUTPUTS = (
    Output(
        "breakthrough_probability",
        "1",
        "share of time with the boundary layer broken anywhere on one line (P of the thesis)",
        has_error=True,
        scatter="revolution_error",
    ),
    Output("contact_length", "m", "mean length in intimate contact on one line", has_error=True, comment=NO_AREA),
    Output("film", "m", "film thickness h0", has_error=True),
    Output("film_ratio", "1", "film thickness over combined rms height", has_error=True),
    Output("asperity_load_share", "1", "share of the load on asperities, the rest is on the film", has_error=True),
    Output(
        "independent_squares",
        "1",
        "squares with the longest wavelength as edge, side by side in the width of the rollers; one line is one square",
    ),
    Output(
        "revolution_error",
        "1",
        "standard error of the probability of one revolution, from its parts",
        default=False,
    ),
    Output(
        "contact_conductance",
        "S",
        "mean electrical conductance of the spots in contact, over the whole width of the rollers",
        default=False,
        has_error=True,
    ),
    Output(
        "contact_resistance",
        "ohm",
        "reciprocal of the mean conductance of the whole width, infinite without contact",
        default=False,
        has_error=True,
    ),
    Output(
        "friction_coefficient",
        "1",
        "coefficient of friction of asperities and film",
        default=False,
        has_error=True,
    ),
    Output("contact_half_width", "m", "half width a of the Hertzian contact", default=False),
    Output("contact_length_trace", "m", "length in intimate contact during one revolution", ("angle",), default=False),
    Output("upper_profile", "m", "surface of roller 1 where contact is greatest", ("position",), default=False),
    Output("lower_profile", "m", "surface of roller 2 where contact is greatest", ("position",), default=False),
)


DRAWN = {output.name for output in OUTPUTS if output.dims}


def coordinates(parameters: MixedLubrication) -> dict[str, Coordinate]:
    """Return the coordinates of the outputs: angles of a trace, and positions of the profiles in half widths."""
    angles = 2 * np.pi * np.arange(parameters.trace_points) / parameters.trace_points
    return {
        "angle": Coordinate(angles, "rad", "rolling angle"),
        "position": Coordinate(POSITIONS, "1", "distance from the middle of the contact over its half width"),
    }


#: Parameters on which the lines depend; cases with equal values of these parameters share their lines.
OF_LINES = {
    *("points", "hurst", "longest_wavelength", "shortest_wavelength", "cutoff_force", "surface_1", "surface_2"),
    *("roller_radius", "roller_width", "contact_modulus"),
}


def seconds(block: Block[MixedLubrication]) -> float:
    """Return the estimated time of a block in seconds.

    The time depends on the numbers of lines, points, cases and films, on creep, and on whether profiles are requested.
    """
    millions = _expected_points(block) / 1e6
    creep = np.asarray(block.column("slide_roll_ratio"), dtype=np.float64) != 0
    of_case = np.where(creep, 0.012 + 0.06 * millions, 0.0025 + 0.011 * millions)
    of_case += 0.05 * millions if DRAWN & set(block.outputs) else 0.0
    films = 0.06 * float(np.sum(block.column("film_formula") == "ehl"))
    keys = [path for path in block.columns if path.partition(".")[0] in OF_LINES]
    lines = {tuple(str(block.columns[key][k]) for key in keys): millions[k] for k in range(block.cases)}
    return films + len(block.realisations) * float(0.04 * sum(lines.values()) + np.sum(of_case))


def _expected_points(block: Block[MixedLubrication]) -> FloatArray:
    """Return the expected points of every case.

    If the accuracy determines the points, the number for a usual boundary layer is returned.
    """
    per_wave = LEAST_PER_WAVE * max(1.0, float(0.033 / (block.accuracy or 0.01)) ** 0.28)
    columns = (block.column(name) for name in ("points", "shortest_wavelength", "roller_radius"))
    expected = np.empty(block.cases)
    for case, (points, shortest, radius) in enumerate(zip(*columns, strict=True)):
        waves = WAVES if shortest == "auto" else 2 * np.pi * radius / shortest
        expected[case] = per_wave * waves if points == "auto" else points
    return expected


MODEL = Model(
    name="mixed_lubrication",
    version=13,
    summary="breakthrough of the boundary layer between two rough rollers on an oil film",
    parameters=MixedLubrication,
    outputs=OUTPUTS,
    compute=deferred("mdr_dask.models.mixed_lubrication.solve", "compute"),
    seconds=seconds,
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
    numbers=(
        Number(
            "load_parameter",
            "normal_force / (roller_width * contact_modulus * roller_radius)",
            "load parameter W = w/(E' R) of the pair, E' = 2 E* and R half the radius of a roller",
        ),
        Number(
            "rig_probability",
            "1 - (1 - breakthrough_probability) ** independent_squares",
            "share of time with the boundary layer broken anywhere in the width of the rollers, squares independent",
        ),
        Number("film_over_layer", "film / layer_thickness", "film over the critical thickness of the boundary layer"),
        Number("touching_share", "contact_length / (2 * contact_half_width)", "contact length over the Hertzian width"),
    ),
    compiling=2.0,
)
