"""The model mixed_lubrication: values, invariances, shared solutions, bad input and warnings."""

import dataclasses
import re

import numpy as np
import pytest
from pydantic import ValidationError

from mdr_dask.models import load
from mdr_dask.models.base import Block, Status
from mdr_dask.models.mixed_lubrication.declaration import STEEL
from mdr_dask.models.mixed_lubrication.oil_data import OilData
from mdr_dask.physics.lubrication import oil
from mdr_dask.physics.lubrication.line_contact import line_contact, solve_film
from mdr_dask.units import to_si

MODEL = load("mixed_lubrication")
RPM = 2 * np.pi / 60
ALL = tuple(output.name for output in MODEL.outputs)
#: A short line of 6.3 mm, for tests that are exact at any length; the contact width 2a is 105 to 420 um.
SMALL = {
    "rms_roughness": 2e-7,
    "points": 20_000,
    "roller_radius": 1e-3,
    "roller_width": 0.01,
    "normal_force": 100.0,
    "rotation_speed": 10.0,
    "temperature": 333.15,
    "film_thickness": 4e-7,
    "cutoff_force": 100.0,
    "trace_points": 100,
}


def block(outputs=ALL, realisations=(0,), seed=2013, columns=None, **changes):
    columns = {name: np.asarray(column) for name, column in (columns or {}).items()}
    cases = len(next(iter(columns.values()))) if columns else 1
    return Block(
        MODEL.parameters(**SMALL | changes), columns, cases, tuple(realisations), seed, MODEL.with_companions(outputs)
    )


def refused(**changes):
    with pytest.raises(ValidationError) as caught:
        MODEL.parameters(**SMALL | changes)
    (error,) = caught.value.errors()
    return error["msg"]


def test_trace_agrees_with_its_mean():
    """With as many angles as points, mean and fraction of the trace are the scalar outputs."""
    values = MODEL.compute(block(trace_points=20_000)).values
    trace = values["contact_length_trace"][0, 0]
    assert np.mean(trace > 0) == pytest.approx(values["breakthrough_probability"][0, 0], rel=1e-12)
    assert np.mean(trace) == pytest.approx(values["contact_length"][0, 0], rel=1e-12)
    squares = 0.01 / (2 * values["contact_half_width"][0, 0])  # the longest wave is 2a at this force
    assert values["independent_squares"][0, 0] == pytest.approx(squares, rel=1e-12)
    assert values["contact_resistance"][0, 0] == pytest.approx(2e-7 / np.mean(trace) / squares, rel=1e-12)


def test_pure_rolling_has_no_friction_and_creep_has_the_film_s():
    values = MODEL.compute(block(columns={"slide_roll_ratio": [0.0, 0.1, -0.1]}, film_thickness=5e-6)).values
    assert values["breakthrough_probability"].tolist() == [[0.0]] * 3
    still, forward, backward = values["friction_coefficient"][:, 0]
    assert still == 0.0
    assert forward == backward > 0.0
    assert np.isinf(values["contact_resistance"]).all()


def test_an_automatic_number_of_points_meets_the_accuracy_or_warns():
    """Four films, two layers, two revolutions each; reference: four times the largest automatic number of points."""
    layers, films = (each.ravel() for each in np.meshgrid([5e-9, 2e-8], [3e-7, 4e-7, 5e-7, 6e-7]))
    columns = {"layer_thickness": layers, "film_thickness": films}
    rollers = {"points": "auto", "shortest_wavelength": 2e-6, "columns": columns, "realisations": (0, 1)}
    asked = dataclasses.replace(block(["breakthrough_probability"], **rollers), accuracy=0.1)
    most = asked.case(0).source().points[-1]
    truth = MODEL.compute(block(["breakthrough_probability"], **rollers | {"points": 4 * most})).values
    found = MODEL.compute(asked)
    value, stated = (found.values[f"breakthrough_probability{end}"] for end in ("", "_error"))
    errors = abs(value - truth["breakthrough_probability"])
    assert np.mean(errors <= stated) >= 0.9
    met = stated <= 0.1 * value
    assert np.mean(met) >= 0.7
    assert np.all(errors[met] <= 0.1 * value[met])
    warned = {at for at, note in found.messages.items() if "is missed" in note}
    assert warned == set(zip(*np.nonzero(~met), strict=True))


