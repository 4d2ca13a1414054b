"""On record: which values an adaptive axis asks for round by round, and which cases a constant wants more lines of."""

from __future__ import annotations

import curves
import numpy as np
import pandas as pd
import planted
import record
import rows
import xarray as xr

from mdr_dask import bootstrap
from mdr_dask.campaign import Tolerance, loads
from mdr_dask.errors import CampaignError, DataError, FitError
from mdr_dask.fits import answers
from mdr_dask.fits.base import Fit
from mdr_dask.fits.master_curve import friction_of_roughness, master_curve, rereferenced
from mdr_dask.refinement import Mean, Stage, refined

AXIS = "{adaptive: [1 mm, 1 km], until: {y: {relative: 1 %, absolute: 0.002}}, at_most: 23}"
CAMPAIGNS = {
    "curves of three places": f"{{x: {AXIS}, shift: [-1.5, 0.3, 1.7]}}",
    "a jump beside a curve": f"{{x: {AXIS}, shape: [jump, smooth], shift: -0.7}}",
    "tops": f"{{x: {AXIS}, shape: bump, shift: [-2.2, -0.4]}}".replace("relative: 1 %", "relative: 5 %"),
    "whole numbers": "{x: 3 m, shift: [0.1, 0.9], count: {adaptive: [1, 19], until: 0.2 %, at_most: 40}}",
    "two axes": f"{{shift: {{adaptive: [-0.8, 2.1], until: 3 %, at_most: 12}}, x: {AXIS}}}",
}


def results(stage, lines: int, noise: float):
    """Return results of a stage as a run would find them, some of them lost."""
    (mesh,) = stage.meshes
    axes = {axis.name: np.array(axis.values, dtype=object) for axis in mesh.series.axes}
    grid = dict(zip(axes, np.meshgrid(*axes.values(), indexing="ij"), strict=True))
    usual = {"x": 3.0, "shift": 0.3, "shape": "smooth", "count": 1}
    fixed = usual | {name: getattr(mesh.series.parameters, name) for name in usual if name not in axes}
    columns = {name: np.broadcast_to(grid.get(name, value), mesh.cases.shape) for name, value in fixed.items()}
    values = np.empty((*mesh.cases.shape, lines))
    for place in np.ndindex(mesh.cases.shape):
        x, shift, shape, count = (columns[name][place] for name in ("x", "shift", "shape", "count"))
        scatter = noise * np.sin(np.arange(1, lines + 1) * (7 + 3 * np.log(x) + shift))
        values[place] = curves.FUNCTIONS[shape](np.float64(x), shift) / count + scatter
    done = np.broadcast_to(mesh.cases[..., None], values.shape).copy()
    if noise:
        done.reshape(-1, lines)[7] = done.reshape(-1, lines)[4, 1:] = False
    return Mean.of(values, done, 1e-3 * np.abs(values) + 1e-4)


def test_rounds_of_values_are_on_record(monkeypatch, dataframe_regression):
    curves.register(monkeypatch)
    found: dict[str, object] = {}
    for scene, parameters in CAMPAIGNS.items():
        campaign = loads(f"name: c\nmodel: curves\nparameters: {parameters}\n", "c.yaml", ".")
        for lines, noise in ((1, 0.0), (23, 0.02)):
            stage, number = Stage.first(campaign), 0
            while stage is not None and number < 9:
                means = {"y": results(stage, lines, noise)}
                (mesh,) = stage.meshes
                found[f"{scene} {noise} {number}: cases"] = np.array(
                    [mesh.cases.sum(), stage.new[0].sum()], dtype=float
                )
                found[f"{scene} {noise} {number}: mean"] = [np.nansum(means["y"].groups), means["y"].error.sum()]
                more, short = refined(mesh, means)
                stage, number = stage.after((more,)), number + 1
            shares = [share for k in more.shares for share in more.shares[k]]
            values = [value for axis in more.series.axes if axis.refinement for value in axis.values]
            found[f"{scene} {noise}: values"] = np.array([*shares, *values], dtype=float)
            found[f"{scene} {noise}: cases"] = more.cases.astype(float)
            found[f"{scene} {noise}: short"] = [f"{name}: {count}" for name, count in short.items()]
    record.check(dataframe_regression, found)


