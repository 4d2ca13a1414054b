"""Everything that every fit finds, on record: of cases that scatter each by itself, lose lines, or follow no law."""

from __future__ import annotations

import re

import numpy as np
import planted
import pytest
import record
import rows
import xarray as xr
from scipy.special import gamma

from mdr_dask import fits, models
from mdr_dask.errors import DataError, FitError

LINE = "  length: 20 mm\n  points: 500\n  rms_roughness: 0.37 um\n"
HURSTS = "  hurst: [0.32, 0.74]\n"
BODY = "  shear_modulus: 9.1 MPa\n  relaxation_time: 1.3 ms\n"
SPEEDS = "  velocity: {geometric: [0.4 um/s, 0.9 m/s, 10]}\n"
SLIDING = "model: sliding_friction\nparameters:\n"
CONE = "  indenter: {shape: cone, angle: 0.02 deg}\n"
PARABOLA = "  indenter: {shape: parabola, radius: 2.1 m}\n"
POWER = "  indenter: {shape: power, exponent: 1.6, coefficient: 0.02}\n"
LOADS = "  normal_force: {geometric: [10 mN, 20 N, 6]}\n"
JUMP = "model: velocity_jump\nparameters:\n  normal_force: 1 N\n"
SCAN = "  length: 20 mm\n  points: 500\n  surface: {scan: line.csv}\n"
DMA = (
    "  material:\n    dma_table: {file: dma.csv, table_temperature: 298 K, poisson_ratio: 0.5}\n"
    "    temperature: [281 K, 292 K, 304 K, 319 K]\n    wlf: {c1: 10, c2: 100 K, reference: 298 K}\n"
)
FILM = "model: ehl_line\noutputs: [central_film, minimum_film]\nparameters:\n"

STUDIES = {
    "sliding": SLIDING + LINE + HURSTS + BODY + SPEEDS + "  normal_force: [0.8 mN, 2.3 mN, 7 mN, 0.2 N, 9 N]\n",
    "sampled": f"{SLIDING}{LINE}{BODY}  velocity: {{geometric: [1 um/s, 1 m/s]}}\n"
    "  normal_force: {geometric: [9 mN, 3 N]}\nsampling: {sobol: 24}\n",
    "sampled exponents": f"{SLIDING}{LINE}{BODY}  velocity: 1 mm/s\n  hurst: {{linear: [0.2, 0.9]}}\n"
    "  normal_force: {geometric: [9 mN, 3 N]}\nsampling: {sobol: 8}\n",
    "cone": SLIDING + LINE + HURSTS + BODY + LOADS + "  velocity: {geometric: [2 mm/s, 2 m/s, 6]}\n" + CONE,
    "parabola": SLIDING + LINE + BODY + LOADS + "  velocity: 0.11 m/s\n" + PARABOLA,
    "power": SLIDING + LINE + BODY + LOADS + "  velocity: [20 mm/s, 0.3 m/s]\n" + POWER,
    "steep": SLIDING + LINE + BODY + LOADS + "  velocity: 1 mm/s\n  indenter: {shape: cone, angle: 30 deg}\n",
    "temperatures": SLIDING + LINE + SPEEDS + DMA + "  normal_force: {geometric: [4 mN, 31 N, 4]}\n",
    "jumps": JUMP + LINE + HURSTS + BODY + "  velocity: {geometric: [0.1 mm/s, 1.5 m/s, 7]}\n",
    "jumps of sizes": JUMP + LINE + HURSTS + BODY + "  velocity: 70 mm/s\n  velocity_change: [-0.1, 0.2, 0.45, 0.9]\n",
    "jumps on a scan": JUMP + SCAN + BODY + "  velocity: [7 mm/s, 0.1 m/s, 0.4 m/s]\n",
    "films": f"{FILM}  speed_parameter: {{geometric: [1e-12, 1e-10, 4]}}\n  load_parameter: [1e-5, 4e-5]\n"
    "  material_parameter: [2500, 4700]\n",
}

TOLD = ("sliding", "temperatures", "cone", "jumps", "jumps of sizes", "films")

#: Exponent of an indenter, and its coefficient mapped to one dimension.
BODIES = {
    "cone": (1.0, np.pi / 2 * np.tan(np.radians(0.02))),
    "parabola": (2.0, 1 / 2.1),
    "power": (1.6, 0.02 * np.sqrt(np.pi) * gamma(1.8) / gamma(1.3)),
    "steep": (1.0, np.pi / 2 * np.tan(np.radians(30))),
}