def test_errors_of_the_film_are_those_of_its_solution():
    names = ["film", "film_ratio", "asperity_load_share", "friction_coefficient"]
    given = {"film_thickness": None, "slide_roll_ratio": 0.05, "rotation_speed": 100.0}
    formula = MODEL.compute(block(names, **given)).values
    solved = block(names, film_formula="ehl", **given)
    coarse = MODEL.compute(solved).values
    fine = MODEL.compute(dataclasses.replace(solved, accuracy=1e-4)).values
    for name in names:
        assert formula[f"{name}_error"] == 0.0
        assert 0 < coarse[f"{name}_error"] < 0.05 * coarse[name]
        assert abs(coarse[name] - fine[name]) <= coarse[f"{name}_error"] + fine[f"{name}_error"]
    thinner = float(coarse["film"][0, 0] - coarse["film_error"][0, 0])
    thin = MODEL.compute(block(names, **given | {"film_thickness": thinner})).values
    for name in names:
        assert coarse[f"{name}_error"] == pytest.approx(abs(thin[name] - coarse[name]), rel=1e-6)


#: The thesis's rig, by its defaults.
RIG = {
    "roller_radius": 0.05,
    "normal_force": 800.0,
    "rotation_speed": 100 * RPM,
    "film_thickness": None,
    "cutoff_force": 1600.0,
    "points": 10**6,
}


@pytest.mark.parametrize("law", ["barus", "roelands"])
def test_film_of_the_full_solution_is_that_of_the_line_contact_in_metres(law):
    """At 40 degC, the asperities carry no load, and the film is that of the line contact, converted to m here."""
    found = MODEL.compute(block(["film"], film_formula="ehl", viscosity_law=law, **RIG | {"temperature": 313.15}))
    data = oil.OILS["mobilgear_shc_xmp_320"]
    viscosity, alpha = float(data.dynamic(313.15)), float(data.alpha(313.15))
    radius, line_load, velocity = 0.025, 800.0 / 0.01, 100 * RPM * 0.05
    W, U, G = line_load / (2 * STEEL * radius), viscosity * velocity / (2 * STEEL * radius), alpha * 2 * STEEL
    solution = solve_film(line_contact((W, U, G), STEEL, viscosity_law=law, viscosity=viscosity))
    half_width = np.sqrt(4 * line_load * radius / (np.pi * STEEL))
    expected = float(solution.central_film.value) * half_width**2 / radius
    assert found.values["film"][0, 0] == pytest.approx(expected, rel=1e-4)
    assert expected == pytest.approx(1.1e-6, rel=0.1)  # micrometres, as published
    assert found.values["film_error"][0, 0] == pytest.approx(expected * float(
        solution.central_film.error / solution.central_film.value), rel=0.01)  # fmt: skip


def stribeck(speeds, outputs=("film", "film_ratio", "asperity_load_share", "friction_coefficient"), **changes):
    given = RIG | {"temperature": 353.15, "slide_roll_ratio": 0.02} | changes
    found = MODEL.compute(block(outputs, columns={"rotation_speed": np.asarray(speeds) * RPM}, **given))
    assert np.all(found.status == Status.DONE)
    return {name: values[:, 0] for name, values in found.values.items()}


