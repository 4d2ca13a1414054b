"""The line, the body, the load and the velocity of a viscoelastic body that slides over a rough line."""

from __future__ import annotations

from pydantic import Field, model_validator

from mdr_dask.models.base import Number, Parameters, quantity
from mdr_dask.models.parts.indenter import Indenter, Plane
from mdr_dask.models.parts.material import Material
from mdr_dask.models.parts.measured_line import ProfileFile

#: Dimensionless numbers of a Kelvin body on a generated line.
NUMBERS = (
    Number("deborah", "velocity * relaxation_time / length", "Deborah number v tau / L"),
    Number(
        "load_number",
        "normal_force / (shear_modulus * rms_roughness * length)",
        "load number F_N / (G h L) (thesis eq. 3.20)",
    ),
    Number(
        "velocity_number",
        "velocity * relaxation_time * rms_slope / (sqrt(2) * rms_roughness)",
        "velocity number v tau s / (sqrt 2 h), s the rms slope (thesis eq. 3.19)",
    ),
)


class SlidingBody(Parameters):
    """A viscoelastic body under a load on a generated or a measured rough line, flat or of an indenter's shape."""

    length: float | None = quantity("m", "length L of the line, and period of its roughness", default=None, gt=0)
    points: int = quantity(
        "1", "Nyquist points: the cut-off wavelength is 2 length / points", default=5000, ge=16, le=10**6
    )
    hurst: float = quantity("1", "Hurst exponent H of the self-affine roughness", default=0.7, ge=0, le=1)
    rms_roughness: float | None = quantity("m", "rms height h of the roughness", default=None, ge=0)
    rolloff_wavelength: float | None = quantity(
        "m", "wavelength above which the spectrum is constant", default=None, gt=0
    )
    longest_wavelength: float | None = quantity("m", "wavelength above which there is no roughness", default=None, gt=0)
    profile: ProfileFile | None = Field(default=None, description="a measured line in place of a generated one")
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

    @model_validator(mode="after")
    def _one_body_and_one_line(self) -> SlidingBody:
        kelvin = self.shear_modulus is not None and self.relaxation_time is not None
        either = self.shear_modulus is not None or self.relaxation_time is not None
        if (self.material is None and not kelvin) or (self.material is not None and either):
            raise ValueError("expected shear_modulus with relaxation_time, or material")
        generated = self.length is not None and self.rms_roughness is not None
        partly = self.length is not None or self.rms_roughness is not None
        if (self.profile is None and not generated) or (self.profile is not None and partly):
            raise ValueError("expected length with rms_roughness, or profile")
        return self
