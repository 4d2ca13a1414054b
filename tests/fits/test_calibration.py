"""Unknowns from measured points: planted values are held as often as stated, and what is open is named."""

import json
from time import process_time
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.optimize import minimize

import mdr_dask
from mdr_dask.campaign.measured import Measured
from mdr_dask.cli import main
from mdr_dask.errors import DataError, FitError
from mdr_dask.fits import available
from mdr_dask.fits.calibration import LEAST, _bound, calibrate, calibration, summary
from mdr_dask.fits.identifiability import OPEN, Ends, written
from mdr_dask.fits.posterior import Likelihood, Noise
from mdr_dask.fits.prediction import prediction
from mdr_dask.plots.calibration import BINS, of_whole_cells

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


@pytest.mark.slow
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


@pytest.mark.parametrize(("given", "tables"), [(True, 5), (False, 1)])
def test_only_what_the_data_determine_has_a_number(given, tables):
    """Velocity alone in region I: v tau slope^2 and nothing else; the product is known as well as the points are."""
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
        # 3 % at each of twelve points, twice that within 95 %
        assert float(found[f"{product}_high"] / found[f"{product}_low"]) < 1 + 4 * 0.03 / np.sqrt(12) * 2
        assert not any(name.startswith("correlation") for name in found)
        assert "only relaxation_time x rms_roughness^2" in found["determined"].item()
        assert "no number is given for relaxation_time and rms_roughness" in found["determined"].item()
    assert held >= tables - 1


def test_an_unknown_may_be_bounded_from_one_side_only():
    """On the plateau of fast sliding the relaxation time is long enough, whatever it is."""
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
    """Neither a condition held by the study nor an unknown of one value; lines are lines, however few."""
    rng = np.random.default_rng(4)
    data, measured = study(lines, 0.1), table(rng, velocities=(0.1, 0.1))
    with_axes = data.isel(rms_roughness=[3]).sel(velocity=[AXES["velocity"][0][5]])
    measured.conditions["velocity"][:] = with_axes["velocity"].item()
    found = [summary(calibrate(one, measured)) for one in (with_axes, with_axes.squeeze(["velocity", "rms_roughness"]))]
    xr.testing.assert_identical(*(one.drop_vars(["velocity", "rms_roughness"], errors="ignore") for one in found))
    assert found[0]["relaxation_time_low"] < found[0]["relaxation_time_high"]


def test_errors_that_are_not_given_are_as_large_as_the_best_curve_leaves():
    """Sizes of the errors begin at the least that any curve leaves, found apart by a search over all of them."""
    measured = table(np.random.default_rng(6), noise=0.2, given=False)
    found = calibrate(study(), measured)
    force, velocity = measured.conditions.values()

    def left(logarithms, shares):
        mean = friction(force, velocity, *np.exp(logarithms))
        return np.sqrt(np.mean(((measured.values - mean) / (mean if shares else 1)) ** 2))

    for noise, shares in zip(found.noises, (False, True), strict=True):
        best = minimize(left, np.log([*TRUE.values()]), (shares,), method="Nelder-Mead").fun
        assert noise.sizes[0] == pytest.approx(LEAST * best, rel=0.01)


def test_data_that_the_model_cannot_have_are_told_and_widen_the_interval():
    rng = np.random.default_rng(3)
    right = table(rng)
    wrong = right.__class__(**{**vars(right), "values": right.values * (1 + 0.3 * np.sin(9 * right.values / 0.3))})
    told = [summary(calibrate(study(), each)) for each in (right, wrong)]
    assert [one["law_holds"].item()[:3] for one in told] == ["yes", "no:"]
    widths = [float(np.log(one["rms_roughness_high"] / one["rms_roughness_low"])) for one in told]
    assert widths[1] > 2 * widths[0]
    assert told[0]["determined"].item() == "every unknown is determined"
    assert told[1]["determined"].item().startswith("the model does not explain the measured points")


def test_constants_of_wlf_from_friction_against_velocity_and_temperature():
    """Temperatures in degrees are conditions; both constants are held, and near what the points can tell."""
    temperature, velocity = np.linspace(273.15, 333.15, 5), np.geomspace(1e-3, 1.0, 9)
    axes = {"temperature": (temperature, "K"), "velocity": (velocity, "m/s")}
    axes |= {"c1": (np.geomspace(4, 16, 7), "1"), "c2": (np.geomspace(60.0, 240.0, 7), "K")}

    def law(kelvin, speed, c1, c2):
        shifted = np.log10(speed / 0.03) - c1 * (kelvin - 293.15) / (c2 + kelvin - 293.15)
        return 0.3 / np.cosh(0.6 * shifted)

    grid = np.meshgrid(*(values for values, _ in axes.values()), indexing="ij")
    coords = {name: (name, values, {"units": unit}) for name, (values, unit) in axes.items()}
    data = xr.Dataset({"mu": (tuple(axes), law(*grid), {"units": "1"})}, coords)
    rng = np.random.default_rng(1)
    rows = "".join(
        f"{kelvin - 273.15:.2f},{speed:.6g},{mu * (1 + 0.03 * rng.normal()):.6g},{0.03 * mu:.6g}\n"
        for kelvin in temperature
        for speed in velocity[::2]
        for mu in [law(kelvin, speed, 8.9, 110.0)]
    )
    text = f"temperature [degC],velocity [m/s],mu,standard_error\n{rows}"
    found = calibration({"": data.assign_attrs(measured={"name": "rig.csv", "text": text})})
    for name, true in {"c1": 8.9, "c2": 110.0}.items():
        assert found[f"{name}_low"] < true < found[f"{name}_high"] < 1.2 * found[f"{name}_low"]
    assert found["correlation_c1_c2"] > 0.5