SLIDING = (
    "model: sliding_friction\nparameters:\n  length: 20 mm\n  points: 500\n  rms_roughness: 0.37 um\n"
    "  shear_modulus: 9.1 MPa\n  relaxation_time: 1.3 ms\n  hurst: [0.32, 0.74]\n"
    "  normal_force: [0.8 mN, 2.3 mN, 7 mN, 15 mN]\n  velocity: {geometric: [1 um/s, 1 mm/s, 4]}\n"
)


def scattered(data):
    chance = np.random.default_rng(3)
    data = data.load().copy(deep=True)
    size = xr.DataArray([0.01, 0.06], dims="hurst")
    for name in ("friction_coefficient", "contact_fraction"):
        noise = xr.DataArray(chance.standard_normal(data[name].shape), dims=data[name].dims)
        data[name].values = (data[name] * (1 + size * noise)).transpose(*data[name].dims).values
    data["friction_coefficient"].values[1, 2, 3, :2] = np.nan
    return data


def level(groups):
    """Return the mean friction at the lowest two loads and not the lowest velocity, with an error that stays."""
    (data,) = groups.values()
    part = data.friction_coefficient.isel(normal_force=[0, 1], velocity=[1, 2, 3])
    stack = bootstrap.means(part.transpose("realisation", "hurst", ...).values).mean(axis=(2, 3))
    stack = np.concatenate([stack, bootstrap.moved(stack[0], 0.4 * stack[0])])
    low, high = bootstrap.interval(stack, part.sizes["realisation"])
    names = {"level": stack[0], "level_low": low, "level_high": high}
    return xr.Dataset({name: ("hurst", value) for name, value in names.items()}, {"hurst": data.hurst})


def test_cases_behind_a_constant_are_on_record(tmp_path, dataframe_regression):
    groups = {"": scattered(planted.make(tmp_path, SLIDING, realisations=6)[""])}
    found: dict[str, object] = {}
    for apart in (True, False):
        law = Fit("level", ("sliding_friction",), "mean friction", level, apart=apart, constants=("level",))
        ((value, half),) = answers.half_widths(law, "level", groups).values()
        found[f"{apart}: half widths"] = np.stack([value.values, half.values])
        left = answers.without_scatter(law, "level", groups)[""]
        found[f"{apart}: without scatter"] = left.values
        for share in (1.01, 0.98, 0.8, 0.3):
            tolerance = Tolerance(0.0 if apart else float((half / value).min()), share * float(half.max()))
            found[f"{apart} {share}: wide"] = answers.is_wide(value, half, tolerance).astype(float)
            for most in (7, 60)[: 2 * apart]:
                wide = answers.still_wide(law, "level", groups, tolerance, most)[""]
                found[f"{apart} {share} {most}: still"] = wide.values.astype(float)
        behind = answers.cases_behind(law, "level", groups, "", half >= half.max() * (1 - apart / 2))
        found[f"{apart}: behind"] = behind.values.astype(float)
        found[f"{apart}: dims"] = [*behind.dims, str(behind.shape)]
    try:
        answers.half_widths(law, "nothing", groups)
    except FitError as sentence:
        found["nothing"] = str(sentence)
    record.check(dataframe_regression, found)


