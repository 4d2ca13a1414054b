"""Parts of a study: values, ranges and lists with units, and one sentence for what cannot be selected."""

import json

import numpy as np
import pytest
import xarray as xr
from test_execute import run

from mdr_dask import plot, store, table
from mdr_dask.campaign import loads
from mdr_dask.errors import DataError
from mdr_dask.questions.selection import group, outputs, select, select_all


def silent(sentence):
    raise AssertionError(sentence)


@pytest.fixture
def study():
    """A grid with words and numbers among its axes, and fixed parameters."""
    shape = (4, 2, 3, 5)
    coords = {
        "velocity": ("velocity", [0.001, 0.01, 0.1, 1.0], {"units": "m/s"}),
        "wear_rule": ("wear_rule", np.array(["fast", "exact"], dtype=object)),
        "temperature": ("temperature", [273.15, 293.15, 313.15], {"units": "K"}),
        "hurst": ((), 0.7, {"units": "1"}),
        "indenter_radius": ((), 0.02, {"units": "m"}),
    }
    dims = ("velocity", "wear_rule", "temperature", "realisation")
    force = (dims, np.arange(120.0).reshape(shape), {"units": "N"})
    attrs = {"parameters": json.dumps({"hurst": 0.7, "indenter": {"shape": "parabola"}, "compressible": True})}
    return xr.Dataset({"force": force, "status": (dims, np.ones(shape, np.int8))}, coords, attrs)


@pytest.fixture
def sampled():
    """Ten cases that are not a grid."""
    coords = {
        "velocity": ("case", np.repeat([0.1, 0.2, 0.5, 0.8, 1.0], 2), {"units": "m/s"}),
        "hurst": ("case", np.linspace(0, 0.9, 10), {"units": "1"}),
    }
    dims = ("case", "realisation")
    return xr.Dataset({"force": (dims, np.zeros((10, 2))), "status": (dims, np.ones((10, 2), np.int8))}, coords)


KEPT = [
    ("velocity=10 mm/s", {"velocity": [1]}),
    ("velocity=0.01", {"velocity": [1]}),
    ("velocity=1cm/s..1m/s", {"velocity": [1, 2, 3]}),
    ("velocity = 3.6 km/h , 1 mm/s .. 10 mm/s", {"velocity": [0, 1, 3]}),
    ("velocity=..0.5", {"velocity": [0, 1, 2]}),
    ("velocity=0.05..", {"velocity": [2, 3]}),
    ("temperature=20 degC", {"temperature": [1]}),
    ("temperature=0 degC..20.000 °C", {"temperature": [0, 1]}),
    ("wear_rule=Exact", {"wear_rule": [1]}),
    ("wear_rule=exact, fast", {}),
    ("realisation=1..3", {"realisation": [1, 2, 3]}),
    ("hurst=0.7", {}),
    ("hurst=0.5..0.9", {}),
    ("indenter.radius=20 mm", {}),
    ("indenter.shape=parabola", {}),
    ("compressible=true", {}),
]


@pytest.mark.parametrize(("text", "kept"), KEPT, ids=[text for text, _ in KEPT])
def test_values_ranges_lists_and_fixed_parameters(study, text, kept):
    xr.testing.assert_identical(select(study, [text], silent), study.isel(kept))


def test_several_selections_hold_together(study):
    kept = select(study, ["velocity=0.1..1", "temperature=273.15,313.15", "velocity=1"], silent)
    xr.testing.assert_identical(kept, study.isel(velocity=[3], temperature=[0, 2]))


@pytest.mark.parametrize(("factor", "kept"), [(1 + 5e-6, True), (1 + 2e-5, False)])
def test_an_end_of_an_axis_is_its_own_but_for_rounding(study, factor, kept):
    """By a hundred thousandth of the largest value, whatever its unit."""
    micro = study.assign_coords(velocity=study["velocity"] * 1e6)
    if kept:
        assert select(micro, [f"velocity={1e6 * factor!r}"], silent).velocity == 1e6
    else:
        with pytest.raises(DataError, match=r"no velocity 1\.00002 Mm/s: its values are"):
            select(micro, [f"velocity={1e6 * factor!r}"], silent)


def test_cases_of_a_sampled_study_are_selected_by_number_and_by_column(sampled):
    xr.testing.assert_identical(select(sampled, ["case=3,7..8"], silent), sampled.isel(case=[3, 7, 8]))
    xr.testing.assert_identical(select(sampled, ["velocity=0.5"], silent), sampled.isel(case=[4, 5]))
    xr.testing.assert_identical(select(sampled, ["hurst=0.1..0.35", "velocity=0.2"], silent), sampled.isel(case=[2, 3]))


