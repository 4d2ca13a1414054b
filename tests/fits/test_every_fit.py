"""Every fit of every model on every kind of study gives constants, or one sentence with the reason."""

from __future__ import annotations

import contextlib
import re

import numpy as np
import planted
import pytest

from mdr_dask import fits
from mdr_dask.errors import DataError, FitError

SLIDING = "model: sliding_friction\nparameters:\n  normal_force: {geometric: [10 mN, 10 N, 4]}\n"
JUMP = "model: velocity_jump\nparameters:\n  normal_force: 1 N\n"
ROLLERS = "model: mixed_lubrication\nparameters:\n  points: 100000\n  normal_force: 200 N\n  temperature: 60 degC\n"
FILM = "model: ehl_line\nparameters:\n  material_parameter: 5000\n  load_parameter: 2e-5\n"
WEAR = "model: fretting_wear\nparameters:\n  points: 21\n  stick_radius: 0.5\n"
SPEEDS = "  velocity: {geometric: [0.01 mm/s, 10 m/s, 7]}\n"
TWO_SPEEDS = "  velocity: [1 m/s, 2 m/s]\n"
KELVIN = "  shear_modulus: 10 MPa\n  relaxation_time: 1 ms\n"
PRONY = "  material: {prony: {static_modulus: 1 MPa, moduli: [1 MPa], times: [1 ms]}}\n"
DMA = (
    "  material:\n    dma_table: {file: dma.csv, table_temperature: 298 K, poisson_ratio: 0.5}\n"
    "    temperature: [290 K, 310 K]\n    wlf: {c1: 10, c2: 100 K, reference: 298 K}\n"
)
LENGTH = "  length: 20 mm\n  points: 500\n"
ROUGH = f"{LENGTH}  rms_roughness: 0.5 um\n"
SPECTRUM = f"{LENGTH}  surface: {{spectrum: road.csv}}\n"
MAP = f"{LENGTH}  surface: {{map: {{files: [road.npy], spacing: 2 um, unit: um}}}}\n"
SCAN = f"{LENGTH}  surface: {{scan: line.csv}}\n"
PROFILE = "  surface: {profile: line.csv}\n"
CONE = "  indenter: {shape: cone, angle: 10 deg}\n"
RIG = "  velocity: 1 m/s\n  shear_modulus: 10 MPa\n  relaxation_time: {geometric: [0.1 ms, 10 ms, 4]}\n"
MEASURED = "measured: {table: rig.csv}\n"

OF_SLOPE = {"plateau", "master_curve"}
OF_LINE = {"collapse", "contact_slope", "interpolation"}
OF_JUMPS = {"kinetics", "jump_law"}
OF_RATES = {"relaxation", "rate_power"}

#: Campaign, options of its planted store, and the fits that succeed.
STUDIES: dict[str, tuple[str, dict[str, object], set[str]]] = {
    "spectrum": (SLIDING + SPECTRUM + KELVIN + SPEEDS, {}, OF_SLOPE),
    "map": (SLIDING + MAP + KELVIN + SPEEDS, {}, OF_SLOPE),
    "scan, some cases failed": (SLIDING + SCAN + KELVIN + SPEEDS, {"failed": True}, OF_SLOPE),
    "profile": (SLIDING + PROFILE + KELVIN + SPEEDS, {}, OF_SLOPE),
    "two surfaces": (
        SLIDING + LENGTH + "  surface: [{spectrum: road.csv}, {scan: line.csv}]\n" + KELVIN + SPEEDS,
        {},
        {"plateau"},
    ),
    "spectrum, no slope": (
        SLIDING + SPECTRUM + KELVIN + SPEEDS + "outputs: [friction_coefficient]\n",
        {},
        {"master_curve"},
    ),
    "spectrum, one realisation": (SLIDING + SPECTRUM + KELVIN + SPEEDS, {"realisations": 1}, OF_SLOPE),
    "spectrum, rough cone": (SLIDING + SPECTRUM + KELVIN + SPEEDS + CONE, {}, OF_SLOPE),
    "spectrum, Prony series": (SLIDING + SPECTRUM + PRONY + SPEEDS, {}, {"master_curve"}),
    "moduli of a table": (SLIDING + ROUGH + DMA + SPEEDS, {}, {"contact_slope"}),
    "smooth and rough cone": (
        SLIDING + LENGTH + "  rms_roughness: [0 m, 1 um]\n" + KELVIN + SPEEDS + CONE,
        {},
        OF_LINE | {"indenter"},
    ),
    "lengths and points": (
        SLIDING + "  length: [10 mm, 20 mm]\n  points: [200, 500]\n  rms_roughness: 0.5 um\n" + KELVIN + SPEEDS,
        {},
        OF_LINE | {"plateau"},
    ),
    "two velocities, no slope": (
        SLIDING + ROUGH + KELVIN + TWO_SPEEDS + "  rolloff_wavelength: 1 mm\noutputs: [friction_coefficient]\n",
        {"realisations": 1},
        {"master_curve"},
    ),
    "adaptive": (
        SLIDING + ROUGH + KELVIN + "  velocity: {adaptive: [0.01 mm/s, 10 m/s], until: 1 %}\n",
        {},
        OF_LINE | OF_SLOPE,
    ),
    "calibration on a surface": (SLIDING + SPECTRUM + RIG + MEASURED, {}, {"calibration", "plateau"}),
    "jumps on a spectrum": (JUMP + SPECTRUM + KELVIN + SPEEDS, {}, OF_JUMPS | {"relaxation"}),
    "jumps on a profile": (JUMP + PROFILE + KELVIN + SPEEDS, {}, OF_JUMPS),
    "jumps of three sizes on a scan": (
        JUMP + SCAN + KELVIN + TWO_SPEEDS + "  velocity_change: [0.1, 0.2, 0.5]\n",
        {"failed": True},
        {"kinetics", "jump_law", "relaxation"},
    ),
    "jumps of a Prony series": (JUMP + ROUGH + PRONY + SPEEDS, {}, OF_JUMPS),
    "jumps": (JUMP + ROUGH + KELVIN + SPEEDS, {}, OF_JUMPS | OF_RATES),
    "ramps": (JUMP + ROUGH + KELVIN + SPEEDS + "  protocol: {shape: ramp, duration: 1}\n", {}, set()),
    "rollers": (ROLLERS + "  rms_roughness: 0.2 um\n  rotation_speed: [50 rpm, 100 rpm]\n", {}, set()),
    "film": (FILM + "  speed_parameter: {geometric: [1e-12, 1e-10, 5]}\n", {}, {"film_exponents"}),
    "one film": (FILM + "  speed_parameter: 1e-11\n", {}, set()),
    "wear": (WEAR + "  cycles: [1, 2]\n", {"failed": True}, set()),
}


