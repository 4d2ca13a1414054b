"""Parameters and outputs of the model ``fretting_wear``. A campaign is either dimensionless or dimensional."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from mdr_dask.errors import DataError
from mdr_dask.headings import Column
from mdr_dask.models.base import Alternatives, Coordinate, Model, Number, Output, Parameters, deferred, quantity
from mdr_dask.models.data_file import NamedFile
from mdr_dask.models.parts import indenter
from mdr_dask.tables import Read, read_table


class Parabola(indenter.Parabola):
    """A paraboloid, as an approximation of a sphere."""

    shape: Literal["parabola"] = "parabola"
    radius: float | None = quantity(  # type: ignore[assignment]
        "m", "radius of curvature R at the apex", usual="10 mm", gt=0, default=None
    )


class Cone(indenter.Cone):
    """A cone."""

    angle: float | None = quantity(  # type: ignore[assignment]
        "rad",
        "angle between the cone's surface and the touched plane",
        usual="10 deg",
        gt=0,
        lt=np.pi / 2,
        default=None,
    )


class Power(indenter.Power):
    """A body of revolution with the height c r^n at the radius r."""

    exponent: float = quantity("1", "exponent n of the body c r^n", usual="2", gt=0.1, le=50)
    coefficient: float | None = quantity(  # type: ignore[assignment]
        "m^(1-n)", "coefficient c of the body c r^n, with heights and radii in metres", gt=0, default=None
    )


class Table(Parameters):
    """A measured profile: a table with a column `radius` and a column `height`. Each column has a unit."""

    shape: Literal["table"]
    file: NamedFile = Field(description='table with the columns "radius" and "height", each with a unit')

    @field_validator("file")
    @classmethod
    def _is_profile(cls, file: NamedFile) -> NamedFile:
        from mdr_dask.physics.mdr.revolution import check_table

        try:
            table = profile_columns(file)
            check_table(table["radius"], table["height"])
        except DataError as problem:
            raise ValueError(str(problem)) from None
        except ValueError as problem:
            raise ValueError(f"{file.name}: {problem} (lengths in m)") from None
        return file

    def notes(self) -> tuple[str, ...]:
        """Return a note on rows and columns of the table that are not used."""
        remark = profile_columns(self.file).remark
        return (f"{self.file.name}: {remark}",) if remark else ()


def profile_columns(file: NamedFile) -> Read:
    """Return the columns `radius` and `height` of a table, in metres. Incomplete rows are left out."""
    columns = Column("radius", "m", least=0.0), Column("height", "m", ("f",))
    table = read_table(file.read_text(), file.name, columns, allow_missing=True)
    table.leave_out_incomplete()
    return table


Indenter = Annotated[Parabola | Cone | Power | Table, Field(discriminator="shape")]
#: For each shape except a table, the parameter that states the size of the body in a dimensional campaign.
_SIZES = {"parabola": "radius", "cone": "angle", "power": "coefficient"}


class LoadStep(Parameters):
    """One block of a load history."""

    cycles: float = quantity("1", "number of cycles of the block (N in a dimensionless campaign)", usual="10000", ge=0)
    amplitude_factor: float = quantity(
        "1", "amplitude in the block divided by the amplitude of the campaign", gt=0, default=1.0
    )
    load_factor: float = quantity(
        "1", "depth or force that is kept constant in the block, divided by its value before wear", gt=0, default=1.0
    )


#: Message if the fast rule is requested under constant force.
FAST_AT_DEPTH = "`wear_rule: fast` is for constant depth only: with `hold: force`, write `wear_rule: exact`"
_OSCILLATION = ("effective_shear_modulus", "friction", "amplitude")
#: Parameters of the rate of wear. The limiting profile does not depend on these parameters.
_OF_RATE = ("hardness", "wear_coefficient")


class FrettingWear(Parameters):
    """Parameters of fretting wear, or of sliding wear if a `path` is given.

    A campaign that gives `stick_radius` is dimensionless. A campaign that gives `path` is dimensionless if it does not
    give `contact_modulus`. All other campaigns are dimensional.
    """

    renamed: ClassVar[Mapping[str, str]] = {
        "shape": "write indenter: {shape: ...}, with radius, angle, coefficient and exponent inside",
        "measured": "write measured: {table: ...} beside parameters, and run mdr-dask fit STORE calibration",
        "method": "write wear_rule: exact, fast or limit; exact is the default",
        "tolerance": "write `accuracy`, the relative error of every output, beside `parameters`",
        "accuracy": "write `accuracy`, the relative error of every output, beside `parameters`",
        "load": "write normal_force",
        "shear_modulus": "write effective_shear_modulus, which is G* of the pair and not G of one body",
        "modulus": "write contact_modulus",
        "curvature_radius": "write indenter: {shape: parabola, radius: ...}",
        "angle": "write indenter: {shape: cone, angle: ...}",
        "block_normal_force": "write block_contact_force",
        "discretisation_error": "every output comes with its own error, such as wear_volume_error",
    }
    alternatives: ClassVar[tuple[Alternatives, ...]] = (
        (
            ("indenter.radius", "contact_modulus", *_OSCILLATION, "hardness", "wear_coefficient", "normal_force"),
            ("indenter.radius", "contact_modulus", *_OSCILLATION, "hardness", "wear_coefficient", "depth"),
            ("stick_radius",),
        ),
    )
    overrides: ClassVar[Mapping[str, str]] = {"history": "cycles", "path": "cycles", "last_radius": "extent"}
    settings: ClassVar[frozenset[str]] = frozenset({"cells", "extent", "last_radius", "points"})
    requires: ClassVar[Mapping[str, tuple[str, str]]] = {"xi": ("wear_rule", "fast")}
    indenter: Indenter = Field(
        Parabola(), description="body before wear; a dimensionless campaign does not need the size of the body"
    )
    wear_rule: Literal["exact", "fast", "limit"] = Field(
        "exact",
        description="exact: numerical solution of the wear equation. fast: approximate rule of the thesis, whose "
        "volumes are far too small at large stick radii (docs/wear.md); the stored errors do not include the error of "
        "this approximation. limit: profile at which wear ends",
    )
    hold: Literal["depth", "force"] = Field(
        "depth", description="quantity that stays constant while the body wears: indentation depth or force"
    )
    cycles: float = quantity(
        "1",
        "number of cycles; in a dimensionless campaign, the number N = cycles / N0",
        usual="10000",
        ge=0,
        default=1.0,
    )
    path: float | None = quantity(
        "m",
        "length l of sliding in one direction with gross slip, given in place of `cycles` and `amplitude`. A "
        "dimensionless campaign gives the number k E* l / (sigma0 a0) instead, with the hardness sigma0",
        ge=0,
        default=None,
    )
    stick_radius: float | None = quantity(
        "1", "stick radius c divided by the contact radius a0 before wear", usual="0.5", gt=0, lt=1, default=None
    )
    amplitude: float | None = quantity(
        "m", "amplitude U0 of the tangential oscillation", usual="1 um", gt=0, default=None
    )
    contact_modulus: float | None = quantity("Pa", "contact modulus E*", usual="115 GPa", gt=0, default=None)
    effective_shear_modulus: float | None = quantity(
        "Pa", "effective shear modulus G* of the pair", usual="90 GPa", gt=0, default=None
    )
    friction: float | None = quantity("1", "coefficient of friction", usual="0.6", gt=0, default=None)
    normal_force: float | None = quantity("N", "normal force before wear", usual="50 N", gt=0, default=None)
    depth: float | None = quantity("m", "indentation depth before wear", usual="1 um", gt=0, default=None)
    hardness: float | None = quantity(
        "Pa", "hardness in the wear law V = k F u / hardness", usual="2 GPa, 200 HV", gt=0, default=None
    )
    wear_coefficient: float | None = quantity(
        "1", "wear coefficient k in the wear law V = k F u / hardness", usual="1e-4", ge=0, le=1, default=None
    )
    xi: float = quantity(
        "1", "factor xi of the fast rule; docs/wear.md states the error of this rule", gt=0, default=0.8
    )
    cells: int = quantity(
        "1", "number of cells of the grid on which a load history is computed", ge=20, le=2000, default=200
    )
    friction_scatter: float = quantity(
        "1", "relative scatter of the coefficient of friction (log-normal)", ge=0, le=2, default=0.0
    )
    amplitude_scatter: float = quantity("1", "relative scatter of the amplitude (log-normal)", ge=0, le=2, default=0.0)
    wear_coefficient_scatter: float = quantity(
        "1", "relative scatter of the wear coefficient (log-normal)", ge=0, le=2, default=0.0
    )
    history: Annotated[
        tuple[LoadStep, ...], Field(strict=False, description="blocks of a load history, given in place of `cycles`")
    ] = ()
    extent: float = quantity(
        "1", "last radius of the profiles, divided by the contact radius a0 before wear", gt=0, le=10, default=1.6
    )
    last_radius: float | None = quantity(
        "m",
        "last radius of the profiles, given in place of `extent`; the coordinates of the profiles are then in m",
        usual="100 um",
        gt=0,
        default=None,
    )
    points: int = quantity("1", "number of points of the profiles", ge=2, le=10000, default=161)

    @property
    def dimensionless(self) -> bool:
        """Whether the campaign is dimensionless, with lengths in units of a0 and heights in units of d0."""
        return self.stick_radius is not None or (self.path is not None and self.contact_modulus is None)

    @model_validator(mode="after")
    def _is_consistent(self) -> FrettingWear:
        size = _SIZES.get(self.indenter.shape)
        values = {
            name: getattr(self, name) for name in ("contact_modulus", *_OSCILLATION, *_OF_RATE, "normal_force", "depth")
        }
        if size is not None:
            values = {f"indenter.{size}": getattr(self.indenter, size)} | values
        given = [name for name, value in values.items() if value is not None]
        optional = {"normal_force", "depth"}
        optional |= {*_OSCILLATION} if self.path is not None else set()
        optional |= {*_OF_RATE} if self.wear_rule == "limit" else set()
        missing = [name for name in values if name not in given and name not in optional]
        oscillating = ("stick_radius", "amplitude", "history", "amplitude_scatter", "friction_scatter")
        idle = [name for name in oscillating if self.path is not None and getattr(self, name)]
        if idle:
            raise ValueError(f"`path` means sliding without oscillation: leave out {', '.join(idle)}")
        if self.dimensionless and given:
            kind = "stick_radius" if self.path is None else "path without contact_modulus"
            raise ValueError(
                f"expected {kind} or quantities with units, got {kind} and {', '.join(given)}; leave out "
                f"{'stick_radius or all the others' if self.path is None else 'the others, or give contact_modulus'}"
            )
        if not self.dimensionless and missing:
            raise ValueError(
                f"expected stick_radius, or all parameters of a dimensional campaign; missing: {', '.join(missing)}"
            )
        if not self.dimensionless and (self.normal_force is None) == (self.depth is None):
            raise ValueError(
                f"expected either normal_force or depth, got normal_force {self.normal_force!r} and "
                f"depth {self.depth!r}"
            )
        if isinstance(self.indenter, Table) and self.depth is None:
            raise ValueError(
                "a table of a profile needs the indentation depth: give `depth`, not `normal_force` or `stick_radius`"
            )
        if self.wear_rule == "fast" and self.hold == "force":
            raise ValueError(FAST_AT_DEPTH)
        if self.wear_rule != "exact" and (self.history or self.path is not None):
            name = "history" if self.history else "path"
            raise ValueError(f"expected wear_rule: exact, because `{name}` is given, got {self.wear_rule!r}")
        for other, name in self.inactive.items():
            if getattr(self, other) != type(self).model_fields[other].default:
                raise ValueError(f"`{name}` replaces `{other}`: leave out one of them")
        if self.dimensionless and self.last_radius is not None:
            raise ValueError(
                "last_radius is a length: in a dimensionless campaign, give `extent` (last radius / a0) instead"
            )
        return self

    def notes(self) -> tuple[str, ...]:
        """Return a note if the wear rule is an approximation."""
        if self.wear_rule != "fast":
            return ()
        return (
            "wear_rule fast is an approximation: for a parabola, its volumes are up to 7 % too small at the stick "
            "radius 0.5 a0, 29 % at 0.8 a0 and 70 % at 0.97 a0, and its profiles differ from the exact profiles by up "
            "to 0.32 d0 at the stick radius 0.1 a0; the stored errors do not include this (docs/wear.md)",
        )


def _output(name: str, unit: str, meaning: str, dims: tuple[str, ...] = (), *, default: bool = False) -> Output:
    return Output(name, unit, meaning, dims, default=default, has_error=True)


OUTPUTS = (
    _output(
        "contact_radius", "m", "radius of the wear scar (in units of a0 in a dimensionless campaign)", default=True
    ),
    _output("wear_volume", "m^3", "worn volume (in units of a0^2 d0 in a dimensionless campaign)", default=True),
    _output(
        "contact_force",
        "N",
        "normal force on the worn contact (in units of E* d0 a0 in a dimensionless campaign)",
        default=True,
    ),
    _output("stick_border", "m", "stick radius (in units of a0 in a dimensionless campaign)"),
    _output("worn_depth", "m", "largest worn depth (in units of d0 in a dimensionless campaign)"),
    _output("worn_profile", "m", "worn profile f(r), measured from the apex of the body before wear", ("radius",)),
    _output("worn_image", "m", "worn one-dimensional image g(x)", ("position",)),
    _output(
        "pressure", "Pa", "contact pressure p(r) (in units of E* d0 / a0 in a dimensionless campaign)", ("radius",)
    ),
    _output("block_contact_radius", "m", "contact radius after every block of load", ("block",)),
    _output("block_stick_border", "m", "stick radius at the end of every block of load", ("block",)),
    _output("block_depth", "m", "indentation depth at the end of every block of load", ("block",)),
    _output("block_contact_force", "N", "normal force at the end of every block of load", ("block",)),
    _output("block_wear_volume", "m^3", "worn volume after every block of load", ("block",)),
    _output("block_worn_profile", "m", "worn profile after every block of load", ("block", "radius")),
)


def coordinates(parameters: FrettingWear) -> dict[str, Coordinate]:
    """Return the coordinates of the outputs: radii, positions and block numbers."""
    if parameters.last_radius is None:
        places, unit, over = (
            np.linspace(0.0, parameters.extent, parameters.points),
            "1",
            " divided by the contact radius a0 before wear",
        )
    else:
        places, unit, over = np.linspace(0.0, parameters.last_radius, parameters.points), "m", ""
    return {
        "radius": Coordinate(places, unit, f"radius{over}"),
        "position": Coordinate(places, unit, f"position{over}"),
        "block": Coordinate(np.arange(1.0, max(len(parameters.history), 1) + 1.0), "1", "block of the load history"),
    }


def units(parameters: FrettingWear) -> dict[str, str]:
    """Return the units that differ from the declared units.

    In a dimensionless campaign, the parameter `path` and all outputs have the unit ``"1"``.
    """
    return {"path": "1"} | {output.name: "1" for output in OUTPUTS} if parameters.dimensionless else {}


_SOLVE = "mdr_dask.models.fretting_wear.solve"
MODEL = Model(
    name="fretting_wear",
    version=16,
    summary="fretting wear of bodies of revolution: exact, by the fast rule, and in the limit",
    parameters=FrettingWear,
    outputs=OUTPUTS,
    compute=deferred(_SOLVE, "compute"),
    operations=deferred(_SOLVE, "operations"),
    whole=(
        *("cycles", "path", "wear_coefficient", "hardness"),
        *("friction", "amplitude", "effective_shear_modulus", "contact_modulus", "depth", "normal_force"),
        *("indenter.radius", "indenter.angle", "indenter.coefficient"),
    ),
    coordinates=coordinates,
    units=units,
    notes=deferred("mdr_dask.models.fretting_wear.reduction", "notes"),
    numbers=(
        Number("stick_share", "stick_border / contact_radius", "stick radius divided by the radius of the wear scar"),
        Number(
            "archard_share",
            "wear_volume * hardness / (4 * wear_coefficient * normal_force * amplitude * cycles)",
            "worn volume divided by the volume that Archard's law gives for gross slip",
        ),
    ),
)
