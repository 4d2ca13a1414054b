"""Synthetic studies of sliding friction with planted laws, and how often intervals and verdicts are right."""

import numpy as np
import xarray as xr

from mdr_dask.physics.sliding import laws

G, RMS, LENGTH, TAU, SLOPE, POINTS = 1e7, 5e-7, 0.02, 1e-3, 0.1, 400


def planted(axes, lines, studies, scatter=(0.05, 0.03), grid=0.0, **outputs):
    """Return studies whose outputs are functions of force number and velocity number, with scatter of the lines.

    `axes` holds arrays for axes and numbers for fixed parameters. `scatter` is the scatter that all cases of a line
    share, and the scatter of every case. With `grid`, all outputs are too high by that share, which their companions
    state.
    """
    rng = np.random.default_rng(12)
    base = {"shear_modulus": G, "rms_roughness": RMS, "length": LENGTH, "relaxation_time": TAU, "points": POINTS}
    coords = base | {"hurst": 0.5, "normal_force": 1.0, "velocity": 1e-6} | axes
    data = xr.Dataset(coords={name: (name, value) if np.ndim(value) else value for name, value in coords.items()})
    force = laws.force_number(data.normal_force, G, RMS, LENGTH)
    velocity = laws.velocity_number(data.velocity, TAU, SLOPE, RMS)
    force, velocity = xr.broadcast(force, velocity)
    dims = ("study", *force.dims, "realisation")
    for name, law in outputs.items():
        shared = scatter[0] * rng.standard_normal((studies, *(1 for _ in force.shape), lines))
        own = scatter[1] * rng.standard_normal((studies, *force.shape, lines))
        values = np.asarray(law(force, velocity))[..., None] * (1 + shared + own) * (1 + grid)
        data[name] = (dims, values, {"ancillary_variables": f"{name}_error"} if grid else {})
        if grid:
            data[f"{name}_error"] = (dims, grid * values)
    data["rms_slope"] = xr.full_like(data[next(iter(outputs))], SLOPE)
    return data


def coverage(found, name, truth):
    """Return the share of the intervals that contain the truth."""
    return float(((found[f"{name}_low"] <= truth) & (truth <= found[f"{name}_high"])).mean())


def judged(found, verdict, which="fitted_law_holds"):
    """Return the share of the verdicts that begin with a word."""
    return float(found[which].str.startswith(verdict).mean())


def not_contradicted(found, lines, which="fitted_law_holds"):
    """Return the share of studies whose law holds; with few realisations, all that are not contradicted."""
    if lines >= 30:
        return judged(found, "yes", which) + judged(found, "approximately", which)
    return 1 - judged(found, "no:", which)