#: Studies of the default run: at least one of every model, and of every kind of surface, material and history.
QUICK = {"spectrum", "moduli of a table", "smooth and rough cone", "calibration on a surface", "jumps on a spectrum"}
QUICK |= {"jumps of three sizes on a scan", "jumps", "ramps", "film", "one film", "rollers", "wear"}


@pytest.mark.parametrize("study", [pytest.param(s, marks=[pytest.mark.slow] * (s not in QUICK)) for s in STUDIES])
def test_every_fit_gives_constants_or_the_reason(study, tmp_path):
    text, special, holds = STUDIES[study]
    planted.make_tables(tmp_path)
    groups = planted.make(tmp_path, text, **{"realisations": 3, **special})
    found, refused = set(), []
    for name, law in fits.available(re.findall(r"model: (\w+)", text)[0]).items():
        try:
            results = law.results(groups)
        except (DataError, FitError) as sentence:
            refused.append(sentence)
            continue
        assert all("law_holds" in result for result in results.values())
        found.add(name)
    assert found == holds
    assert all(sentence.__cause__ is None for sentence in refused), "an internal error of a fit"
    assert all(re.fullmatch(r"[^\n]{20,400}", str(sentence)) for sentence in refused)


ODD = {
    "errors larger than values": lambda value, error: (value, 1.5 * abs(value)),
    "errors unknown": lambda value, error: (value, np.inf * error),
    "no errors": lambda value, error: (value, np.nan * error),
    "nothing": lambda value, error: (0 * value, error),
    "nothing in the first case": lambda value, error: (
        value.where(np.arange(value.size).reshape(value.shape) >= value.sizes["realisation"], 0.0),
        error,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("odd", ODD)
@pytest.mark.parametrize("study", ["jumps", "jumps of three sizes on a scan", "spectrum"])
def test_fits_accept_unusual_numbers_without_a_warning(study, odd, tmp_path):
    """They give constants with wide intervals, constants without intervals, or one sentence."""
    text, special, _ = STUDIES[study]
    planted.make_tables(tmp_path)
    groups = {
        name: data.load() for name, data in planted.make(tmp_path, text, **{"realisations": 3, **special}).items()
    }
    for data in groups.values():
        for name in [str(name) for name in data if f"{name}_error" in data]:
            data[name].values, data[f"{name}_error"].values = ODD[odd](data[name], data[f"{name}_error"])
    for law in fits.available(re.findall(r"model: (\w+)", text)[0]).values():
        with contextlib.suppress(DataError, FitError):
            assert all("law_holds" in result for result in law.results(groups).values())


def test_the_plateau_of_a_measured_surface_is_the_one_of_its_numbers(tmp_path):
    planted.make_tables(tmp_path)
    groups = planted.make(tmp_path, SLIDING + SPECTRUM + KELVIN + SPEEDS)
    measured = fits.available("sliding_friction")["plateau"].results(groups)[""]
    generated = {"": groups[""].assign_coords(planted.USUAL)}
    other = fits.available("sliding_friction")["plateau"].results(generated)[""]
    np.testing.assert_allclose(measured["plateau"], other["plateau"], rtol=1e-12)
    assert "v tau" in str(measured["reached"].values.flat[0])