@pytest.mark.parametrize("formula", ["pan_hamrock", "dowson_higginson"])
def test_friction_rises_to_boundary_friction_as_the_speed_goes_to_zero(formula):
    """Friction is monotone below a film ratio of 1, and within 5 % of boundary friction at the lowest speed."""
    force = 200.0
    found = stribeck(np.geomspace(1e-6, 1000, 40), normal_force=force, film_formula=formula, boundary_friction=0.12)
    friction, ratio = found["friction_coefficient"], found["film_ratio"]
    assert np.all(np.diff(ratio) > -1e-9)
    assert np.all(np.diff(friction[ratio < 1]) <= 1e-7)  # the film between the asperities still causes some friction
    assert friction[0] == pytest.approx(0.12, rel=0.05)
    assert friction[-1] < 0.01
    assert np.all(np.diff(found["asperity_load_share"]) <= 1e-9)


def test_friction_is_that_of_asperities_and_film():
    """With an oil of very low viscosity, only the asperities cause friction; without asperities, only the film does."""
    thin = stribeck([0.1, 1.0, 10.0], eyring_stress=1e-3)
    np.testing.assert_allclose(thin["friction_coefficient"], 0.1 * thin["asperity_load_share"], rtol=1e-6)
    none, some = (stribeck([10.0], boundary_friction=mu)["friction_coefficient"] for mu in (0.0, 0.1))
    share = stribeck([10.0])["asperity_load_share"]
    np.testing.assert_allclose(some - none, 0.1 * share, rtol=1e-9)


@pytest.mark.parametrize("formula", ["pan_hamrock", "ehl"])
def test_the_film_is_never_thinner_for_its_asperities(formula):
    speeds = [1.0, 10.0, 100.0, 1000.0]
    rough = stribeck(speeds, film_formula=formula)
    smooth = stribeck(speeds, film_formula=formula, rms_roughness=1e-12)
    assert np.all(smooth["asperity_load_share"] < 1e-9)
    assert np.all(rough["film"] >= smooth["film"] * (1 - 1e-4))
    assert rough["film"][0] > 1.05 * smooth["film"][0]


def test_a_given_film_is_kept_and_too_thin_a_one_is_warned_of():
    result = MODEL.compute(block(["film", "asperity_load_share"], columns={"film_thickness": [1e-9, 4e-7]}))
    assert result.values["film"][:, 0].tolist() == [1e-9, 4e-7]
    assert result.values["asperity_load_share"][0, 0] == 1.0
    assert np.all(result.values["asperity_load_share_error"] == 0.0)
    assert "at the given film thickness, asperities would carry more than the whole load" in result.messages[0, 0]
    assert (1, 0) not in result.messages


TEMPERATURES = np.array([20.0, 40.0, 60.0, 80.0, 100.0])


def own_oil(tmp_path, text, **changes):
    (tmp_path / "oil.csv").write_text(text)
    data = SMALL | {"oil": {"viscosities": "oil.csv", "density": 870.0, "density_temperature": 300.0} | changes}
    return MODEL.parameters.model_validate(data, context={"directory": str(tmp_path), "to_si": to_si})


@pytest.mark.parametrize("kind", ["kinematic", "dynamic"])
def test_a_table_of_viscosities_is_the_oil_that_it_was_made_of(kind, tmp_path):
    """Tables of both kinds of viscosity; and a table with one wrong row, which `check` names."""
    given = OilData(
        temperature_1=313.15, viscosity_1=220e-6, temperature_2=373.15, viscosity_2=19e-6, density=870.0,
        density_temperature=300.0,
    ).oil  # fmt: skip
    values = getattr(given, kind)(TEMPERATURES + 273.15) * {"kinematic": 1e6, "dynamic": 1e3}[kind]
    unit = {"kinematic": "cSt", "dynamic": "mPa s"}[kind]

    def rows():
        return "".join(f"{T};{value}\n" for T, value in zip(TEMPERATURES[::-1], values[::-1], strict=True))

    read = own_oil(tmp_path, f"T [degC];Viscosity [{unit}]\n{rows()}").oil.oil
    for T in (293.15, 333.0, 373.15):
        assert read.kinematic(T) == pytest.approx(given.kinematic(T), rel=1e-9)
    assert (read.lowest, read.highest) == (293.15, 373.15)
    values[2] *= 1.05
    notes = own_oil(tmp_path, f"T [degC];Viscosity [{unit}]\n{rows()}", highest_temperature=400.05).oil.notes()
    assert re.search(
        r"\(ASTM D341\) fitted to 5 kinematic viscosities, .*; largest deviation \+4 % at 60 degC", notes[0]
    )
    ends = re.search(r"viscosities, (\S+) to (\S+) mm\^2/s", notes[0]).groups()
    assert [float(end) for end in ends] == pytest.approx([1e6 * given.kinematic(T) for T in (293.15, 373.15)], rel=0.05)
    assert notes[1:] == ("oil: the viscosity is extrapolated above 100 degC, to 126.9 degC",)


