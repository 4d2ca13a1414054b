"""Unknowns from measured points: planted values are held as often as stated, and what is open is named."""

import numpy as np
import pytest
import xarray as xr

from mdr_dask.campaign.measured import Measured
from mdr_dask.fits.calibration import calibrate, summary

AXES = {
    "normal_force": (np.geomspace(0.1, 10, 5), "N"),
    "velocity": (np.geomspace(1e-3, 1, 9), "m/s"),
    "relaxation_time": (np.geomspace(1e-4, 1e-2, 7), "s"),
    "rms_roughness": (np.geomspace(1e-7, 1e-5, 7), "m"),
}
TRUE = {"relaxation_time": 7e-4, "rms_roughness": 1.3e-6}


def friction(force, velocity, time, height):
    """As the laws of steady friction have it: a slope of the root of the height, and two regimes of the velocity."""
    reduced = (force / 4 + force**0.4) / (1e4 * velocity * time)
    return 0.3 * np.sqrt(height / 1e-6) / np.sqrt(1 + reduced**2)


def slow(force, velocity, time, height):
    """Region I of a rough indenter: v tau slope^2."""
    return 2e9 * velocity * time * (height / 1e-3) ** 2 / force


def study(lines=1, scatter=0.0, seed=0, function=friction):
    """Return a study whose lines differ in height and slope of their friction, alike in all cases."""
    rng = np.random.default_rng(seed)
    grid = np.meshgrid(*(values for values, _ in AXES.values()), indexing="ij")
    level, tilt = scatter * rng.normal(size=(2, lines))
    values = function(*grid)[..., None] * (1 + level + tilt * np.log10(1e4 * grid[1] * grid[2])[..., None] / 2)
    coords = {name: (name, axis, {"units": unit}) for name, (axis, unit) in AXES.items()}
    return xr.Dataset({"mu": ((*AXES, "realisation"), values, {"units": "1"})}, coords)


def table(rng, points=12, noise=0.03, given=True, function=friction, velocities=(1e-3, 1.0)):
    force, velocity = (np.exp(rng.uniform(*np.log(ends), points)) for ends in ((0.1, 10.0), velocities))
    exact = function(force, velocity, *TRUE.values())
    conditions = {"normal_force": force, "velocity": velocity}
    values = exact * (1 + noise * rng.normal(size=points))
    return Measured("rig.csv", "mu", values, noise * exact if given else None, conditions, tuple(range(2, points + 2)))


@pytest.mark.parametrize(
    ("lines", "scatter", "given", "tables"),
    [(1, 0.0, True, 60), (5, 0.1, True, 60), (1, 0.0, False, 12)],
)
def test_intervals_hold_the_truth_as_often_as_they_say(lines, scatter, given, tables):
    """Each table comes with lines of its own; a binomial leaves the bounds once in a thousand times or less."""
    rng = np.random.default_rng(2)
    held = {0.95: [], 0.6827: []}
    for k in range(tables):
        found = summary(calibrate(study(lines, scatter, k), table(rng, given=given)))
        for name, true in TRUE.items():
            held[0.95].append(found[f"{name}_low"] < true < found[f"{name}_high"])
            held[0.6827].append(found[f"{name}_low_68"] < true < found[f"{name}_high_68"])
    for level, hits in held.items():
        # the two unknowns of a table err together
        assert abs(np.mean(hits) - level) < 3.3 * np.sqrt(level * (1 - level) / tables)
