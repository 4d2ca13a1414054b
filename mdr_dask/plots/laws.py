"""Laws that figures draw together with the data of an output."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import aggregation
from mdr_dask.fits.friction import loads_and_velocities, spectral_slope
from mdr_dask.fits.indenter import indenter_xi
from mdr_dask.fits.jumps import LAW, LEVELS, is_jump, jump_law
from mdr_dask.models.ehl_line import groups
from mdr_dask.physics.lubrication.film_formulas import PAN_HAMROCK_CENTRAL, PAN_HAMROCK_MINIMUM
from mdr_dask.physics.sliding import laws
from mdr_dask.plots.figure import SMOOTH

#: Names of the outputs that some laws need as input.
NEEDED = ("rms_slope", LEVELS[0])
FILMS = {"central_film": PAN_HAMROCK_CENTRAL, "minimum_film": PAN_HAMROCK_MINIMUM}
#: Name of the output that is the steady coefficient of friction, for each model.
STEADY = {"sliding_friction": "friction_coefficient", "velocity_jump": LEVELS[0]}
#: Parameters of a Kelvin body on a generated line.
LINE = {"shear_modulus", "relaxation_time", "rms_roughness", "length", "hurst", "points"}


class Law(NamedTuple):
    """A law of an output: the name of the law in the legend, and a function that computes the output in SI units.

    The function uses the parameters and the outputs `NEEDED`.
    """

    name: str
    value: Callable[[xr.Dataset], xr.DataArray]


def law_of(data: xr.Dataset, output: str) -> Law | None:
    """Return the law for an output of a series, or None if there is no law for this output."""
    model = data.attrs.get("model")
    if model == "ehl_line" and output in FILMS and "inlet" not in data.coords:
        return Law("Pan and Hamrock", lambda part: xr.DataArray(FILMS[output](*groups(part.coords.get))))
    if not LINE.issubset(data.coords) or not bool((data["rms_roughness"] > 0).all()):
        return None
    if model == "velocity_jump" and output == LEVELS[1] and is_jump(data) and LEVELS[0] in data:
        return Law("law (eq. 4.11)", _jump)
    if output != STEADY.get(str(model)):
        return None
    if not any(str(name).startswith("indenter_") for name in data.coords):
        return Law("law (eq. 3.18)", _plane)
    return Law("law (eq. 3.40)", _rough_indenter) if model == "sliding_friction" else None


def along(data: xr.Dataset, name: str) -> xr.Dataset:
    """Return the parameters of a curve at many values of `name`, so that a law becomes a smooth line.

    The data are returned unchanged if `name` has only one value, if its values are not numbers, or if one of the
    outputs `NEEDED` varies along the curve.
    """
    values = data[name]
    numeric = values.ndim == 1 and values.dtype.kind in "fiu"
    if not numeric or any(name in data[each].dims for each in NEEDED if each in data):
        return data
    low, high = float(values.min()), float(values.max())
    spread = np.geomspace if low > 0 else np.linspace
    held = data[[each for each in NEEDED if each in data]]
    fine: xr.Dataset = held.drop_vars(name, errors="ignore").assign_coords(
        {name: (name, spread(low, high, SMOOTH), values.attrs)}
    )
    return fine


def _plane(data: xr.Dataset) -> xr.DataArray:
    force, velocity = loads_and_velocities(data)
    law = laws.interpolation(force, velocity, laws.alpha(data["hurst"]), laws.BETA)
    return xr.DataArray(np.sqrt(2) * spectral_slope(data) * law)


def _rough_indenter(data: xr.Dataset) -> xr.DataArray:
    slope = spectral_slope(data)
    return xr.DataArray(np.sqrt(2) * slope * laws.indenter(indenter_xi(data, slope)))


def _jump(data: xr.Dataset) -> xr.DataArray:
    """Compute the jump of friction by eq. 4.11 from the stored friction before the jump."""
    slope = spectral_slope(data)
    before = aggregation.mean(data[LEVELS[0]]) / slope
    law = xr.apply_ufunc(jump_law, before, kwargs={"constant": LAW})
    return xr.DataArray(law * slope * data["velocity_change"])
