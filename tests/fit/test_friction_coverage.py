"""Do the intervals of the fits of sliding friction hold planted truths, and do the fits name laws that do not hold?"""

import numpy as np
import pytest
import xarray as xr

from mdr_dask.fit.friction import FITS
from mdr_dask.physics.sliding import laws

FIT = {fit.name: fit for fit in FITS}
STUDIES = 150
LEAST = 0.92
G, RMS, LENGTH, TAU, SLOPE = 1e7, 5e-7, 0.02, 1e-3, 0.1
LINES = pytest.mark.parametrize("lines", [5, 10, 30])
# scatter that all cases of a line share, and scatter of every case for itself
SCATTER = pytest.mark.parametrize("scatter", [(0.1, 0.02), (0.05, 0.1)])


def planted(law, axes, lines, scatter, studies=STUDIES, grid=0.0, **fixed):
    """Return studies of a law, a function of force number and velocity number, that lines scatter about.

    With `grid`, all friction is too high by that share, which its companion says.
    """
    rng = np.random.default_rng(11)
    base = {"shear_modulus": G, "rms_roughness": RMS, "length": LENGTH, "relaxation_time": TAU, "points": 400}
    base |= {"hurst": 0.5, "normal_force": 1.0, "velocity": 1e-6} | fixed
    coords = {name: axes.get(name, value) for name, value in base.items()}
    coords = {name: (name, value) if np.ndim(value) else value for name, value in coords.items()}
    data = xr.Dataset(coords=coords)
    force = laws.force_number(data.normal_force, G, RMS, LENGTH)
    velocity = laws.velocity_number(data.velocity, TAU, SLOPE, RMS)
    mean = law(force, velocity)
    shape = (studies, *mean.shape, lines)
    own = scatter[1] * rng.standard_normal(shape)
    shared = scatter[0] * rng.standard_normal((studies, *(1 for _ in mean.shape), lines))
    dims = ("study", *mean.dims, "realisation")
    friction = SLOPE * np.asarray(mean)[..., None] * (1 + own + shared) * (1 + grid)
    data["friction_coefficient"] = (dims, friction, {"ancillary_variables": "friction_coefficient_error"})
    if grid:
        data["friction_coefficient_error"] = (dims, grid * friction)
    data["rms_slope"] = xr.full_like(data["friction_coefficient"], SLOPE)
    return data


def coverage(found, name, truth):
    return float(((found[f"{name}_low"] <= truth) & (truth <= found[f"{name}_high"])).mean())


def judged(found, verdict):
    return float(found["law_holds"].str.startswith(verdict).mean())


ZONE = {"normal_force": np.geomspace(1e-3, 3e-2, 8)}


def zone(force, velocity):
    return laws.zone_one(force, velocity, 0.35, 1.5)


@LINES
@SCATTER
def test_zone_one(lines, scatter):
    found = FIT["zone_one"].compute({"": planted(zone, ZONE, lines, scatter)})
    assert coverage(found, "alpha", 0.35) >= LEAST
    assert coverage(found, "beta", 1.5) >= LEAST
    assert judged(found, "yes") >= LEAST


TOP = {"normal_force": 15.0 * G * RMS * LENGTH, "velocity": np.geomspace(1e-2, 1e4, 19) / 100}


def broad(_, velocity):
    return np.sqrt(2) * (1 + (velocity / 0.02) ** -2) ** -0.5 * (1 + (velocity / 5000) ** 2) ** -0.5


def skew(_, velocity):
    return 2 * velocity / (1 + velocity) * (1 + velocity / 3) ** -0.4


def saturating(_, velocity):
    return np.sqrt(2) * (1 + (velocity / 0.05) ** -2) ** -0.5


@LINES
@SCATTER
@pytest.mark.parametrize("law", [broad, skew, saturating])
def test_plateau(lines, scatter, law):
    found = FIT["plateau"].compute({"": planted(law, TOP, lines, scatter)})
    truth = float(law(None, np.geomspace(1e-3, 1e4, 20001)).max())
    assert coverage(found, "plateau", truth) >= LEAST
    # no bias from taking a maximum: the largest of noisy means is up to 7 % too high here
    assert float(found["plateau"].mean()) == pytest.approx(truth, rel=0.025)
    assert judged(found, "yes") >= LEAST
