"""The parameters of ``fretting_wear``, dimensionless or dimensional."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from mdr_dask.models.base import NamedFile, Parameters, quantity

EXPONENTS = {"cone": 1.0, "parabola": 2.0}


class PowerShape(Parameters):
    """A power law, f = R (r / R)^n / n with the curvature radius R."""

    exponent: float = quantity("1", "exponent n of the profile", gt=0.1, le=50)


class TableShape(Parameters):
    """A measured profile: a CSV table with two columns, radius and height, in metres, and a header line."""

    table: NamedFile


class LoadStep(Parameters):
    """One block of a load history."""

    cycles: float = quantity("1", "cycles of the block (N in a dimensionless campaign)", ge=0)
    amplitude_factor: float = quantity("1", "amplitude over the campaign's amplitude", gt=0, default=1.0)
    load_factor: float = quantity("1", "depth or force over its first value", gt=0, default=1.0)


class FrettingWear(Parameters):
    """Parameters of fretting wear, dimensionless (no modulus) or dimensional; sliding if a `path` is given."""

    shape: Literal["parabola", "cone"] | PowerShape | TableShape = Field("parabola", description="virgin profile")
    method: Literal["limit", "fast", "exact", "literal"] = Field("fast", description="way to the worn profile")
    hold: Literal["depth", "force"] = Field("depth", description="what stays constant while the body wears")
    cycles: float = quantity("1", "number of cycles; N = cycles / N0 in a dimensionless campaign", ge=0, default=1.0)
    path: float | None = quantity(
        "m",
        "sliding path, in place of cycles and amplitude: gross slip in one direction "
        "(k E* l / (sigma0 a0) in a dimensionless campaign)",
        ge=0,
        default=None,
    )
    stick_radius: float | None = quantity(
        "1", "stick radius c over the first contact radius a0", gt=0, lt=1, default=None
    )
    amplitude: float | None = quantity("m", "amplitude U0 of the tangential oscillation", gt=0, default=None)
    curvature_radius: float | None = quantity("m", "radius of curvature of a parabola or power law", gt=0, default=None)
    angle: float | None = quantity(
        "rad", "inclination of a cone's flank against the surface", gt=0, lt=1.5, default=None
    )
    modulus: float | None = quantity("Pa", "effective normal modulus E*", gt=0, default=None)
    shear_modulus: float | None = quantity("Pa", "effective tangential modulus G*", gt=0, default=None)
    friction: float | None = quantity("1", "coefficient of friction", gt=0, default=None)
    load: float | None = quantity("N", "normal force of the virgin contact", gt=0, default=None)
    depth: float | None = quantity("m", "indentation depth of the virgin contact", gt=0, default=None)
    hardness: float | None = quantity("Pa", "hardness in the wear law", gt=0, default=None)
    wear_coefficient: float | None = quantity(
        "1", "wear coefficient k of the law V = k F u / hardness", ge=0, default=None
    )
    xi: float = quantity("1", "factor of the fast rule; docs/wear.md has its error", gt=0, default=0.8)
    tolerance: float = quantity("1", "error of the exact profile wanted, in eta d0", ge=1e-5, le=1e-1, default=1e-3)
    cells: int = quantity("1", "cells of the grid of method literal and of histories", ge=20, le=2000, default=200)
    friction_scatter: float = quantity("1", "relative scatter of friction (log-normal)", ge=0, le=2, default=0.0)
    amplitude_scatter: float = quantity("1", "relative scatter of the amplitude (log-normal)", ge=0, le=2, default=0.0)
    wear_coefficient_scatter: float = quantity("1", "relative scatter of the wear coefficient", ge=0, le=2, default=0.0)
    history: Annotated[tuple[LoadStep, ...], Field(strict=False, description="blocks of load instead of `cycles`")] = ()
    measured: NamedFile | None = Field(
        default=None, description="table of cycles and volume, or of radius and height, for mdr-dask fit"
    )
    extent: float = quantity("1", "last radius of the profiles, over a0", gt=0, le=10, default=1.6)
    points: int = quantity("1", "points of the profiles", ge=2, le=10000, default=161)

    @field_validator("shape")
    @classmethod
    def _is_profile(cls, shape: object) -> object:
        if isinstance(shape, TableShape):
            from mdr_dask.physics.mdr.profile_table import read_table

            try:
                read_table(shape.table.read_text())
            except ValueError as problem:
                raise ValueError(f"{shape.table.name}: {problem}") from None
        return shape

    @field_validator("history", mode="before")
    @classmethod
    def _as_tuple(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value

    @property
    def dimensionless(self) -> bool:
        """Tell whether lengths are over a0, heights over d0 and so on."""
        return self.stick_radius is not None or (self.path is not None and self.modulus is None)

    @model_validator(mode="after")
    def _one_kind(self) -> FrettingWear:
        given = [name for name in (*self._dimensional(), "load", "depth") if getattr(self, name) is not None]
        if self.stick_radius is not None and given:
            raise ValueError(
                f"a dimensionless campaign has stick_radius only, got {', '.join(given)} as well; leave one kind out"
            )
        if not self.dimensionless:
            self._check_dimensional()
        if isinstance(self.shape, TableShape) and self.depth is None:
            raise ValueError("a table of a profile needs a dimensional campaign with its depth")
        return self

    @model_validator(mode="after")
    def _sliding(self) -> FrettingWear:
        if self.path is None:
            return self
        oscillating = ("stick_radius", "amplitude", "history", "amplitude_scatter", "friction_scatter")
        given = [name for name in oscillating if getattr(self, name)]
        if given:
            raise ValueError(f"a path is sliding in one direction, got {', '.join(given)} of an oscillation as well")
        if self.method != "exact":
            raise ValueError(f"sliding along a path has method exact only, got {self.method!r}")
        return self

    def _check_dimensional(self) -> None:
        missing = [name for name in self._dimensional() if getattr(self, name) is None]
        if missing:
            raise ValueError(f"give stick_radius, or for a dimensional campaign also {', '.join(missing)}")
        if (self.load is None) == (self.depth is None):
            raise ValueError(f"give either load or depth, got load {self.load!r} and depth {self.depth!r}")

    def _dimensional(self) -> tuple[str, ...]:
        size: tuple[str, ...] = ("angle",) if self.shape == "cone" else ("curvature_radius",)
        if isinstance(self.shape, TableShape):
            size = ()
        oscillating = ("shear_modulus", "friction", "amplitude") if self.path is None else ()
        return (*size, "modulus", *oscillating, "hardness", "wear_coefficient")
