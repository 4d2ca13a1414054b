"""Blocks of the model velocity_jump on a short line."""

import numpy as np

from mdr_dask.models.base import Block
from mdr_dask.models.velocity_jump import MODEL, VelocityJump

EVERY = MODEL.with_companions(tuple(output.name for output in MODEL.outputs))
BASE = {
    "length": 0.002,
    "points": 100,
    "rms_roughness": 2e-6,
    "shear_modulus": 1e7,
    "relaxation_time": 1e-3,
    "normal_force": 0.1,
    "velocity": 0.05,
    "relaxation_times": (0.05, 0.5, 2.0, 12.0),
}
STEP = {"shape": "steps", "times": [0.0], "velocities": [0.06]}


def block(
    columns: dict[str, np.ndarray] | None = None, realisations: tuple[int, ...] = (0, 3), **changes: object
) -> Block[VelocityJump]:
    """Return a block of all outputs; a change to None leaves a parameter out."""
    columns = columns or {}
    cases = next(iter(columns.values())).size if columns else 1
    kept = {name: value for name, value in (BASE | changes).items() if value is not None}
    return Block(VelocityJump.model_validate(kept), columns, cases, realisations, 5, EVERY)
