"""On record: what measured points say of unknowns, laws as tables, shares of variance and velocity steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import record
import rows
import xarray as xr

from mdr_dask.campaign.measured import Measured
from mdr_dask.errors import DataError, FitError
from mdr_dask.fits import calibration, interpolant, sensitivity, velocity_steps
from mdr_dask.models.base import Status

AXES = {
    "force": (np.geomspace(0.13, 9.0, 5), "N"),
    "velocity": (np.array([1e-3, 4e-3, 2e-2, 0.1, 0.3, 1.1]), "m/s"),
    "time": (np.geomspace(1.1e-4, 1.3e-2, 6), "s"),
    "height": (np.linspace(0.2e-6, 4e-6, 5), "m"),
}


def slow(force, velocity, time, height):
    return 2e9 * velocity * time * (height / 1e-3) ** 2 / force


def curved(force, velocity, time, height):
    return 0.3 * np.sqrt(height / 1e-6) / np.sqrt(1 + ((force / 4 + force**0.4) / (1e4 * velocity * time)) ** 2)


def level(force, velocity, time, height):
    """Friction of which no power of the unknowns is known."""
    return 0.3 + 0 * curved(force, velocity, time, height)


def bounded(force, velocity, time, height):
    return 0.4 * (1 - np.exp(-3e3 * time)) * force**0.1 * (velocity + height / height) ** 0.1


def study(function, lines=4, errors=True):
    """Return a study whose lines differ in level and tilt, with errors of the grid and a few results lost."""
    chance = np.random.default_rng(3)
    grid = np.meshgrid(*(values for values, _ in AXES.values()), indexing="ij")
    tilt = 0.04 * chance.standard_normal((2, lines))
    values = function(*grid)[..., None] * (1 + tilt[0] + tilt[1] * np.log10(grid[1])[..., None])
    values = values * (1 + 0.003 * chance.standard_normal(values.shape))
    values[0, 1, 2, 3, 1:2] = values[4, 5, :2, 1, :1] = np.nan
    dims, coords = (*AXES, "realisation"), {name: (name, axis, {"units": unit}) for name, (axis, unit) in AXES.items()}
    data = xr.Dataset({"mu": (dims, values, {"units": "1", "ancillary_variables": "mu_error"})}, coords)
    error = 0.006 * np.abs(values) * chance.uniform(0.3, 1, values.shape)
    return data.assign(mu_error=(dims, error)) if errors else data


def points(function, columns=("force", "velocity"), number=9, noise=0.03, given=True, at_values=False):
    chance = np.random.default_rng(8)
    unit = chance.uniform(size=(4, number))
    true = {"time": 9e-4, "height": 1.7e-6, "force": 1.1, "velocity": 0.05}
    found = {}
    for (name, (axis, _)), place in zip(AXES.items(), unit, strict=True):
        found[name] = axis[0] * (axis[-1] / axis[0]) ** place if name in columns else np.full(number, true[name])
        if at_values and name in columns:
            found[name] = axis[(place * axis.size).astype(int)]
    exact = function(*found.values())
    values = exact * (1 + noise * chance.standard_normal(number))
    conditions = {name: found[name] for name in columns}
    return Measured("rig.csv", "mu", values, noise * exact if given else None, conditions, tuple(range(2, number + 2)))


THREE = ("force", "velocity", "height")
CALIBRATIONS = {
    "two unknowns": lambda: (study(curved), points(curved)),
    "errors unknown": lambda: (study(curved), points(curved, given=False)),
    "errors unknown, values below 0": lambda: (
        study(lambda *of: curved(*of) - 0.1),
        points(lambda *of: curved(*of) - 0.1, given=False),
    ),
    "errors unknown, a value of 0": lambda: (study(curved), _with_nothing(points(curved, given=False))),
    "errors much too small": lambda: (study(curved), replace(points(curved), errors=1e-4 * points(curved).values)),
    "one unknown, at values computed": lambda: (study(curved, lines=1), points(curved, THREE, at_values=True)),
    "one unknown, of another form": lambda: (study(curved), points(bounded, THREE, given=False, number=12)),
    "a product alone": lambda: (study(slow, lines=1, errors=False), points(slow, ("velocity", "force"), given=True)),
    "three unknowns": lambda: (study(curved, lines=9).isel(height=[0, 1, 2, 3]), points(curved, ("velocity",))),
    "nothing": lambda: (study(level), points(level)),
    "bounded from one side": lambda: (study(bounded).isel(height=[2]), _at(points(bounded, THREE), "height", 2.1e-6)),
    "few points": lambda: (study(curved), points(curved, number=3, given=False)),
    "an axis of words": lambda: (study(curved).assign_coords(time=list("abcdef")), points(curved)),
    "lost results": lambda: (study(curved).where(study(curved).time > 2e-4), points(curved)),
}


def _with_nothing(measured):
    return replace(measured, values=np.where(np.arange(measured.values.size) == 4, 0.0, measured.values))


def _at(measured, name, value):
    return replace(measured, conditions=measured.conditions | {name: np.full(measured.values.size, value)})


def test_what_measured_points_say_is_on_record(dataframe_regression):
    found: dict[str, object] = {}
    for scene, make in CALIBRATIONS.items():
        try:
            calibrated = calibration.calibrate(*make())
        except (DataError, FitError) as sentence:
            found[scene] = str(sentence)
            continue
        found |= rows.of_dataset(
            scene, calibration.summary(calibrated), told=scene in ("three unknowns", "errors unknown")
        )
        found[f"{scene}: cells"] = [calibrated.posterior.width, calibrated.posterior.weights.size]
        found[f"{scene}: best"] = calibrated.best
        found[f"{scene}: noise"] = np.append(calibrated.noise[0], calibrated.noise[1])
        found[f"{scene}: sizes"] = np.concatenate([noise.sizes for noise in calibrated.noises])
        found[f"{scene}: ends, free"] = np.array([*np.ravel(calibrated.ends), *calibrated.free], dtype=float)
    record.check(dataframe_regression, found)


def test_laws_as_tables_are_on_record(tmp_path, dataframe_regression):
    whole = study(curved, lines=3)
    scenes = {
        "a law of three axes": whole.isel(force=[2], drop=True).fillna(0.2),
        "of one axis, one line": whole.isel(force=2, height=1, time=3, realisation=[0]),
        "of one axis, no lines": whole.isel(force=2, height=1, time=3).mean("realisation"),
        "that changes its sign": whole.isel(force=2, height=1, time=3) - 0.1,
        "with a short axis": whole.isel(force=1, height=[0, 2, 4], time=3),
        "with words": whole.isel(force=1, height=[0, 2], time=3).assign_coords(height=["low", "high"]),
        "with cases left out": _left_out(whole.isel(force=1, height=2)),
        "with cases lost": whole.isel(force=1, height=2).where(whole.time > 2e-4),
        "of no numbers": whole.isel(force=1, height=[0, 2], time=3, velocity=[0, 3]),
        "sampled": whole.isel(force=1, height=2).stack(case=["time", "velocity"]),
    }
    found: dict[str, object] = {}
    for scene, data in scenes.items():
        try:
            table = interpolant.law(data.assign_attrs(title="of a study", model="toy"), "mu").drop_attrs(deep=False)
        except FitError as sentence:
            found[scene] = str(sentence)
            continue
        found |= rows.of_dataset(scene, table, told=scene.startswith("a law"))
        found |= {f"{scene} {axis}": rows.even(table[axis].values) for axis in table.coords}
        found[f"{scene}: sizes"] = [f"{axis}={size}" for axis, size in table.sizes.items()]
        path = tmp_path / f"{scene}.nc"
        table.to_netcdf(path)
        try:
            law = interpolant.Law(path)
            inside = {axis: values[0] + np.array([0.13, 0.71]) * np.ptp(values) for axis, values in law.axes.items()}
            found[f"{scene}: at places"] = np.array(law(**inside))
            beyond = {axis: values[-1] + np.array([-0.1, 0.2]) * np.ptp(values) for axis, values in law.axes.items()}
            law(**beyond)
        except DataError as sentence:
            found[f"{scene}: refused"] = str(sentence).replace(str(tmp_path), "")
    attributes = interpolant.law(scenes["that changes its sign"].assign_attrs(model="toy"), "mu").attrs
    found["attributes"] = [f"{name}={value}" for name, value in attributes.items() if name != "source"]
    record.check(dataframe_regression, found)


def _left_out(data):
    """Return an adaptive study: of some times some velocities were not needed."""
    needed = np.ones((data.sizes["time"], data.sizes["velocity"], data.sizes["realisation"]), dtype=bool)
    needed[1, [2, 4]] = needed[4, 1] = False
    keep = xr.DataArray(needed, dims=("time", "velocity", "realisation"))
    status = xr.where(keep, Status.DONE.value, Status.NOT_NEEDED.value)
    return data.fillna(0.2).where(keep).assign(status=status)


def test_shares_of_variance_are_on_record(dataframe_regression):
    chance = np.random.default_rng(5)
    found: dict[str, object] = {}
    scenes = {"few": (40, 1, 0.0), "lines": (55, 4, 0.3), "many": (900, 2, 0.1), "too few": (15, 3, 0.1)}
    for scene, (number, lines, noise) in scenes.items():
        x, z = chance.uniform(0.5, 2, number), chance.integers(0, 5, number)
        y = (x**2 + 0.3 * z * x)[:, None] + noise * chance.standard_normal((number, lines))
        y[3] = y[7, :-1] = np.nan
        coords = {"x": ("case", x), "z": ("case", z), "same": ("case", np.ones(number)), "fixed": 3.0}
        found |= _indices(scene, xr.Dataset({"y": (("case", "realisation"), y)}, coords))
    for scene, lost, lines in (
        ("exchanged", [5, 17], 3),
        ("exchanged, one line", [], 1),
        ("too much lost", range(12), 2),
    ):
        a, b = chance.uniform(size=(2, 21, 2))
        cases = np.stack([a, b, np.stack([b[:, 0], a[:, 1]], 1), np.stack([a[:, 0], b[:, 1]], 1)], axis=1).reshape(
            -1, 2
        )
        y = np.exp(cases @ [1.0, 0.4])[:, None] * (1 + 0.05 * chance.standard_normal((len(cases), lines)))
        y[[4 * k + 2 for k in lost]] = np.nan
        coords = {"x": ("case", cases[:, 0]), "z": ("case", cases[:, 1])}
        found |= _indices(scene, xr.Dataset({"y": (("case", "realisation"), y)}, coords))
    record.check(dataframe_regression, found)


def _indices(scene, data):
    try:
        indices = sensitivity.sobol_indices(data, "y")
    except FitError as sentence:
        return {scene: str(sentence)}
    return rows.of_dataset(scene, indices, told=scene == "few") | {f"{scene} inputs": indices.parameter.values}


def test_velocity_steps_are_on_record(dataframe_regression):
    chance = np.random.default_rng(6)
    time = np.cumsum(chance.uniform(0.3, 0.7, 60))
    velocity = np.where((time > 8) & (time < 19), 1.1e-5, 1.3e-6)
    slip = np.cumsum(np.diff(time, prepend=time[0]) * velocity)
    logarithm = np.log(velocity / velocity[0])
    found: dict[str, object] = {}
    lengths = {"short": 3e-7, "middle": 1.2e-5, "long": 3e-4}
    for scene, length in lengths.items():
        state = np.zeros(time.size)
        for k in range(1, time.size):
            state[k] = -logarithm[k] + (state[k - 1] + logarithm[k]) * np.exp(-(slip[k] - slip[k - 1]) / length)
        for scatter, noise in (("white", chance.standard_normal(time.size)), ("waves", np.sin(np.arange(time.size)))):
            friction = 0.61 + 0.012 * logarithm + 0.017 * state + 4e-4 * noise
            text = "time [s],velocity [um/s],mu\n"
            text += "".join(f"{t},{1e6 * v},{f}\n" for t, v, f in zip(time, velocity, friction, strict=True))
            constants = velocity_steps.of_table(text, "steps.csv")
            found |= rows.of_dataset(f"{scene} {scatter}", constants, told=scene == "short")
    for what, wrong in {
        "few": text[: len("time [s],velocity [um/s],mu\n") + 180],
        "back": text + "0.1,1,0.6\n",
        "level": "time [s],velocity [m/s],mu\n" + "".join(f"{k},1,0.6\n" for k in range(8)),
        "headless": "time [s],mu\n1,2\n",
    }.items():
        try:
            velocity_steps.of_table(wrong, "steps.csv")
        except DataError as sentence:
            found[what] = str(sentence)
    record.check(dataframe_regression, found)