@pytest.mark.parametrize(
    ("text", "changes", "message"),
    [
        ("T [degC];nu [cSt]\n40;220\n100;290\n", {}, "oil.csv: expected viscosities that fall with temperature"),
        ("T [degC];nu [cSt]\n40;220\n40;219\n", {}, "oil.csv: expected viscosities at two temperatures or more"),
        ("T [degC];nu [cSt]\n40;22\n100;1.5\n", {}, "oil.csv: expected kinematic viscosities of at least 2 mm"),
        ("T [degC];viscosity\n40;22\n100;5\n", {}, "column kinematic viscosity: expected its unit"),
        ("T [degC];nu [cSt]\n40;22\n100;5\n", {"viscosity_1": 1e-4}, "expected .*viscosities, got"),
    ],
)
def test_tables_without_valid_viscosities_are_refused(text, changes, message, tmp_path):
    with pytest.raises(ValidationError, match=message):
        own_oil(tmp_path, text, **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"temperature": 293.15}, "expected a temperature within the oil's data, 313.15 to 373.15 K, got 293.15 K"),
        (
            {"normal_force": 2e8},
            "expected a contact width 2a of at most the length of the line, 0.00628318531 m, got 0.0",
        ),
        ({"longest_wavelength": 1e-6, "shortest_wavelength": 1e-5}, "expected a longest wavelength above the"),
        (
            {"points": "auto", "shortest_wavelength": 1e-9},
            "expected a shortest wavelength of at least two point spacings",
        ),
    ],
)
def test_bad_input_gives_one_error(changes, message):
    assert message in refused(**changes)


def write_profile(path, spacing, heights):
    path.write_text("# a scan\nx [m],z [m]\n" + "".join(f"{i * spacing:.9e}, {z:.9e}\n" for i, z in enumerate(heights)))
    return str(path)


SIZES = ((6000, 0.5e-6), (5000, 0.6e-6))  # numbers of points and spacings of two profiles of equal length


def profiles(tmp_path, spacing_2=1e-6, size_2=4000):
    generator = np.random.default_rng(1)
    one = np.convolve(generator.normal(size=4008), np.ones(9) / 9, "valid") * 6e-7
    two = np.convolve(generator.normal(size=size_2 + 8), np.ones(9) / 9, "valid") * 6e-7
    return {
        "surface_1": {"profile": write_profile(tmp_path / "one.csv", 1e-6, one + 1e-5 + 1e-4 * 1e-6 * np.arange(4000))},
        "surface_2": {"profile": write_profile(tmp_path / "two.csv", spacing_2, two)},
        "rms_roughness": None,
    }


def test_measured_profiles_take_the_place_of_generated_lines(tmp_path):
    files = profiles(tmp_path, size_2=3900)
    result = MODEL.compute(block(realisations=(0, 1, 2), **files))
    values = result.values["contact_length"][0]
    assert np.all(result.status == Status.DONE)
    assert len(set(values.tolist())) == 3  # the rings have other offsets
    # mean and tilt of the file are removed; each line is a moving average of nine points
    assert result.values["film_ratio"][0, 0] == pytest.approx(4e-7 / (6e-7 / 3 * np.sqrt(2)), rel=0.1)
    scaled = MODEL.compute(block(**files | {"rms_roughness": 2e-7})).values["film_ratio"][0, 0]
    # the rms height of the cut line is not exactly 1
    assert scaled == pytest.approx(4e-7 / (2e-7 * np.sqrt(2)), rel=1e-3)


