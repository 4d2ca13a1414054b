"""Stores of every model that contain known numbers instead of solutions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr

from mdr_dask import campaign, plan, store
from mdr_dask.models.base import Status
from mdr_dask.physics.sliding import laws

LINE = """
  length: 20 mm
  points: 500
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
"""
SLIDING = f"model: sliding_friction\nparameters:{LINE}"
JUMP = f"model: velocity_jump\nparameters:{LINE}"
ROLLERS = """
model: mixed_lubrication
outputs: [breakthrough_probability, contact_length, contact_half_width, film, film_ratio, asperity_load_share,
          friction_coefficient]
parameters:
  rms_roughness: 0.2 um
  points: 100000
"""
NUMBERS = """
model: ehl_line
outputs: [central_film, minimum_film, film, pressure, traction_coefficient]
parameters:
"""
RULE = "wear_rule"
FRETTING = """
model: fretting_wear
outputs: [wear_volume, contact_radius, worn_profile, worn_image]
parameters:
  points: 21
"""


def make_tables(folder: Path) -> None:
    """Write the files of the surfaces, the material and the rig."""
    random = np.random.default_rng(0)
    q = np.geomspace(2 * np.pi / 0.02, 2 * np.pi / 8e-5, 30)
    rows = "".join(f"{wave:.6g},{1e-9 * wave**-3.4:.6g}\n" for wave in q)
    (folder / "road.csv").write_text(f"q [rad/m],C2D [m^4]\n{rows}")
    wave = np.hypot(np.fft.fftfreq(64)[:, None], np.fft.rfftfreq(64))
    wave[0, 0] = 1
    phases = np.exp(2j * np.pi * random.random(wave.shape))
    np.save(folder / "road.npy", 10 * np.fft.irfft2(wave**-1.7 * phases * (wave < 1)))
    line = np.cumsum(random.standard_normal(200))
    line -= np.linspace(line[0], line[-1], line.size)
    rows = "".join(f"{0.1 * k:.1f},{height:.5f}\n" for k, height in enumerate(line))
    (folder / "line.csv").write_text(f"x [mm],z [um]\n{rows}")
    rows = "".join(f"{f:.4g},{3 + f**0.3:.4g},{0.4 * f**0.3:.4g}\n" for f in np.geomspace(0.01, 100, 9))
    (folder / "dma.csv").write_text(f"f [Hz],E' [MPa],E'' [MPa]\n{rows}")
    (folder / "rig.csv").write_text("normal_force [N],friction_coefficient\n0.01,0.02\n0.1,0.015\n1,0.012\n10,0.01\n")


def make(folder: Path, text: str, realisations: int = 4, failed: bool = False) -> dict[str, xr.Dataset]:
    """Create the store of a campaign, write known numbers into it, and open it; optionally some cases have failed."""
    path = folder / "study.yaml"
    path.write_text(f"name: study\nseed: 1\nrealisations: {realisations}\n{text}")
    study = campaign.load(path)
    url = str(folder / "study.zarr")
    store.lay_out(url, plan.templates(study, realisations))
    for name, data in store.datasets(url).items():
        unsorted = xr.open_zarr(url, group=store.files.group_name(name) or None, chunks=None)
        _fill(zarr.open_group(url, path=store.files.group_name(name) or "", mode="r+"), study.model, unsorted, failed)
        assert set(data.data_vars) <= set(unsorted.data_vars)
    return store.datasets(url)


def _fill(group: zarr.Group, model: str, data: xr.Dataset, failed: bool) -> None:
    status = xr.full_like(data["status"], Status.DONE.value)
    if failed:
        status[dict.fromkeys(status.dims, -1)] = Status.FAILED.value
        status[{dim: 0 for dim in status.dims if dim != "realisation"}] = Status.FAILED.value
    noise = xr.DataArray(
        1 + 0.02 * np.random.default_rng(0).standard_normal(data.sizes["realisation"]), dims="realisation"
    )
    numbers = PLANTED[model](data, noise) if model in PLANTED else {}
    for name in data.data_vars:
        if name == "status":
            continue
        value = numbers.get(name, _anything(data[name], noise))
        of = numbers.get(str(name).removesuffix("_error"))
        if of is not None and str(name).endswith("_error"):
            value = 0.005 * abs(of).mean("realisation") * xr.ones_like(noise)
        value = _as_limit(value.broadcast_like(data[name]), data).transpose(*data[name].dims)
        group[str(name)][...] = value.where(status == Status.DONE.value).transpose(*data[name].dims).values
    group["status"][...] = status.values


def _as_limit(value: xr.DataArray, data: xr.Dataset) -> xr.DataArray:
    """Return worn shapes whose limit is the same after any number of cycles."""
    if RULE not in value.dims or "cycles" not in value.dims:
        return value
    return value.where(data[RULE] != "limit", value.isel(cycles=-1))


def _anything(like: xr.DataArray, noise: xr.DataArray) -> xr.DataArray:
    """Return positive numbers, different in every case, that rise along every dimension."""
    value: Any = 1.0
    for k, dim in enumerate(like.dims):
        if dim != "realisation":
            value = value + xr.DataArray(np.linspace(0, 0.1 * (k + 1), like.sizes[dim]), dims=dim)
    if str(like.name).endswith("_error"):
        return 0.01 * value * xr.ones_like(noise)
    return value * noise


#: Values used for parameters that a study with measured surfaces or materials does not have.
USUAL = {"hurst": 0.7, "rms_roughness": 0.5e-6, "length": 0.02, "shear_modulus": 1e7, "relaxation_time": 1e-3}


def _as_usual(data: xr.Dataset) -> xr.Dataset:
    return data.assign_coords({name: value for name, value in USUAL.items() if name not in data.coords})


def _sliding(data: xr.Dataset, noise: xr.DataArray) -> dict[str, xr.DataArray]:
    """Return friction after the law of planes."""
    data = _as_usual(data)
    slope = 0.01 * (1 + data["hurst"])
    force = laws.force_number(data["normal_force"], data["shear_modulus"], data["rms_roughness"], data["length"])
    velocity = laws.velocity_number(data["velocity"], data["relaxation_time"], slope, data["rms_roughness"])
    law = laws.interpolation(force, velocity, laws.alpha(data["hurst"]), laws.BETA)
    law = law / (1 + (velocity / 300) ** 0.5)  # region IV
    fraction = np.minimum(0.5 * force ** (1 / (1 + data["hurst"])), 1.0)
    return {
        "friction_coefficient": np.sqrt(2) * slope * law * noise,
        "rms_slope": slope * xr.ones_like(noise),
        "contact_fraction": fraction * noise,
        "contact_slope": slope * (1 - 0.1 * fraction) * noise,
    }


def _jumps(data: xr.Dataset, noise: xr.DataArray) -> dict[str, xr.DataArray]:
    """Return friction that jumps and relaxes after the laws of the thesis."""
    data = _as_usual(data)
    slope = 0.01 * (1 + data["hurst"])
    force = laws.force_number(data["normal_force"], data["shear_modulus"], data["rms_roughness"], data["length"])
    velocity = laws.velocity_number(data["velocity"], data["relaxation_time"], slope, data["rms_roughness"])
    before = np.sqrt(2) * laws.interpolation(force, velocity, laws.alpha(data["hurst"]), laws.BETA)
    jump = data["velocity_change"] * (before**-2.0 + 0.4**-2.0) ** -0.5
    after = before * (1 + 0.4 * data["velocity_change"] / (1 + before**2))
    passing = data["velocity"] * data["relaxation_time"] * np.pi * data["points"] / data["length"]
    rate = xr.where(passing < 1, passing, passing ** (1 - data["hurst"]))
    trace = after + (before + jump - after) * np.exp(-rate * data["relaxation_times"])
    scaled = {
        "friction_coefficient_before": before,
        "friction_coefficient_jump": jump,
        "friction_coefficient_after": after,
        "friction_coefficient": trace,
    }
    found = {name: slope * value * noise for name, value in scaled.items()}
    return found | {"rms_slope": slope * xr.ones_like(noise)}


#: Models with numbers that follow from the parameters; those of other models only rise along every dimension.
PLANTED = {"sliding_friction": _sliding, "velocity_jump": _jumps}
