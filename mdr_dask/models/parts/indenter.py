"""Parameters of indenters."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from mdr_dask.models.base import Parameters, quantity

if TYPE_CHECKING:
    from mdr_dask.physics.surfaces.shapes import PowerLaw


class Plane(Parameters):
    """A body that is flat apart from its roughness."""

    shape: Literal["plane"] = "plane"

    def line(self) -> None:
        """Return None, because a plane has no shape apart from the roughness."""


class _PowerLaw(Parameters):
    """A body of revolution whose height is a power of the distance from its axis."""

    @abstractmethod
    def power_law(self) -> tuple[float, float]:
        """Return coefficient c and exponent n of the body c r^n. If the size of the body is not given, c is NaN."""

    def line(self) -> PowerLaw:
        """Return the profile, in m, that replaces the body in the method of dimensionality reduction."""
        from mdr_dask.physics.surfaces.shapes import PowerLaw

        return PowerLaw.of_body(*self.power_law())


class Cone(_PowerLaw):
    """A cone."""

    shape: Literal["cone"]
    angle: float = quantity(
        "rad", "angle between the surface of the cone and the touched plane", usual="10 deg", gt=0, lt=np.pi / 2
    )

    def power_law(self) -> tuple[float, float]:
        """Return coefficient and exponent of the body c r^n."""
        return (math.nan if self.angle is None else math.tan(self.angle)), 1.0


class Parabola(_PowerLaw):
    """A paraboloid, the usual approximation of a sphere."""

    shape: Literal["parabola"]
    radius: float = quantity("m", "radius of curvature R at the apex", usual="10 mm", gt=0)

    def power_law(self) -> tuple[float, float]:
        """Return coefficient and exponent of the body c r^n."""
        return (math.nan if self.radius is None else 1 / (2 * self.radius)), 2.0


class Power(_PowerLaw):
    """A body of revolution with the height c r^n at the distance r from its axis."""

    shape: Literal["power"]
    exponent: float = quantity("1", "exponent n of the height c r^n", usual="2", ge=1, le=100)
    coefficient: float = quantity(
        "m^(1-n)", "coefficient c of the height c r^n, with heights and radii in metres", gt=0
    )

    def power_law(self) -> tuple[float, float]:
        """Return coefficient and exponent of the body c r^n."""
        return (math.nan if self.coefficient is None else self.coefficient), self.exponent


Indenter = Annotated[Plane | Cone | Parabola | Power, Field(discriminator="shape")]