def test_profiles_of_different_spacings_are_interpolated_to_the_finer_one(tmp_path):
    heights = [6e-7 * np.sin(2 * np.pi * np.arange(size) * spacing / 5e-5) for size, spacing in SIZES]
    paths = [write_profile(tmp_path / f"{k}.csv", SIZES[k][1], heights[k]) for k in range(2)]
    rollers = {"rms_roughness": None, "surface_1": {"profile": paths[0]}}
    values = [MODEL.compute(block(**rollers, surface_2={"profile": path})).values["film_ratio"][0, 0] for path in paths]
    assert values[1] == pytest.approx(values[0], rel=1e-3)
    (note,) = MODEL.notes([MODEL.parameters(**SMALL | rollers | {"surface_2": {"profile": paths[1]}})])
    assert "rms heights are then 424.3 nm and 424.3 nm" in note


def test_a_longest_wavelength_beyond_the_contact_is_noted():
    assert not MODEL.notes([MODEL.parameters(**SMALL | {"normal_force": force}) for force in (10.0, 100.0)])
    (note,) = MODEL.notes([MODEL.parameters(**SMALL | {"normal_force": force}) for force in (10.0, 99.0)])
    assert "exceeds the largest contact width" in note


@pytest.mark.slow
def test_creep_on_measured_profiles_has_the_mean_of_pure_rolling_and_of_swapped_rollers(tmp_path):
    """With S = -1, a revolution covers half of line 1; a fixed start would shift the mean by 20 standard errors."""
    files = profiles(tmp_path)
    files["surface_1"]["profile"] = write_profile(
        tmp_path / "uneven.csv", 1e-6, 5e-7 * np.sin(np.arange(4000) ** 2 / 4e4) * (np.arange(4000) > 2000)
    )
    swapped = files | {"surface_1": files["surface_2"], "surface_2": files["surface_1"]}
    found = [
        MODEL.compute(block(["breakthrough_probability"], range(60), slide_roll_ratio=creep, **rollers))
        for creep, rollers in ((0.0, files), (-1.0, files), (1.0, swapped))
    ]
    values = [one.values["breakthrough_probability"][0] for one in found]
    means, errors = (np.array([f(one) for one in values]) for f in (np.mean, lambda one: one.std(ddof=1) / 60**0.5))
    for other in (1, 2):
        assert abs(means[other] - means[0]) < 3 * np.hypot(errors[other], errors[0])


def test_bad_profiles_give_one_error(tmp_path):
    files = profiles(tmp_path)
    assert "expected surface_1 and surface_2 together" in refused(surface_1=files["surface_1"])
    (tmp_path / "bad.csv").write_text("x [m], z [m]\n1, 2\n3, 2x\n")
    assert "bad.csv:3: column z: expected a number, got '2x'" in refused(
        **files | {"surface_2": {"profile": str(tmp_path / "bad.csv")}}
    )
    assert "expected a contact width 2a of at most" in refused(**files | {"normal_force": 1e7})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"film_thickness": 1e-4}, "the film is thicker than 0.1 of the radius"),
        ({"film_thickness": None, "normal_force": 1.0}, "film formula Pan-Hamrock (central) is extrapolated: W lies"),
        ({"film_thickness": 1e-8, "rms_roughness": 2e-5}, "asperities merge into large clusters"),
        ({"roller_width": 9e-5, "longest_wavelength": 1e-4}, "the rollers are narrower than this square"),
    ],
)
def test_cases_beyond_the_tested_range_have_a_warning(changes, message):
    result = MODEL.compute(block(["film", "breakthrough_probability"], **changes))
    assert result.status[0, 0] == Status.DONE
    assert message in result.messages[0, 0]
    of_film = MODEL.compute(block(["film"], **changes)).messages
    assert (message in of_film.get((0, 0), "")) == ("clusters" not in message)  # these concern only the breakthroughs