REFUSED = [
    ("velocity=2 m/s", "no velocity 2 m/s: its values are 1 mm/s, 10 mm/s, 100 mm/s, 1 m/s"),
    ("velocity=2..3", "no velocity 2 m/s .. 3 m/s: its values"),
    ("velocity=1..10 mm/s", "velocity: expected a unit after every number or after none, got '1..10 mm/s'"),
    ("velocity=1 N", "velocity: expected a velocity (such as '1 mm/s'), got '1 N'"),
    ("velocity=0.01:1", "velocity: expected a velocity (such as '1 mm/s'), got '0.01:1', and FROM..TO for a range"),
    ("velocity=1,,2", "velocity: expected NAME=VALUE"),
    ("velocity", "expected NAME=VALUE, NAME=VALUE,VALUE or NAME=FROM..TO, got 'velocity'"),
    ("velocty=1", "no axis 'velocty' in this study (did you mean 'velocity'?)"),
    ("wear_rule=exakt", "no wear_rule 'exakt' (did you mean 'exact'?)"),
    ("indenter.shape=cone", "no indenter_shape 'cone': it is 'parabola' everywhere"),
    ("realisation=7", "no realisation 7: its values are 0, 1, 2, 3, 4"),
]


@pytest.mark.parametrize(("text", "told"), REFUSED, ids=[text for text, _ in REFUSED])
def test_what_is_not_there_is_one_sentence(study, text, told):
    with pytest.raises(DataError) as refused:
        select(study, [text], silent)
    assert str(refused.value).startswith(told)


def test_a_series_that_does_not_vary_what_is_selected_stays_as_it_is(study):
    other = study.isel(velocity=0)
    chosen = select_all({"a": study, "b": other}, ["velocity=1"], silent)
    xr.testing.assert_identical(chosen["a"], study.isel(velocity=[3]))
    xr.testing.assert_identical(chosen["b"], other)


def test_groups_and_outputs_are_named(study):
    assert group({"": study}, None) is study
    for groups, series, told in [({"a": study, "b": study}, None, "a, b"), ({"a": study}, "c", "no series 'c'")]:
        with pytest.raises(DataError, match=told):
            group(groups, series)
    errors = study.assign(force_error=study.force * 0.01)
    errors.force.attrs["ancillary_variables"] = "force_error"
    assert list(outputs(errors, ["force"]).data_vars) == ["force", "force_error"]
    with pytest.raises(DataError, match="no output 'forse' in this study"):
        outputs(study, ["forse"])


@pytest.mark.parametrize(("wanted", "silently"), [("0.1000005", True), ("0.1004", False)])
def test_a_number_that_is_none_of_the_axis_is_told(study, wanted, silently):
    told = []
    assert select(study, [f"velocity={wanted}"], told.append)["velocity"].values.tolist() == [0.1]
    assert told == (
        [] if silently else ["velocity: 100.4 mm/s is not a value of this axis; the nearest value is used: 100 mm/s"]
    )


def test_messages_have_the_unit_of_the_campaign(study):
    study.attrs["campaign"] = "parameters: {velocity: {geometric: [0.1 cm/s, 100 cm/s, 4]}}"
    told = []
    select(study, ["velocity=11 mm/s"], told.append)
    assert "1.1 cm/s" in told[0]
    with pytest.raises(DataError, match="no velocity 200 cm/s"):
        select(study, ["velocity=2 m/s"], silent)


@pytest.fixture(scope="module")
def bodies(tmp_path_factory):
    """A study with an axis of structures."""
    wear = "contact_modulus: 1 GPa, effective_shear_modulus: 1 GPa, friction: 1, amplitude: 0.1 um"
    more = "depth: 1 um, hardness: 1 GPa, wear_coefficient: 1e-4, wear_rule: limit"
    listed = "[{shape: parabola, radius: 1 cm}, {shape: cone, angle: 1 deg}, {shape: cone, angle: 2 deg}]"
    text = f"name: b\nmodel: fretting_wear\nparameters: {{{wear}, {more}, indenter: {listed}}}\n"
    url = str(tmp_path_factory.mktemp("bodies") / "b.zarr")
    run(loads(text, "", "."), url)
    return store.datasets(url)[""]


INSIDE = [
    ("indenter.shape=cone", "indenter_shape == cone", [1, 2]),
    ("indenter.shape=parabola", "indenter_shape == parabola", [0]),
    ("indenter.angle=2 deg", "indenter.angle > 1.5 deg", [2]),
]


@pytest.mark.parametrize(("selection", "condition", "kept"), INSIDE, ids=[text for text, _, _ in INSIDE])
def test_parameters_inside_an_axis_belong_to_its_values(bodies, selection, condition, kept):
    expected = bodies.isel(indenter=kept)
    xr.testing.assert_identical(select(bodies, [selection], silent), expected)
    xr.testing.assert_identical(select_all({"": bodies}, [selection], silent)[""], expected)
    assert table(bodies, where=condition)["indenter"].tolist() == expected["indenter"].values.tolist()
    if kept != [0]:
        with pytest.raises(DataError, match="indenter_angle 3 deg: its only value"):
            select(bodies.isel(indenter=kept[-1:]), ["indenter.angle=3 deg"], silent)


def test_parameters_inside_an_axis_are_not_fixed(bodies):
    assert not [name for name in bodies.coords if name.startswith("indenter_")]
    drawn = plot(bodies, "wear_volume", over="indenter")
    assert not any("indenter_" in line for line in drawn.description.head({}))
