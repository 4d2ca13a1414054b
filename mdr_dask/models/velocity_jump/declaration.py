"""Parameters and outputs of the model `velocity_jump`."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from pydantic import Field, field_validator, model_validator

from mdr_dask.errors import DataError
from mdr_dask.models.base import Coordinate, Model, Output, deferred, quantity
from mdr_dask.models.parts.loading_history import Jump, Protocol, pieces
from mdr_dask.models.parts.material import solid_of
from mdr_dask.models.parts.sliding_body import NUMBERS, SlidingBody, frequency_notes
from mdr_dask.models.parts.surface import NO_GAP
from mdr_dask.models.parts.tested_range import load_notes

if TYPE_CHECKING:
    from mdr_dask.physics.solids import LinearSolid

TIMES = tuple(float(f"{time:.4g}") for time in np.geomspace(1e-4, 20, 54))


class VelocityJump(SlidingBody):
    """A viscoelastic body that slides over a rough line. The velocity jumps from v_1 to v_2, or follows a history."""

    settings: ClassVar[frozenset[str]] = frozenset({"oversampling", "steps_per_decade"})
    rms_roughness: float | None = quantity("m", "rms height h of the roughness", usual="2 um", default=None, gt=0)
    velocity: float = quantity("m/s", "sliding velocity v_1 before the jump", usual="50 mm/s", gt=0)
    oversampling: int = quantity(
        "1",
        "number of grid points after the jump divided by `points`, the number of points of the rough line",
        default=4,
        ge=2,
        le=256,
        multiple_of=2,
    )
    steps_per_decade: int = quantity(
        "1", "number of time steps in each decade of time; use 8 or more for large jumps", default=8, ge=4, le=400
    )
    velocity_change: float = quantity(
        "1", "relative change of the velocity at the jump, (v_2 - v_1) / v_1", default=0.2, gt=-1
    )
    protocol: Protocol = Field(
        default=Jump(),
        description="history of velocity and normal force, beginning at the time 0; by default, the velocity jumps "
        "once, by velocity_change",
    )
    relaxation_times: tuple[float, ...] = quantity(
        "1",
        "times after the jump at which results are stored, divided by the longest relaxation time tau of the material",
        default=TIMES,
        strict=False,
        min_length=2,
    )

    @field_validator("relaxation_times")
    @classmethod
    def _increasing(cls, times: tuple[float, ...]) -> tuple[float, ...]:
        if times[0] < 0 or np.any(np.diff(times) <= 0):
            raise ValueError(f"expected increasing times that are not negative, got {times!r}")
        return times

    @model_validator(mode="after")
    def _changes(self) -> VelocityJump:
        if self.velocity_change == 0:
            raise ValueError("expected a velocity_change other than 0")
        return self

    def largest_force(self) -> float:
        """Return the largest normal force in N, before and after t = 0."""
        (_, before), history = pieces(self.protocol, self.velocity, self.normal_force, self.velocity_change)
        return max(before, *(max(piece.force) + piece.swing[1] for piece in history))

    def solid(self) -> LinearSolid:
        """Return the viscoelastic solid of which the body consists."""
        from mdr_dask.physics.solids import kelvin

        if self.material is not None:
            return solid_of(self.material)
        assert self.shear_modulus is not None
        assert self.relaxation_time is not None
        return kelvin(self.shear_modulus, self.relaxation_time)

    def time_unit(self) -> float:
        """Return tau in s, the unit of stored times: the longest relaxation time of the Prony terms and the dashpot."""
        solid = self.solid()
        return float(max([solid.viscosity / solid.static_modulus, *solid.times]))


OUTPUTS = (
    Output("friction_coefficient_before", "1", "steady coefficient of friction mu_1 before the jump", has_error=True),
    Output("friction_coefficient_jump", "1", "immediate change d_mu_0 of the coefficient of friction", has_error=True),
    Output(
        "friction_coefficient_after", "1", "steady coefficient of friction mu_2 long after the jump", has_error=True
    ),
    Output(
        "friction_coefficient", "1", "coefficient of friction after the jump", ("relaxation_times",), has_error=True
    ),
    Output(
        "indentation_depth",
        "m",
        "indentation depth of the mean line of the roughness",
        ("relaxation_times",),
        False,
        True,
        comment=NO_GAP,
    ),
    Output("rms_slope", "1", "rms slope of the whole line"),
)


def coordinates(parameters: VelocityJump) -> dict[str, Coordinate]:
    """Return the times at which results are stored, as a coordinate."""
    times = np.array(parameters.relaxation_times)
    return {
        "relaxation_times": Coordinate(
            times, "1", "time after the jump divided by the longest relaxation time, (t - t_0) / tau"
        )
    }


def time_notes(sets: Sequence[VelocityJump]) -> tuple[str, ...]:
    """Return a note with tau in s, the longest relaxation time of a material, or with the range of tau in a study.

    Return () if no case has a `material`, or if no material is valid.
    """
    units = []
    for one in sets:
        if one.material is not None:
            with suppress(DataError, ValueError):  # the solver reports the problem for each case
                units.append(one.time_unit())
    if not units:
        return ()
    ends = dict.fromkeys(f"{end:.3g} s" for end in (min(units), max(units)))
    return (f"relaxation_times are multiples of the longest relaxation time tau of the material: {' to '.join(ends)}",)


SOLVE = "mdr_dask.models.velocity_jump.solve"

MODEL = Model(
    name="velocity_jump",
    version=21,
    summary="friction after a jump of the sliding velocity, or during a history of velocity and load",
    parameters=VelocityJump,
    outputs=OUTPUTS,
    compute=deferred(SOLVE, "compute"),
    operations=deferred(SOLVE, "operations"),
    whole=("velocity", "normal_force", "velocity_change", "shear_modulus", "relaxation_time", "rms_roughness"),
    coordinates=coordinates,
    numbers=(*NUMBERS,),
    notes=lambda sets: (*frequency_notes(sets), *load_notes(sets), *time_notes(sets)),
)