def test_tolerances_of_constants_are_told_as_they_were(dataframe_regression):
    found = {}
    for answer in ("zone_one.alpha", "zone_one.gamma", "zone_on.alpha"):
        for axis in ("[1 mm/s, 1 m/s]", "{adaptive: [1 mm/s, 1 m/s], until: 1 %}"):
            for beside in ("", "friction_coefficient: 1 %, "):
                text = f"name: c\nrealisations: {{at_least: 10, at_most: 40, until: {{{beside}{answer}: 1 %}}}}\n"
                text += SLIDING.replace("{geometric: [1 um/s, 1 mm/s, 4]}", axis)
                try:
                    answers.require_known(loads(text, "c.yaml", "."))
                except CampaignError as sentence:
                    found[f"{answer} {axis[:9]} {beside}"] = str(sentence)
    record.check(dataframe_regression, found)


def test_whole_master_curves_are_on_record(tmp_path, dataframe_regression):
    text = SLIDING.replace("[0.32, 0.74]", "0.74").replace("  velocity: {geometric: [1 um/s, 1 mm/s, 4]}\n", "")
    text = (
        text.replace("[0.8 mN, 2.3 mN, 7 mN, 15 mN]", "{geometric: [1 mN, 9 N, 7]}")
        + "  velocity: [1 mm/s, 4 mm/s, 20 mm/s, 0.3 m/s, 0.9 m/s]\n"
    )
    data = planted.make(tmp_path, text)[""].load()
    data["friction_coefficient"].values *= 1 + 0.02 * np.sin(np.arange(data.friction_coefficient.size) ** 1.5).reshape(
        data.friction_coefficient.shape
    )
    smooth = data.assign_coords(rms_roughness=0.0).assign(friction_coefficient=0.1 * data.friction_coefficient)
    both = {"smooth": smooth, "rough": data, "later": 2 * data}
    found: dict[str, object] = {"less the smooth one": friction_of_roughness(both).friction_coefficient.values}
    frame = data.friction_coefficient.mean("realisation").to_dataframe().reset_index()
    frame = frame[["normal_force", "velocity", "friction_coefficient"]]
    factors = {20: 1.0, 35: 1.2, 50: 1.3}
    warm = [frame.assign(temperature=t, normal_force=frame.normal_force * f) for t, f in factors.items()]
    two = pd.concat(warm, ignore_index=True)
    two["friction_coefficient"] *= 1 + 0.02 * np.sin(np.arange(len(two)) ** 1.3)
    calls = {
        "forces": lambda: master_curve(data),
        "vertical, drawn": lambda: master_curve(data, vertical=True, reference=3e-3, draws=9),
        "two groups": lambda: master_curve(two, draws=5, vertical=True),
        "temperatures": lambda: master_curve(warm_ones(two), "normal_force", "friction_coefficient", "temperature"),
        "beyond": lambda: master_curve(data, reference=3.0),
        "just beyond": lambda: master_curve(data, reference=0.915),
        "a row lost": lambda: master_curve(frame.mask(np.arange(len(frame))[:, None] == [[3, -1, -1]])),
        "beside": lambda: master_curve(data.expand_dims(hurst=[0.2, 0.3])),
        "moved": lambda: rereferenced(master_curve(data, draws=6), 5e-3),
        "moved, of two": lambda: rereferenced(master_curve(two, vertical=True), 3e-3),
    }
    for scene, call in calls.items():
        try:
            curve = call()
        except (DataError, FitError) as sentence:
            found[scene] = str(sentence)
            continue
        kept = rows.of_dataset(scene, curve, told=scene in ("vertical, drawn", "two groups"))
        found |= {name: value for name, value in kept.items() if "covariance" not in name}
        numbers = {key: value for key, value in curve.attrs.items() if isinstance(value, float)}
        found[f"{scene}: numbers"] = np.array([*numbers.values()])
        found[f"{scene}: attributes"] = [f"{key}={value}" for key, value in curve.attrs.items() if key not in numbers]
        ends = curve.curve_abscissa.attrs
        found[f"{scene}: measured"] = np.array([ends["measured_low"], ends["measured_high"]])
    record.check(dataframe_regression, found)


def warm_ones(frame):
    """Return curves of one velocity."""
    return frame[frame.velocity == frame.velocity.iloc[0]].drop(columns="velocity")
