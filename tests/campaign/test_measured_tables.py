"""Tables of measured points as people write them: errors by their names, missing rows, encodings."""

import numpy as np
import pytest

from mdr_dask.campaign.measured import belonging, outside, read_measured, scatter
from mdr_dask.errors import DataError
from mdr_dask.tables import decoded

CONDITIONS = {"velocity": "m/s", "normal_force": "N"}
OUTPUTS = {"friction_coefficient": "1", "wear_volume": "m^3"}


def read(text):
    return read_measured(text, "rig.csv", CONDITIONS, OUTPUTS)


@pytest.mark.parametrize(
    "heading",
    [
        "std",
        "Std.abw.",
        "std dev",
        "COF stdev",
        "SEM",
        "sd",
        "\u00b1",
        "+-",
        "error of mu",
        "mu std",
        "friction_coefficient_error",
    ],
)
def test_columns_named_as_errors_are_errors_of_the_output_before_them(heading):
    found = read(f"velocity [m/s];mu;n;{heading}\n1;0,3;5;0,01\n2;0,4;5;0,02\n")
    assert found.errors is not None
    assert found.errors.tolist() == [0.01, 0.02]
    assert found.remark == "not used: n"


def test_errors_of_other_columns_are_named_as_not_used():
    found = read("velocity [m/s];std;mu\n1;0,1;0,3\n2;0,1;0,4\n")
    assert found.errors is None
    assert found.remark == "not used: std"


def test_errors_without_a_unit_have_that_of_the_output():
    found = read("velocity [m/s];wear volume [10\u00b3 \u00b5m\u00b3];std\n1;5;1\n2;6;2\n")
    np.testing.assert_allclose(found.errors, [1e-15, 2e-15], rtol=1e-12)


def test_rows_without_a_number_are_left_out_and_counted():
    found = read("run;velocity [m/s];mu;remark\nA;1;0,3;\nB;2;n.a.;filter\nC;3;0,4;\nend of test\n")
    assert found.values.tolist() == [0.3, 0.4]
    assert [line.number for line in found.lines] == [2, 4]
    assert "rows without a number are left out: 1" in found.remark
    assert "'end of test'" in found.remark


@pytest.mark.parametrize("heading", ["Laod [N]", "Last / N", "Zyklen"])
def test_columns_that_may_be_an_axis_are_not_left_out(heading):
    """An axis without a column would be an unknown of the calibration."""
    text = f"velocity [m/s];mu;{heading};F_t [N];room [degC];n\n1;0,3;2;700;20;30\n2;0,4;5;800;21;30\n"
    axes = {"velocity": (1, 2), "normal_force": (1e-3, 6)}
    with pytest.raises(DataError, match=f"{heading[:4]}.* is not used, but may contain 'normal_force', .*: rename"):
        read_measured(text, "rig.csv", CONDITIONS, OUTPUTS, axes)
    assert read_measured(text, "rig.csv", CONDITIONS, OUTPUTS, {"velocity": (1, 2)}).remark.startswith("not used")


@pytest.mark.parametrize(
    ("axis", "unit", "values", "heading"),
    [
        ("temperature", "K", (333.15, 373.15), "T_oil [\u00b0C];100,3;59,8"),
        ("line_load", "N/m", (450e3,), "w [N/mm];450;150"),
    ],
)
def test_a_column_with_the_unit_of_an_axis_is_refused_whatever_its_numbers(axis, unit, values, heading):
    name, *numbers = heading.split(";")
    text = f"velocity [m/s];mu;{name}\n1;0,3;{numbers[0]}\n2;0,4;{numbers[1]}\n"
    with pytest.raises(DataError, match=f"may contain '{axis}'"):
        read_measured(text, "rig.csv", {"velocity": "m/s", axis: unit}, OUTPUTS, {axis: values})


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "cp1252"])
def test_reports_of_a_rig_are_read_as_they_stand(encoding):
    text = "Rig \u2013 \u00b5 on A37\nT: 20 \u00b0C; 80 N\n"
    text += "Gleitgeschw. [mm/s];Reibwert \u00b5 [-];Std.abw.;Bemerkung\n"
    text += "1;0,112;0,008;\n10;0,181;0,012;stick-slip\n"
    found = read(decoded(text.encode(encoding), "rig.csv"))
    np.testing.assert_allclose(found.conditions["velocity"], [1e-3, 1e-2])
    assert found.errors is not None


@pytest.mark.parametrize(("unit", "error", "values"), [("-", "5", [0.02, 0.025]), ("%", "5", [0.05, 0.05])])
def test_errors_in_percent_are_relative_unless_the_output_is_in_percent(unit, error, values):
    factor = 100 if unit == "%" else 1
    found = read(f"velocity [m/s];mu [{unit}];error [%]\n1;{0.4 * factor:g};{error}\n2;{0.5 * factor:g};{error}\n")
    assert found.errors is not None
    np.testing.assert_allclose(found.errors, values)


@pytest.mark.parametrize(("heading", "output"), [("V_wear [mm^3]", "wear_volume"), ("CoF max", "friction_coefficient")])
def test_unknown_outputs_get_the_nearest_name(heading, output):
    with pytest.raises(DataError, match=rf"did you mean '{output}'"):
        read(f"velocity [m/s];{heading}\n1;0.1\n2;0.2\n")


LUBRICATED = {"mean_velocity": "m/s", "boundary_friction": "1", "slide_roll_ratio": "1", "line_load": "N/m"}
FRICTION = {"friction_coefficient": "1", "friction_force": "N"}


