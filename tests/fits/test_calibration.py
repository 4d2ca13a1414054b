"""Calibration: coverage of the intervals of the unknowns, and unknowns that the data do not determine."""

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import mdr_dask
from mdr_dask.campaign.measured import Measured
from mdr_dask.cli import main
from mdr_dask.errors import DataError, FitError
from mdr_dask.fits import available
from mdr_dask.fits.calibration import calibrate, calibration, summary

AXES = {
    "normal_force": (np.geomspace(0.1, 10, 5), "N"),
    "velocity": (np.geomspace(1e-3, 1, 9), "m/s"),
    "relaxation_time": (np.geomspace(1e-4, 1e-2, 7), "s"),
    "rms_roughness": (np.geomspace(1e-7, 1e-5, 7), "m"),
}
TRUE = {"relaxation_time": 7e-4, "rms_roughness": 1.3e-6}


def friction(force, velocity, time, height):
    """Return friction in proportion to the root of the height, with two regimes of the velocity."""
    reduced = (force / 4 + force**0.4) / (1e4 * velocity * time)
    return 0.3 * np.sqrt(height / 1e-6) / np.sqrt(1 + reduced**2)


def slow(force, velocity, time, height):
    """Return friction as in region I, which depends on relaxation time and height only by tau h^2."""
    return 2e9 * velocity * time * (height / 1e-3) ** 2 / force


def study(lines=1, scatter=0.0, seed=0, function=friction):
    """Return a study in which the friction of each line has its own level and slope, the same in all cases."""
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lines", "scatter", "given", "tables"), [(1, 0.0, True, 60), (5, 0.1, True, 60), (1, 0.0, False, 12)]
)
def test_intervals_contain_the_truth_at_their_rate(lines, scatter, given, tables):
    """Every table has its own lines. By chance, the test fails at most once in a thousand times."""
    rng = np.random.default_rng(2)
    held = {0.95: [], 0.6827: []}
    for k in range(tables):
        found = summary(calibrate(study(lines, scatter, k), table(rng, given=given)))
        for name, true in TRUE.items():
            held[0.95].append(found[f"{name}_low"] < true < found[f"{name}_high"])
            held[0.6827].append(found[f"{name}_low_68"] < true < found[f"{name}_high_68"])
    for level, hits in held.items():
        # the errors of the two unknowns of a table are correlated, so that only the tables count
        assert abs(np.mean(hits) - level) < 3.3 * np.sqrt(level * (1 - level) / tables)


@pytest.mark.parametrize(("given", "tables"), [(True, 5), (False, 1)])
def test_only_what_the_data_determine_has_a_number(given, tables):
    """In region I, the data determine only the product tau h^2, as exactly as the measured points."""
    rng = np.random.default_rng(5)
    held = 0
    for _ in range(tables):
        found = summary(calibrate(study(function=slow), table(rng, given=given, function=slow)))
        for name in TRUE:
            assert all(np.isnan(found[name + end]) for end in ("", "_low", "_high", "_low_68", "_high_68"))
        product = "relaxation_time x rms_roughness^2"
        true = TRUE["relaxation_time"] * TRUE["rms_roughness"] ** 2
        assert found[product].attrs["units"] == "s m^2"
        held += bool(found[f"{product}_low"] < true < found[f"{product}_high"])
        # 3 % at each of twelve points: the interval is four standard errors wide, and twice this width is allowed
        assert float(found[f"{product}_high"] / found[f"{product}_low"]) < 1 + 4 * 0.03 / np.sqrt(12) * 2
        assert not any(name.startswith("correlation") for name in found)
        assert "only relaxation_time x rms_roughness^2" in found["determined"].item()
        assert "no number is given for relaxation_time and rms_roughness" in found["determined"].item()
    assert held >= tables - 1


def test_an_unknown_may_be_bounded_from_one_side_only():
    """On the plateau of fast sliding, friction does not depend on the relaxation time."""
    data = study().isel(rms_roughness=3, drop=True)
    force, velocity = np.full(10, 0.1), np.geomspace(0.1, 1, 10)
    exact = friction(force, velocity, 8e-3, 1e-6)
    measured = Measured(
        "rig.csv", "mu", exact, 0.03 * exact, {"normal_force": force, "velocity": velocity}, tuple(range(10))
    )
    found = summary(calibrate(data, measured))
    assert np.isnan(found["relaxation_time"])
    assert 1e-4 < float(found["relaxation_time_low"]) < 8e-3
    assert np.isinf(found["relaxation_time_high"])
    assert "bounded from below" in found["determined"].item()


@pytest.mark.parametrize("lines", [1, 5])
def test_an_axis_of_one_value_is_no_unknown_and_changes_nothing(lines):
    """This holds for a condition and for an unknown, with one realisation and with several."""
    rng = np.random.default_rng(4)
    data, measured = study(lines, 0.1), table(rng, velocities=(0.1, 0.1))
    with_axes = data.isel(rms_roughness=[3]).sel(velocity=[AXES["velocity"][0][5]])
    measured.conditions["velocity"][:] = with_axes["velocity"].item()
    found = [summary(calibrate(one, measured)) for one in (with_axes, with_axes.squeeze(["velocity", "rms_roughness"]))]
    xr.testing.assert_identical(*(one.drop_vars(["velocity", "rms_roughness"], errors="ignore") for one in found))
    assert found[0]["relaxation_time_low"] < found[0]["relaxation_time_high"]