def with_law_of(body, groups):
    """Plant the law of rough indenters with the exponent 1.7, and region IV behind it."""
    (exponent, coefficient), data = BODIES[body], groups[""].load()
    width = (data["normal_force"] / 36.4e6 * (exponent + 1) / (2 * exponent * coefficient)) ** (1 / (exponent + 1))
    slope = data["rms_slope"]
    xi = 8 * 9.1e6 * width * 1.3e-3 * data["velocity"] * slope / np.sqrt(2) / data["normal_force"]
    friction = np.sqrt(2) * slope * (1 + xi**-1.7) ** (-1 / 1.7) / (1 + (xi / 30) ** 3)
    data["friction_coefficient"].values = friction.transpose(*data["friction_coefficient"].dims).values
    return groups


def scattered(groups, size: float, astray: float):
    """Let every result scatter by itself and err in its own way, and the means go astray of their law."""
    chance = np.random.default_rng(7)
    found = {}
    for name, data in groups.items():
        data = data.load().copy(deep=True)
        beside = {array.attrs.get("ancillary_variables"): key for key, array in data.data_vars.items()}
        for key in [key for key in data if key not in beside and key not in ("status", "rms_slope")]:
            like = data[key]
            bend = astray * np.sin(1.7 * np.arange(like.isel(realisation=0).size)).reshape(
                like.isel(realisation=0).shape
            )
            waves = xr.DataArray(bend, dims=[dim for dim in like.dims if dim != "realisation"])
            noise = like.copy(data=size * chance.standard_normal(like.shape))
            data[key].values = (like * (1 + noise + waves)).transpose(*like.dims).values
        for error, key in beside.items():
            if error in data:
                data[error].values = np.abs(data[key]) * size * chance.uniform(0.02, 0.2, data[key].shape)
        found[name] = data
    return found


def lost(groups):
    """Leave of some cases one line, of others none, and let some errors be unknown or infinite."""
    for data in groups.values():
        for key, array in data.data_vars.items():
            if key in ("status", "rms_slope") or "realisation" not in array.dims:
                continue
            place, values = np.arange(array.size).reshape(array.shape), array.values
            if str(key).endswith("_error"):
                values[place % 29 == 3] = np.inf
                values[place % 31 == 4] = np.nan
            elif array.dims[-1] == "realisation":
                count, case = array.sizes["realisation"], place // array.sizes["realisation"]
                values[(place % 23 == 5) | (case == 4) | ((case == case.max()) & (place % count > 0))] = np.nan
    return groups


MOODS = {
    "scattered": lambda groups, part: scattered(groups, 0.02 * part, 0.0),
    "astray": lambda groups, part: scattered(groups, 0.007 * part, 0.2 * part),
    "lost": lambda groups, part: lost(scattered(groups, 0.05 * part, 0.03 * part)),
}
ASTRAY = ("power", "jumps of sizes")
LOSING = ("sliding", "sampled", "cone", "jumps", "films")


@pytest.mark.parametrize("study", STUDIES)
def test_everything_that_every_fit_finds_is_on_record(study, tmp_path, dataframe_regression):
    planted.make_tables(tmp_path)
    groups = planted.make(tmp_path, STUDIES[study], realisations=5)
    groups = with_law_of(study, groups) if study in BODIES else groups
    laws = fits.available(re.findall(r"model: (\w+)", STUDIES[study])[0])
    wanted = {"indenter"} if "indenter" in STUDIES[study] else laws.keys() - {"calibration", "indenter"}
    wanted -= {"relaxation", "rate_power", "rate_and_state"} if study == "jumps of sizes" else set()
    found: dict[str, object] = {}
    part = 0.05 if "jumps" in study else 1.0  # what relaxes is a small part of friction
    for mood in MOODS if study in LOSING else ("scattered", "astray")[: 1 + (study in ASTRAY)]:
        for name in sorted(wanted):
            try:
                results = laws[name].results(MOODS[mood](groups, part))
            except (DataError, FitError) as sentence:
                found[f"{mood} {name}"] = str(sentence)
                continue
            for series, result in results.items():
                found |= rows.of_dataset(f"{mood} {name}{series}", result, study in TOLD and mood == "scattered", 2)
    record.check(dataframe_regression, found)


def test_what_every_fit_says_of_itself_is_on_record(dataframe_regression):
    found = {
        name: [fit.models, fit.summary, fit.apart, "of the campaign" if callable(fit.constants) else fit.constants]
        for model in models.names()
        for name, fit in fits.available(model).items()
    }
    record.check(dataframe_regression, {name: [str(part) for part in said] for name, said in found.items()})
