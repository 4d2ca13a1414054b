"""A small model that has every kind of parameter, in place of the real ones."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
import pytest
from pydantic import Field, model_validator

from mdr_dask import models
from mdr_dask.errors import ModelError
from mdr_dask.models.base import Model, Output, Parameters, Result, quantity
from mdr_dask.models.data_file import NamedFile


class Cone(Parameters):
    shape: Literal["cone"]
    angle: float = quantity("rad", "inclination of the flank", gt=0, lt=1.5)


class Power(Parameters):
    shape: Literal["power"]
    exponent: float = quantity("1", "exponent of the profile", gt=0)
    radius: float = quantity("m", "radius at unit slope", gt=0)


class Plane(Parameters):
    shape: Literal["plane"]


class Traced(Parameters):
    trace: NamedFile


Indenter = Annotated[Cone | Power | Plane, Field(discriminator="shape")]


class Rubbing(Parameters):
    length: float = quantity("m", "length of the line", gt=0)
    hurst: float = quantity("1", "Hurst exponent", default=0.7, ge=0, le=1)
    points: int = Field(1000, ge=2, description="number of points")
    oversampling: Annotated[int, Field(ge=1)] | Literal["auto"] = Field("auto", description="grid points a point")
    scheme: Literal["exact", "euler"] = Field("exact", description="time step")
    shift: bool = Field(False, description="whether the line starts anywhere")
    normal_force: float = quantity("N", "normal force", gt=0)
    velocity: float = quantity("m/s", "velocity of sliding", default=1.0, gt=0)
    temperature: float = quantity("K", "temperature", default=293.15, gt=0)
    moduli: tuple[float, ...] = quantity("Pa", "moduli of the Prony series", default=(1e6,), strict=False, min_length=1)
    indenter: Indenter = Field(Plane(shape="plane"), description="shape of the indenter")
    depth: float | None = quantity("m", "depth of the layer, endless if not given", default=None, gt=0)
    finish: Literal["ground", "lapped"] | Traced = Field("ground", description="finish of the surface")
    profile: NamedFile | None = Field(None, description="measured line")

    @model_validator(mode="after")
    def _resolves_the_line(self) -> Rubbing:
        if self.velocity > 1000 * self.normal_force:
            raise ValueError("expected a velocity of at most 1000 m/s a newton")
        return self


def _compute(block):
    return Result({}, np.ones((block.cases, len(block.realisations)), np.int8))


RUBBING = Model(
    name="rubbing",
    version=1,
    summary="a model for tests",
    parameters=Rubbing,
    outputs=(
        Output("friction_coefficient", "1", "coefficient of friction"),
        Output("indentation_depth", "m", "depth of indentation"),
        Output("pressure", "Pa", "pressure along the line", dims=("radius",), default=False),
    ),
    compute=_compute,
)


def _load(name):
    if name != "rubbing":
        raise ModelError(f"unknown model {name!r}")
    return RUBBING


@pytest.fixture(autouse=True)
def rubbing(monkeypatch):
    monkeypatch.setattr(models, "NAMES", ("rubbing", "sliding_friction"))
    monkeypatch.setattr(models, "load", _load)
    return RUBBING