def test_a_misfit_is_reported_and_widens_the_interval():
    rng = np.random.default_rng(3)
    right = table(rng)
    wrong = right.__class__(**{**vars(right), "values": right.values * (1 + 0.3 * np.sin(9 * right.values / 0.3))})
    found = [summary(calibrate(study(), each)) for each in (right, wrong)]
    assert [one["law_holds"].item()[:3] for one in found] == ["yes", "no:"]
    widths = [float(np.log(one["rms_roughness_high"] / one["rms_roughness_low"])) for one in found]
    assert widths[1] > 2 * widths[0]
    assert found[0]["determined"].item() == "every unknown is determined"
    assert found[1]["determined"].item().startswith("the model does not explain the measured points")


TOY = """
name: rig
model: toy
realisations: 6
parameters:
  slope: {linear: [1, 3, 6]}
  position: {linear: [0.5 m, 3 m, 5]}
  noise: 0.05
measured: {table: rig.csv}
"""
MADE = "position [m],height [m]\n" + "".join(
    f"{x},{2 * x * (1 + e):.4f}\n"
    for x, e in zip((0.6, 1.1, 1.7, 2.2, 2.8), (0.02, -0.03, 0.01, 0.03, -0.02), strict=True)
)
RIG = "normal_force [N], velocity [m/s], mu, standard_error\n1, 0.01, 0.05, 0.001\n1, 0.1, 0.09, 0.001\n"


@pytest.mark.parametrize(
    ("text", "change", "message"),
    [
        (RIG.replace("mu", "wear_volume [m^3]"), {}, r"expected a column with one output of the study \(mu\)"),
        (RIG.replace("velocity [m/s]", "velocty [m/s]"), {}, "unknown column 'velocty'"),
        (RIG.replace(" [N]", ""), {}, "column normal_force: expected its unit"),
        (RIG.replace("1, 0.1, 0.09, 0.001\n", ""), {}, "expected at least two measured points, got 1"),
        (RIG.replace("1, 0.1,", "1, 30,"), {}, r"rig.csv:3: velocity is 30 m/s, but this study has 1 mm/s to 1 m/s"),
        (RIG, {"relaxation_time": slice(3)}, "expected at least 4 values of the unknown relaxation_time, got 3"),
        (RIG, {"velocity": slice(3)}, "but this study has"),
        (RIG, {"relaxation_time": 0, "rms_roughness": 0}, "expected one to four axes of the study .*, got none"),
        (RIG.replace("0.09, 0.001", "0.09, 0"), {}, "rig.csv: the fit needs standard errors above 0"),
        (RIG.replace(", standard_error", "").replace(", 0.001", ""), {}, "expected more than 2 measured points for 2"),
    ],
)
def test_bad_input_is_refused_with_its_reason(text, change, message):
    data = study().isel(change).assign_attrs(measured={"name": "rig.csv", "text": text})
    with pytest.raises((DataError, FitError), match=message):
        calibration({"": data})


def test_points_belong_to_the_nearest_value_of_a_condition_with_few_values():
    rows = "".join(f"{force}, {v}, 0.1, 0.01\n" for force in (0.997, 1.004) for v in (0.000995, 0.00238))
    text = f"{RIG.splitlines()[0]}, Streuung\n{rows}".replace("0.1, 0.01\n", "0.1, 0.01, 0.02\n")
    data = study().isel(normal_force=2, velocity=[0, 1]).assign_attrs(measured={"name": "rig.csv", "text": text})
    found = calibration({"": data})["measured"].item()
    assert "4 of 4 points differ in normal_force by up to 0.4 %" in found
    assert "4 of 4 points differ in velocity by up to 0.5 %" in found
    assert "not used: Streuung" in found


def test_a_study_without_a_table_half_filled_or_sampled_is_refused():
    with pytest.raises(FitError, match=r"expected a table of measurements: give measured: \{table: rig.csv\}"):
        calibration({"": study()})
    table_ = {"name": "rig.csv", "text": RIG}
    half = study().where(study()["relaxation_time"] < 1e-3).assign_attrs(measured=table_)
    with pytest.raises(FitError, match=r"mu: \d+ of the \d+ values .* rig.csv are missing"):
        calibration({"": half})
    sampled = study().stack(case=[*AXES]).reset_index("case").assign_attrs(measured=table_)
    with pytest.raises(FitError, match="expected a grid"):
        calibration({"": sampled})


def test_calibration_of_an_external_model_from_python_and_the_command_line(toy, tmp_path, capsys):
    """A study of an external model, with the table of its campaign and with another table, as JSON and figure."""
    assert "calibration" in available("toy")
    campaign = tmp_path / "rig.yaml"
    campaign.write_text(TOY)
    (tmp_path / "rig.csv").write_text(MADE)
    url = str(tmp_path / "rig.zarr")
    assert main(["run", str(campaign), "--store", url, "--quiet"]) == 0
    capsys.readouterr()
    assert main(["fit", url, "calibration", "--json", "-o", str(tmp_path / "figure.png")]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert (tmp_path / "figure.png").stat().st_size > 10_000
    (tmp_path / "figure.csv").unlink()
    (tmp_path / "figure.csv").write_text(MADE)
    assert main(["fit", url, "calibration", "-o", str(tmp_path / "figure.png")]) == 2
    assert (tmp_path / "figure.csv").read_text() == MADE
    assert row["determined"] == "every unknown is determined"
    assert row["slope_low"] < 2 < row["slope_high"]
    again = mdr_dask.fit(url, "calibration", measured=pd.read_csv(tmp_path / "rig.csv"))
    assert float(again["slope"]) == row["slope"]


@pytest.mark.parametrize("given", [True, False])
def test_an_unknown_error_of_measurement_is_estimated(given):
    found = summary(calibrate(study(), table(np.random.default_rng(8), points=40, given=given)))
    estimated = {name for name in found if "measurement_error" in str(name)}
    assert len(estimated) == (not given)
    if not given:  # the planted errors are proportional to the values; forty residuals determine their size to 12 %
        assert found["relative_measurement_error"].item() == pytest.approx(0.03, rel=0.35)
