"""Parameters and outputs of the model `sliding_friction`."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from mdr_dask.models.base import Model, Number, Output, deferred, quantity
from mdr_dask.models.parts.sliding_body import NUMBERS, SlidingBody, frequency_notes
from mdr_dask.models.parts.surface import NO_AREA, NO_GAP
from mdr_dask.models.parts.tested_range import load_notes


class SlidingFriction(SlidingBody):
    """A viscoelastic body that slides over a rough line at constant velocity and constant normal force."""

    settings: ClassVar[frozenset[str]] = frozenset({"oversampling"})
    oversampling: Annotated[int, Field(ge=1, le=256)] | Literal["auto"] = quantity(
        "1",
        "number of grid points divided by `points`, the number of points of the rough line. 1 gives the grid of the "
        "original papers; with auto, the grid is refined until the accuracy is reached",
        default="auto",
    )
    scheme: Literal["hermite", "backward_euler"] = Field(
        default="hermite",
        description="method that integrates the deformation along the line. hermite: exact for a line that is a cubic "
        "between neighbouring grid points. backward_euler: the time steps of the original papers, for a Kelvin body "
        "only",
    )


OUTPUTS = (
    Output("friction_coefficient", "1", "coefficient of friction", has_error=True),
    Output(
        "indentation_depth", "m", "indentation depth of the mean line of the roughness", has_error=True, comment=NO_GAP
    ),
    Output("contact_fraction", "1", "fraction of the line that is in contact", has_error=True, comment=NO_AREA),
    Output("contact_slope", "1", "rms slope of the line inside the contact", has_error=True),
    Output("rms_slope", "1", "rms slope of the whole line"),
    Output(
        "material_error", "1", "rms relative error of the fitted Prony series; 0 if no series was fitted", (), False
    ),
)

SOLVE = "mdr_dask.models.sliding_friction.solve"

MODEL = Model(
    name="sliding_friction",
    version=20,
    summary="steady friction of a viscoelastic body on a rough line or a rough indenter",
    parameters=SlidingFriction,
    outputs=OUTPUTS,
    compute=deferred(SOLVE, "compute"),
    operations=deferred(SOLVE, "operations"),
    whole=("normal_force", "velocity", "shear_modulus", "relaxation_time", "rms_roughness"),
    notes=lambda sets: (*frequency_notes(sets), *load_notes(sets)),
    numbers=(
        *NUMBERS,
        Number(
            "scaled_friction",
            "friction_coefficient / (sqrt(2) * rms_slope)",
            "coefficient of friction / (sqrt 2 x rms slope)",
        ),
    ),
)
