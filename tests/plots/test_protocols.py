"""The figure of protocols, drawn from Datasets made by hand: every curve stands for what is in the data."""

import json

import numpy as np
import pytest
import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.plots import available
from mdr_dask.plots.protocols import draw_protocols
from mdr_dask.plots.style import left_out

TIMES = np.array([0.0, 1.0, 2.0, 4.0])
BASE = {
    "length": 0.002,
    "rms_roughness": 2e-6,
    "shear_modulus": 1e7,
    "relaxation_time": 1e-3,
    "normal_force": 0.1,
    "velocity": 0.05,
    "relaxation_times": list(TIMES),
}


def dataset(protocol: dict[str, object], axes: tuple[dict[str, object], ...] = (), **changes: object) -> xr.Dataset:
    generator = np.random.default_rng(1)
    lines = 1 + 0.1 * generator.random((3, TIMES.size))
    outputs = {
        "friction_coefficient": (("realisation", "relaxation_times"), lines),
        "rms_slope": (("realisation",), np.full(3, 0.5)),
    }
    for name in ("before", "jump", "after"):
        outputs[f"friction_coefficient_{name}"] = (("realisation",), generator.random(3))
    parameters = json.dumps(BASE | {"protocol": protocol} | changes)
    return xr.Dataset(outputs, {"relaxation_times": TIMES}, {"parameters": parameters, "axes": list(axes)})


def curves(figure: object, column: int, columns: int) -> list[np.ndarray]:
    panels = figure.axes[column::columns]
    return [np.array(panel.get_lines()[0].get_xydata()) for panel in panels]


def test_one_column_a_series_with_friction_velocity_and_load() -> None:
    steps = {"shape": "steps", "times": [0.0, 2e-3], "velocities": [0.1, 0.05], "forces": [0.2, 0.3]}
    swing = {"shape": "oscillation", "amplitude": 0.02, "frequency": 250.0}
    data = {"one": dataset(steps), "two": dataset(swing)}
    figure = draw_protocols(data)
    labels = [panel.get_ylabel() for panel in figure.axes[::2]]
    assert [label.split(" [")[0] for label in labels] == [r"$\mu$ / rms slope", "velocity $v$", "normal force $F_N$"]
    friction, velocity, load = curves(figure, 0, 2)
    wanted = (data["one"]["friction_coefficient"] / 0.5).mean("realisation").values
    assert np.allclose(friction[3:, 1], wanted)
    assert np.allclose(friction[3:, 0], TIMES)
    late = velocity[velocity[:, 0] > 2, 1], load[load[:, 0] > 2, 1]
    assert np.allclose(late[0], 0.05)
    assert np.allclose(late[1], 0.3)
    assert velocity[0, 1] == 0.05
    for panel, curve in zip(figure.axes[::2], (friction, velocity, load), strict=True):
        assert panel.get_xlim() == pytest.approx((-0.08 * 4, 4))  # a little of the steady state, and all of the rest
        assert curve[[0, -1], 0] == pytest.approx((-0.08 * 4, 4))
        assert np.all(np.diff(curve[:, 0]) >= 0)
    _, velocity, _ = curves(figure, 1, 2)
    assert velocity[:, 1].max() == pytest.approx(0.07, rel=1e-4)  # 400 points a curve


def test_every_value_of_an_axis_has_its_curves_in_one_colour() -> None:
    axis = {"path": "protocol.velocity", "name": "v", "dim": "v", "values": [0.2, 0.3], "labels": None}
    ramp = {"shape": "ramp", "duration": 4e-3, "velocity": None}
    data = xr.concat([dataset(ramp, (axis,)), 2 * dataset(ramp, (axis,))], xr.Variable("v", [0.2, 0.3]))
    figure = draw_protocols({"": data.assign(rms_slope=data["rms_slope"][0])})
    assert left_out(figure) == ""
    friction, velocity, _ = ([line for line in axes.lines if line.get_linestyle() == "-"] for axes in figure.axes)
    assert [line.get_ydata()[-1] for line in velocity] == pytest.approx([0.2, 0.3])
    assert friction[1].get_ydata()[-1] == pytest.approx(2 * friction[0].get_ydata()[-1])
    assert [line.get_color() for line in friction] == [line.get_color() for line in velocity]


def test_missing_outputs_are_named() -> None:
    data = dataset({"shape": "jump"}).drop_vars("friction_coefficient_before")
    with pytest.raises(DataError, match="no series of the store holds friction_coefficient_before"):
        draw_protocols({"": data})


def test_it_is_registered() -> None:
    assert "protocols" in available("velocity_jump")


def test_laws_of_a_jump_are_not_drawn_for_other_histories() -> None:
    steps = {"shape": "steps", "times": [0.0, 2e-3], "velocities": [0.1, 0.05], "forces": [0.2, 0.3]}
    figures = available("velocity_jump")
    for name in sorted(set(figures) - {"protocols", "calibration"}):
        with pytest.raises(DataError, match="expected a series with a jump of the velocity, got other histories"):
            figures[name].figure({"": dataset(steps)})
