"""Parameters of a viscoelastic body that slides over a rough line: line, body, load and velocity."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from pydantic import Field, model_validator

from mdr_dask.models.base import Alternatives, Number, Parameters, quantity
from mdr_dask.models.parts.indenter import Indenter, Plane
from mdr_dask.models.parts.material import Material, frequencies
from mdr_dask.models.parts.measured_line import line_of
from mdr_dask.models.parts.surface import Surface, spectra_of, without_exponent
from mdr_dask.units import shown

#: Parameters of generated roughness. A measured surface replaces all these parameters.
GENERATED = ("hurst", "rms_roughness", "rolloff_wavelength", "longest_wavelength")
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
        "velocity number v tau s / (sqrt 2 h) with the rms slope s (thesis eq. 3.19)",
    ),
)


class SlidingBody(Parameters):
    """A viscoelastic body that slides over a rough line.

    The rough line is generated or measured. The roughness is added to a plane or to the shape of an indenter.
    """

    renamed: ClassVar[Mapping[str, str]] = {
        "profile": "write surface: {profile: ...}",
        "discretisation_error": "every output comes with its own error, such as friction_coefficient_error",
    }
    alternatives: ClassVar[tuple[Alternatives, ...]] = (
        (("length", "rms_roughness"), ("length", "surface"), ("surface",)),
        (("shear_modulus", "relaxation_time"), ("material",)),
    )
    length: float | None = quantity(
        "m", "length L of the rough line, after which the roughness repeats", usual="10 mm", default=None, gt=0
    )
    points: int = quantity(
        "1",
        "number of points of the rough line; the shortest wavelength of its roughness is 2 length / points",
        default=5000,
        ge=16,
        le=10**6,
    )
    hurst: float | None = quantity("1", "Hurst exponent H of the self-affine roughness", default=0.7, ge=0, le=1)
    rms_roughness: float | None = quantity("m", "rms height h of the roughness", usual="0.5 um", default=None, ge=0)
    rolloff_wavelength: float | None = quantity(
        "m", "wavelength above which the power spectrum is constant", usual="1 mm", default=None, gt=0
    )
    longest_wavelength: float | None = quantity(
        "m", "longest wavelength of the roughness; by default the length of the line", usual="1 mm", default=None, gt=0
    )
    surface: Surface | None = Field(default=None, description="a measured surface in place of generated roughness")
    shear_modulus: float | None = quantity(
        "Pa", "static shear modulus G of an incompressible Kelvin body", usual="10 MPa", default=None, gt=0
    )
    relaxation_time: float | None = quantity(
        "s",
        "relaxation time tau = eta / G of the Kelvin body, with its viscosity eta",
        usual="1 ms",
        default=None,
        gt=0,
    )
    material: Material | None = Field(
        default=None, description="a general linear viscoelastic material in place of a Kelvin body"
    )
    normal_force: float = quantity("N", "normal force F_N", usual="1 N", gt=0)
    velocity: float = quantity("m/s", "sliding velocity v", usual="100 mm/s", gt=0)
    indenter: Indenter = Field(default=Plane(), description="shape of the body on which the roughness lies")

    @model_validator(mode="before")
    @classmethod
    def _no_exponent_of_a_measured_surface(cls, value: Any) -> Any:
        return without_exponent(value, "surface")

    @model_validator(mode="after")
    def _one_body_and_one_line(self) -> SlidingBody:
        both = [name for name in GENERATED if getattr(self, name) is not None]
        if self.surface is None:
            if self.hurst is None:
                raise ValueError("expected `hurst`, because generated roughness needs a Hurst exponent, got none")
        elif both:
            names = " and ".join(f"`{name}`" for name in both)
            raise ValueError(f"`surface` replaces {names}: leave out either `surface` or {names}")
        elif self.surface.profile is not None and self.length is not None:
            raise ValueError(
                "leave out `length`, because the file of `surface: {profile: ...}` determines the length of the line"
            )
        elif self.surface.profile is None and self.length is None:
            raise ValueError("expected `length`, the length of the rough line that represents the surface, got none")
        self.require_one_alternative()
        return self

    def largest_force(self) -> float:
        """Return the largest normal force in N."""
        return self.normal_force

    def wavelengths(self) -> tuple[float, float]:
        """Return the shortest and the longest wavelength, in m, of the line."""
        if self.surface is not None and self.surface.profile is not None:
            line = line_of(self.surface.profile)
            return 2 * line.length / line.height.size, line.length
        assert self.length is not None
        ends = [(self.longest_wavelength or self.length, 0.0)]
        if self.surface is not None:
            ends = [spectrum.wavelengths for spectrum in spectra_of(self.surface)]
        shortest = max(2 * self.length / self.points, min(short for _, short in ends))
        return shortest, min(self.length, max(long for long, _ in ends))


def frequency_notes(sets: Sequence[SlidingBody]) -> tuple[str, ...]:
    """Return notes on whether the data of each power law or table of moduli cover the frequencies of a study.

    At the sliding velocity v, a wave of the roughness with the wave number q excites the angular frequency q v.
    """
    velocities = [one.velocity for one in sets]
    waves = [one.wavelengths() for one in sets]
    low = 2 * math.pi * min(velocities) / max(longest for _, longest in waves)
    high = 2 * math.pi * max(velocities) / min(shortest for shortest, _ in waves)
    notes = []
    for material in dict.fromkeys(one.material for one in sets if one.material is not None):
        known = frequencies(material)
        if known is None:
            continue
        at = "" if material.temperature is None else f" at {shown(material.temperature, 'K')}"
        ends = f"roughness excites {low:.2g} to {high:.2g} rad/s{at}, data from {known[0]:.2g} to {known[1]:.2g} rad/s"
        notes.append(f"{ends}: {_compared((low, high), known)}")
    return tuple(notes)


def _compared(asked: tuple[float, float], known: tuple[float, float]) -> str:
    """Return a text that says how far the frequencies `asked` lie outside the range `known` of the moduli."""
    (low, high), (first, last) = np.log10(asked), np.log10(known)
    beyond = {"below": max(first - low, 0.0), "above": max(high - last, 0.0)}
    if high <= first or low >= last:
        return "outside the data, so that the solid is extrapolated at every velocity"
    far = [f"{decades:.2g} decades {side}" for side, decades in beyond.items() if round(decades, 1)]
    return f"extrapolated {' and '.join(far)}" if far else "inside"