def test_ten_thousand_likelihoods_are_arrays():
    """Vectorised: far below a millisecond each, however slow the machine."""
    measured = table(np.random.default_rng(0), points=30)
    likelihood = Likelihood(prediction(study(20, 0.1), measured), measured.values, [Noise(np.ones(1), measured.errors)])
    places = np.random.default_rng(1).uniform(size=(10_000, 2))
    begin = process_time()
    assert likelihood(places).shape == (10_000, 1)
    assert process_time() - begin < 10


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
        (
            RIG.replace("1, 0.1,", "1, 30,"),
            {},
            r"rig.csv:3: velocity of 30 m/s: this study has it from 0.001 m/s to 1 m/s",
        ),
        (RIG, {"relaxation_time": slice(3)}, "expected at least 4 values of the unknown relaxation_time, got 3"),
        (RIG, {"velocity": slice(3)}, "this study has it from"),
        (RIG, {"relaxation_time": 0, "rms_roughness": 0}, "expected one to 4 unknowns.* got none: every axis is a"),
        (
            RIG.replace(", standard_error", "").replace(", 0.001", ""),
            {},
            "2 measured points without errors cannot determine 2",
        ),
    ],
)
def test_bad_input_is_one_sentence(text, change, message):
    data = study().isel(change).assign_attrs(measured={"name": "rig.csv", "text": text})
    with pytest.raises((DataError, FitError), match=message):
        calibration({"": data})


def test_a_study_without_a_table_half_filled_or_sampled_is_refused():
    with pytest.raises(FitError, match=r"no table of measurements: give measured: \{table: rig.csv\}"):
        calibration({"": study()})
    table_ = {"name": "rig.csv", "text": RIG}
    half = study().where(study()["relaxation_time"] < 1e-3).assign_attrs(measured=table_)
    with pytest.raises(
        FitError, match=r"mu: of the \d+ values that rig.csv is compared with, \d+ are not in the study"
    ):
        calibration({"": half})
    sampled = study().stack(case=[*AXES]).reset_index("case").assign_attrs(measured=table_)
    with pytest.raises(FitError, match="calibration needs a grid"):
        calibration({"": sampled})


def test_every_model_has_calibration_from_python_and_in_a_shell(toy, tmp_path, capsys):
    """A study of a model of one's own, with the table of its campaign and another one, as JSON and as a figure."""
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


def test_parts_of_a_marginal_hold_as_many_cells_each():
    """Cells that are all as likely look level, wherever the range drawn begins and ends."""
    place = np.linspace(0.1, 0.6, 241)
    across = np.log(2e-4) + 7 * place
    for ends in ([across[0], across[-1]], [across[31], across[150]], [across[100], across[101]]):
        edges = of_whole_cells(np.array(ends), across, place, np.diff(place)[0])
        inside = (across > ends[0]) & (across < ends[1])
        assert edges[0] < across[inside].min(initial=ends[1])
        assert edges[-1] > across[inside].max(initial=ends[0])
        counts = np.histogram(across, edges)[0]
        cell = np.diff(across)[0]
        whole = (edges[:-1] > across[0] - cell) & (edges[1:] < across[-1] + cell)
        assert np.ptp(counts[whole]) == 0
        assert len(counts) <= BINS + 2


@pytest.mark.parametrize("given", [True, False])
def test_the_error_of_measurement_is_told_where_it_was_not_given(given):
    found = summary(calibrate(study(), table(np.random.default_rng(8), points=40, given=given)))
    told = {name for name in found if "measurement_error" in str(name)}
    assert len(told) == (not given)
    if not given:  # equal shares were planted; forty residuals tell their size to an eighth
        assert found["relative_measurement_error"].item() == pytest.approx(0.03, rel=0.35)


def test_a_product_is_written_in_halves_and_thirds():
    """And in a decimal number where it is neither."""
    powers = np.array([1.0, 2.0, 0.5, -1 / 3, 0.25, 0.0])
    assert written("abcdef", powers) == "a x b^2 x c^(1/2) x d^(-1/3) x e^0.25"


@pytest.mark.parametrize(
    ("ends", "free", "bound"),
    [
        (Ends(low=False, high=True), [0], {"_low": 3.0, "_high": np.inf}),
        (Ends(low=True, high=False), [0], {"_low": -np.inf, "_high": 4.0}),
        (Ends(low=True, high=True), [0], {}),
        (Ends(low=False, high=False), [0], {}),
        (Ends(low=False, high=True), [0, 1], {}),
    ],
)
def test_an_unknown_that_is_open_at_one_end_is_bounded_at_the_other(ends, free, bound):
    """Places whose density is within `OPEN` of the largest are likely: here the third and the fourth."""
    density = np.array([-9.0, -1.1 * OPEN, -0.9 * OPEN, 0.0, -1.1 * OPEN])
    values = np.array([[1.0], [2.0], [3.0], [4.0], [5.0]])
    found = SimpleNamespace(ends=[ends], free=free, values=values, posterior=SimpleNamespace(density=density))
    assert _bound(found, 0) == bound
