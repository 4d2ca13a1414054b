"""Laws that figures draw together with the data of an output."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import aggregation
from mdr_dask.fits.friction import loads_and_velocities, spectral_slope
from mdr_dask.fits.indenter import indenter_xi
from mdr_dask.fits.kinetic_cases import is_jump
from mdr_dask.models.ehl_line import groups
from mdr_dask.physics.lubrication.film_formulas import PAN_HAMROCK_CENTRAL, PAN_HAMROCK_MINIMUM, FilmFormula
from mdr_dask.physics.sliding import laws


class Law(NamedTuple):
    """A law of one output.

    Attributes
    ----------
    name : str
        Name in the legend.
    models, output
        Models and output to which the law applies.
    holds_for : callable, Dataset -> bool
        Returns whether the law applies to a series.
    value : callable, Dataset -> DataArray
        Returns the value of the law in SI, from the parameters and the outputs in `NEEDED`.
    """

    name: str
    models: tuple[str, ...]
    output: str
    holds_for: Callable[[xr.Dataset], bool]
    value: Callable[[xr.Dataset], xr.DataArray]


#: Outputs that some laws need as input.
NEEDED = ("rms_slope", "friction_coefficient_before")


def law_of(data: xr.Dataset, output: str) -> Law | None:
    """Return the law of an output that applies to a series, or None."""
    model = data.attrs.get("model")
    known = (law for law in LAWS if model in law.models and law.output == output)
    return next((law for law in known if law.holds_for(data)), None)


def along(data: xr.Dataset, name: str, count: int = 200) -> xr.Dataset:
    """Return the data of a curve at many values of its parameter, so that a law can be drawn as a smooth line.

    The data are unchanged if an output that the law needs varies along the curve.

    Parameters
    ----------
    data : Dataset
        Data of one curve: nothing but `name` varies.
    name : str
        The parameter.
    count : int
        Number of values.
    """
    values = data[name]
    numeric = values.ndim == 1 and values.dtype.kind in "fiu"
    if not numeric or any(name in data[each].dims for each in NEEDED if each in data):
        return data
    low, high = float(values.min()), float(values.max())
    spread = np.geomspace if low > 0 else np.linspace
    held = data[[each for each in NEEDED if each in data]]
    fine: xr.Dataset = held.drop_vars(name, errors="ignore").assign_coords(
        {name: (name, spread(low, high, count), values.attrs)}
    )
    return fine


def on_generated_line(data: xr.Dataset) -> bool:
    """Return whether a series has a Kelvin body on a generated line."""
    needed = {"shear_modulus", "relaxation_time", "rms_roughness", "length", "hurst", "points"}
    return needed <= set(data.coords) and bool((data["rms_roughness"] > 0).all())


def is_plane(data: xr.Dataset) -> bool:
    """Return whether a series has a plane Kelvin body on a generated line."""
    return on_generated_line(data) and not any(str(name).startswith("indenter_") for name in data.coords)


def _plane(data: xr.Dataset) -> xr.DataArray:
    force, velocity = loads_and_velocities(data)
    law = laws.interpolation(force, velocity, laws.alpha(data["hurst"]), laws.BETA)
    return xr.DataArray(np.sqrt(2) * spectral_slope(data) * law)


def _rough_indenter(data: xr.Dataset) -> xr.DataArray:
    slope = spectral_slope(data)
    return xr.DataArray(np.sqrt(2) * slope * laws.indenter(indenter_xi(data, slope)))


def _is_rough_indenter(data: xr.Dataset) -> bool:
    return on_generated_line(data) and not is_plane(data)


def _jump(data: xr.Dataset) -> xr.DataArray:
    """Return the jump of friction by eq. 4.11, from the stored friction before the jump."""
    from mdr_dask.fits.jumps import LAW, jump_law

    slope = spectral_slope(data)
    before = aggregation.mean(data["friction_coefficient_before"]) / slope
    law = xr.apply_ufunc(jump_law, before, kwargs={"constant": LAW})
    return xr.DataArray(law * slope * data["velocity_change"])


def _is_known_jump(data: xr.Dataset) -> bool:
    return is_jump(data) and on_generated_line(data) and "friction_coefficient_before" in data


def _film(formula: FilmFormula) -> Callable[[xr.Dataset], xr.DataArray]:
    def value(data: xr.Dataset) -> xr.DataArray:
        return xr.DataArray(formula(*groups(data.coords.get)))

    return value


def _is_flooded(data: xr.Dataset) -> bool:
    return "inlet" not in data.coords


LAWS: tuple[Law, ...] = (
    Law("law (eq. 3.18)", ("sliding_friction",), "friction_coefficient", is_plane, _plane),
    Law("law (eq. 3.40)", ("sliding_friction",), "friction_coefficient", _is_rough_indenter, _rough_indenter),
    Law("law (eq. 3.18)", ("velocity_jump",), "friction_coefficient_before", is_plane, _plane),
    Law("law (eq. 4.11)", ("velocity_jump",), "friction_coefficient_jump", _is_known_jump, _jump),
    Law("Pan and Hamrock", ("ehl_line",), "central_film", _is_flooded, _film(PAN_HAMROCK_CENTRAL)),
    Law("Pan and Hamrock", ("ehl_line",), "minimum_film", _is_flooded, _film(PAN_HAMROCK_MINIMUM)),
)
