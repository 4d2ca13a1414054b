"""Datasets of sliding friction, computed by the model and labelled like a store."""

import json
from math import prod

import numpy as np
import xarray as xr

from mdr_dask.models.base import Block
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction

BASE = {
    "length": 0.02,
    "points": 400,
    "oversampling": 2,
    "hurst": 0.7,
    "rms_roughness": 5e-7,
    "shear_modulus": 1e7,
    "relaxation_time": 1e-3,
    "normal_force": 1.5,
    "velocity": 0.1,
}


def store(axes, realisations=8, outputs=("friction_coefficient", "contact_fraction", "rms_slope"), **changes):
    """Run the model on a grid of axes (dotted name: values) and return the result as a labelled dataset."""
    parameters = SlidingFriction.model_validate(BASE | changes)
    grid = np.meshgrid(*axes.values(), indexing="ij")
    shape = grid[0].shape
    columns = {path: values.ravel() for path, values in zip(axes, grid, strict=True)}
    result = MODEL.compute(Block(parameters, columns, prod(shape), tuple(range(realisations)), 2013, outputs))
    names = [path.replace(".", "_") for path in axes]
    dims = (*names, "realisation")
    data = {name: (dims, values.reshape(*shape, -1)) for name, values in result.values.items()}
    data["status"] = (dims, result.status.reshape(*shape, -1))
    coords = {name: (name, np.asarray(values)) for name, values in zip(names, axes.values(), strict=True)}
    fixed = parameters.model_dump()
    fixed |= {f"indenter_{key}": value for key, value in fixed.pop("indenter").items()}
    coords |= {k: v for k, v in fixed.items() if k not in coords and isinstance(v, int | float)}
    return xr.Dataset(data, coords, {"parameters": json.dumps(parameters.model_dump())})


def relative_error(values):
    """Return the stated error of friction relative to friction."""
    return values["friction_coefficient_error"] / values["friction_coefficient"]
