"""The line, the body, the load and the velocity of a viscoelastic body that slides over a rough line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pydantic import Field, model_validator

from mdr_dask.models.base import Parameters, quantity
from mdr_dask.models.parts.indenter import Indenter, Plane
from mdr_dask.models.parts.material import Material
from mdr_dask.models.parts.surface import Surface, without_exponent

#: What a generated line has and a measured surface brings with it.
GENERATED = ("hurst", "rms_roughness", "rolloff_wavelength", "longest_wavelength")


class SlidingBody(Parameters):
    """A viscoelastic body under a load on a generated or a measured rough line, flat or of an indenter's shape."""

    gone: ClassVar[Mapping[str, str]] = {"profile": "write surface: {profile: ...}"}
    length: float | None = quantity("m", "length L of the line, and period of its roughness", default=None, gt=0)
    points: int = quantity(
        "1", "Nyquist points: the cut-off wavelength is 2 length / points", default=5000, ge=16, le=10**6
    )
    hurst: float | None = quantity("1", "Hurst exponent H of the self-affine roughness", default=0.7, ge=0, le=1)
    rms_roughness: float | None = quantity("m", "rms height h of the roughness", default=None, ge=0)
    rolloff_wavelength: float | None = quantity(
        "m", "wavelength above which the spectrum is constant", default=None, gt=0
    )
    longest_wavelength: float | None = quantity("m", "wavelength above which there is no roughness", default=None, gt=0)
    surface: Surface | None = Field(default=None, description="a measured surface in place of a generated one")
    shear_modulus: float | None = quantity(
        "Pa", "static shear modulus G of the incompressible Kelvin body", default=None, gt=0
    )
    relaxation_time: float | None = quantity(
        "s", "relaxation time tau = eta / G of the Kelvin body", default=None, gt=0
    )
    material: Material | None = Field(default=None, description="any linear material in place of the Kelvin body")
    normal_force: float = quantity("N", "normal force F_N", gt=0)
    velocity: float = quantity("m/s", "sliding velocity v", gt=0)
    indenter: Indenter = Field(default=Plane(), description="the shape under the roughness")

    @model_validator(mode="before")
    @classmethod
    def _no_exponent_of_a_measured_surface(cls, value: Any) -> Any:
        return without_exponent(value, "surface")

    @model_validator(mode="after")
    def _one_body_and_one_line(self) -> SlidingBody:
        kelvin = self.shear_modulus is not None and self.relaxation_time is not None
        either = self.shear_modulus is not None or self.relaxation_time is not None
        if (self.material is None and not kelvin) or (self.material is not None and either):
            raise ValueError("expected shear_modulus with relaxation_time, or material")
        problem = self._problem_of_line()
        if problem:
            raise ValueError(problem)
        return self

    def _problem_of_line(self) -> str:
        """Say why there is no line, or more than one; an empty string if there is one."""
        if self.surface is None:
            complete = self.length is not None and self.rms_roughness is not None and self.hurst is not None
            return "" if complete else "expected length with rms_roughness, or surface"
        both = [name for name in GENERATED if getattr(self, name) is not None]
        if both:
            return f"surface takes the place of {', '.join(both)}: leave out one or the other"
        if self.surface.profile is not None and self.length is not None:
            return "surface: {profile: ...} brings its length with it: leave out length"
        if self.surface.profile is None and self.length is None:
            return "expected length, of the line that stands for the surface"
        return ""