@pytest.mark.parametrize(
    ("headings", "conditions", "output"),
    [
        ("mean_velocity [m/s];friction_coefficient", ["mean_velocity"], "friction_coefficient"),
        ("v [m/s];boundary_friction;CoF", ["boundary_friction", "mean_velocity"], "friction_coefficient"),
        ("Speed [m/s];Friction", ["mean_velocity"], "friction_coefficient"),
        ("Speed [m/s];Friction [mN]", ["mean_velocity"], "friction_force"),
        (
            "Rolling Speed [mm/s];Sliding Speed [mm/s];Traction Coefficient ( )",
            ["mean_velocity"],
            "friction_coefficient",
        ),
        ("Sliding Speed [mm/s];SRR [%];Load [N];mu", ["slide_roll_ratio"], "friction_coefficient"),
    ],
)
def test_exact_names_precede_synonyms_and_units_decide_between_quantities(headings, conditions, output):
    numbers = ";".join("12345"[: headings.count(";") + 1])
    found = read_measured(f"{headings}\n{numbers}\n{numbers}\n", "rig.csv", LUBRICATED, FRICTION)
    assert (sorted(found.conditions), found.output) == (conditions, output)


@pytest.mark.parametrize("heading", ["temperature", "T", "Temp.", "Temperatur"])
def test_synonyms_of_a_short_name_are_read(heading):
    conditions = {"solid_temperature": "K", "velocity": "m/s"}
    found = read_measured(f"v [m/s];{heading} [°C];mu\n1;20;2\n2;20;3\n", "rig.csv", conditions, FRICTION)
    assert found.conditions["solid_temperature"].tolist() == [293.15, 293.15]


def test_a_difference_of_one_percent_is_allowed_whatever_its_rounding():
    values = np.array([0.099, 0.101, 0.0989, 0.1012, 1.01, 1.011])
    np.testing.assert_equal(belonging(values, [0.1, 1.0]), [0.1, 0.1, np.nan, np.nan, 1.0, np.nan])
    assert outside(values, [0.1, 1.0]).tolist() == [False, False, True, False, False, True]


def test_differences_of_temperatures_are_in_kelvins():
    found = read_measured("v [m/s];T [°C];mu\n1;20,5;2\n2;20;3\n", "rig.csv", {"v": "m/s", "T": "K"}, FRICTION)
    (sentence,) = scatter(found, {"T": 293.15}, {"T": "K"})
    assert "1 of 2 points differ in T by up to 0.5 K" in sentence


def test_names_of_several_quantities_are_refused():
    with pytest.raises(DataError, match="'Speed', which may mean 'velocity' or 'mean_velocity'"):
        read_measured("Speed [m/s];mu\n1;2\n", "rig.csv", {"velocity": "m/s", "mean_velocity": "m/s"}, FRICTION)


def test_a_table_of_two_outputs_needs_the_wanted_one():
    text = "velocity [m/s];CoF;Reibkraft [mN]\n1;0,3;5\n2;0,4;6\n"
    with pytest.raises(DataError, match="got friction_coefficient and friction_force: delete all but one"):
        read_measured(text, "rig.csv", CONDITIONS, FRICTION)
    found = read_measured(text, "rig.csv", CONDITIONS, FRICTION, wanted=["friction_force", "contact_area"])
    np.testing.assert_allclose(found.values, [5e-3, 6e-3])
    assert "not used: CoF" in found.remark


def test_a_column_for_each_temperature_has_a_remedy():
    with pytest.raises(DataError, match=r"got v, µ 40°C, µ 100°C .*temperatures into a column of their own"):
        read(";v [m/s];µ 40°C;µ 100°C\n1;1;0,3;5\n2;2;0,4;6\n")


def test_columns_that_resemble_fixed_parameters_are_only_named():
    text = "velocity [m/s];mu;Ball Load [N];Pot force [N]\n1;0,3;5;6\n2;0,4;6;6\n"
    found = read_measured(text, "rig.csv", CONDITIONS, OUTPUTS, {"velocity": (1, 2)})
    assert found.remark == "not used: Ball Load, Pot force"
    with pytest.raises(DataError, match=r"(?s)Ball Load.*\n.*Pot force"):
        read_measured(text, "rig.csv", CONDITIONS, OUTPUTS, {"velocity": (1, 2), "normal_force": (100, 200)})


PROFILES = {"wear_volume": (), "worn_depth": (), "worn_profile": ("radius",)}
CYCLES = {"cycles": "1", "radius": "m"}
WORN = {"wear_volume": "m^3", "worn_profile": "m"}


@pytest.mark.parametrize("stored", [CYCLES, {"cycles": "1"}])
def test_a_coordinate_of_other_outputs_is_refused(stored):
    text = "cycles;radius [um];wear volume [um^3]\n1;5;0,3\n2;6;0,4\n"
    with pytest.raises(DataError, match="column 'radius' is not used, because wear_volume does not depend on it"):
        read_measured(text, "rig.csv", stored, WORN, {"cycles": (1, 2), "radius": (0, 1e-4)}, PROFILES)
    profile = text.replace("wear volume [um^3]", "worn_profile [um]")
    found = read_measured(profile, "rig.csv", CYCLES, WORN, {"cycles": (1, 2), "radius": (0, 1e-4)}, PROFILES)
    assert set(found.conditions) == {"cycles", "radius"}


def test_names_similar_to_a_coordinate_of_other_outputs_are_only_named():
    text = "cycles;Narbenradius [um];wear volume [um^3]\n1;5;0,3\n2;6;0,4\n"
    found = read_measured(text, "rig.csv", CYCLES, WORN, {"cycles": (1, 2), "radius": (0, 1e-4)}, PROFILES)
    assert (found.remark, set(found.conditions)) == ("not used: Narbenradius", {"cycles"})
