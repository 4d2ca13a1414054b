"""Questions answered as rows and as arrays, against plain numpy, on a planted study with results of every state."""

import itertools
import json
import warnings

import dask
import numpy as np
import pandas as pd
import pytest
import xarray as xr

from mdr_dask.aggregation import aggregate
from mdr_dask.errors import DataError
from mdr_dask.models.base import Status
from mdr_dask.questions import table as room
from mdr_dask.questions.selection import where
from mdr_dask.questions.table import MEANS, Question, boxes, labelled, table

SHAPE = (3, 4, 6)
FORCES, VELOCITIES = [0.1, 1.0, 10.0], [0.001, 0.01, 0.1, 1.0]


@pytest.fixture
def study():
    """Sliding friction over force and velocity; each state of a result somewhere."""
    noise = np.random.default_rng(5).normal(1, 0.1, SHAPE)
    values = np.arange(1.0, 13.0).reshape(3, 4, 1) * noise
    status = np.full(SHAPE, Status.DONE, dtype=np.int8)
    status[0, 0, 4:] = Status.MISSING
    status[0, 1] = Status.FAILED
    status[0, 2, :2] = [Status.NOT_CONVERGED, Status.FAILED]
    status[1, 0, 3:] = Status.NOT_NEEDED
    values[status != Status.DONE] = np.nan
    dims = ("normal_force", "velocity", "realisation")
    data = {
        "friction_coefficient": (dims, values, {"units": "1", "ancillary_variables": "friction_coefficient_error"}),
        "friction_coefficient_error": (dims, 0.01 * values, {"units": "1"}),
        "rms_slope": (dims, np.where(np.isnan(values), np.nan, 0.02), {"units": "1"}),
        "trace": ((*dims, "radius"), values[..., None] * [1.0, 2.0], {"units": "m"}),
        "status": (dims, status),
    }
    coords = {
        "normal_force": ("normal_force", FORCES, {"units": "N"}),
        "velocity": ("velocity", VELOCITIES, {"units": "m/s"}),
        "radius": ("radius", [0.0, 1.0], {"units": "1"}),
        **{name: ((), number, {"units": unit}) for name, number, unit in FIXED},
    }
    attrs = {"model": "sliding_friction", "parameters": json.dumps({"scheme": "hermite", "hurst": 0.7})}
    return xr.Dataset(data, coords, attrs)


FIXED = [
    ("length", 0.02, "m"),
    ("shear_modulus", 1e7, "Pa"),
    ("rms_roughness", 5e-7, "m"),
    ("relaxation_time", 1e-3, "s"),
]


def silent(sentence):
    if "trace" not in sentence:
        raise AssertionError(sentence)


def rows(study, limit=0, **parts):
    answer = table(study, Question(**parts), limit, silent)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        frames = list(answer.frames)
    found = pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=list(answer.units))
    assert list(found) == list(answer.units)
    return found


def means(study):
    return study.friction_coefficient.mean("realisation").to_numpy()


def test_means_with_errors_count_and_state(study):
    found = rows(study, outputs=("friction_coefficient",))
    assert list(found)[:2] == ["normal_force", "velocity"]
    np.testing.assert_array_equal(found[["normal_force", "velocity"]], list(itertools.product(FORCES, VELOCITIES)))
    reduced = aggregate(study[["friction_coefficient", "friction_coefficient_error"]], MEANS)
    for name in reduced.data_vars:
        np.testing.assert_array_equal(found[str(name)], reduced[name].to_numpy().ravel())
    assert found["realisations"].tolist() == [4, 0, 4, 6, 3, *[6] * 7]
    states = ["2 missing", "6 failed", "1 not_converged, 1 failed", *["done"] * 9]
    assert found["status"].tolist() == states


def test_single_results_have_one_state_each(study):
    found = rows(study, outputs=("friction_coefficient",), statistics=None)
    np.testing.assert_array_equal(found["friction_coefficient"], study.friction_coefficient.to_numpy().ravel())
    np.testing.assert_array_equal(found["friction_coefficient_error"], 0.01 * found["friction_coefficient"])
    words = np.array([state.name.lower() for state in Status])
    np.testing.assert_array_equal(found["status"], words[study.status.to_numpy().ravel()])
    assert rows(study, where="status == failed", statistics=None)["realisation"].tolist() == [*range(6), 1]


def test_conditions_on_outputs_axes_and_numbers(study):
    mean = means(study)
    load = np.array(FORCES)[:, None] / (1e7 * 5e-7 * 0.02)
    kept = (mean > 2.5) & (load < 50) & (np.array(VELOCITIES) < 3 / 3.6)
    found = rows(study, where="friction_coefficient > 2.5 and load_number < 50 and velocity < 3 km/h")
    np.testing.assert_array_equal(found["friction_coefficient_mean"], mean[kept])
    masked = where(study, "friction_coefficient > 2.5")
    np.testing.assert_array_equal(
        masked.friction_coefficient.notnull(), study.friction_coefficient.notnull() & (mean > 2.5)[..., None]
    )
    assert (masked.status.where(~(mean > 2.5)[..., None], Status.NOT_NEEDED) == Status.NOT_NEEDED).all()
    assert masked.trace.attrs == study.trace.attrs


STATES = [
    ("status == failed", [1, 2]),
    ("status != failed", [0, *range(3, 12)]),
    ("status in (missing, failed)", [0, 1, 2]),
    ("status == '6 failed'", [1]),
    ("status == done", [*range(3, 12)]),
]


@pytest.mark.parametrize(("where", "kept"), STATES)
def test_a_row_of_means_has_the_states_of_its_results(study, where, kept):
    every = rows(study)
    pd.testing.assert_frame_equal(rows(study, where=where), every.iloc[kept].reset_index(drop=True))
    one = study.isel(normal_force=0, velocity=1)
    assert len(rows(one, where=where)) == (1 in kept)


def test_columns_in_their_order_and_their_units(study):
    columns = ("velocity", "scheme", "velocity_number", "scaled_friction", "length", "status")
    found = rows(study, columns=columns, units={"velocity": "km/h", "length": "mm"})
    assert tuple(found) == columns
    np.testing.assert_allclose(found["velocity"][:4], 3.6 * np.array(VELOCITIES))
    np.testing.assert_allclose(found["velocity_number"][4:8], np.array(VELOCITIES) * 1e-3 * 0.02 / (np.sqrt(2) * 5e-7))
    np.testing.assert_allclose(found["scaled_friction"], means(study).ravel() / (np.sqrt(2) * 0.02))
    assert set(found["scheme"]) == {"hermite"}
    np.testing.assert_allclose(found["length"], 20.0)


@pytest.mark.parametrize("limit", [0, 5])
@pytest.mark.parametrize("most", [2, 1000])
def test_orders_put_what_is_not_there_last(study, limit, most, monkeypatch):
    monkeypatch.setattr(room, "ROWS", most)
    mean = means(study).ravel()
    expected = np.concatenate([np.sort(mean[np.isfinite(mean)])[::-1], [np.nan]])
    found = rows(study, limit, sort=("-friction_coefficient",))["friction_coefficient_mean"]
    np.testing.assert_array_equal(found, expected[: limit or None])
    found = rows(study, limit, sort=("status", "-velocity"))
    assert found["status"].tolist() == [*sorted(rows(study)["status"])][: limit or None]
    assert found["velocity"][3] == 1.0


def test_arrays_are_made_piece_by_piece(study):
    question = Question(columns=("load_number",), outputs=("friction_coefficient",), where="velocity < 0.5")
    plain = labelled(study, question)
    with dask.config.set({"array.chunk-size": 64}):
        lazy = labelled(study, question)
    assert lazy.friction_coefficient_mean.data.npartitions > 2
    assert all(array.chunks for array in lazy.filter_by_attrs(units="1").data_vars.values() if array.ndim > 1)
    xr.testing.assert_identical(lazy.compute(), plain.compute())


def test_groups_of_complete_realisations_are_plain_means_over_cases(study):
    whole = study.isel(normal_force=[1, 2], velocity=slice(1, None))
    found = rows(whole, outputs=("friction_coefficient",), group_by=("velocity",))
    plain = aggregate(whole[["friction_coefficient", "friction_coefficient_error"]].mean("normal_force"), MEANS)
    np.testing.assert_allclose(found["friction_coefficient_mean"], plain.friction_coefficient_mean, rtol=1e-13)
    scatter = aggregate(whole[["friction_coefficient"]].mean("normal_force"), MEANS).friction_coefficient_standard_error
    np.testing.assert_allclose(found["friction_coefficient_standard_error"], scatter, rtol=1e-12)
    np.testing.assert_allclose(found["friction_coefficient_grid_error"], 0.01 * found["friction_coefficient_mean"])
    assert found["cases"].tolist() == [2, 2, 2]


def test_groups_of_unequal_cases_count_each_case_once(study):
    found = rows(study, outputs=("friction_coefficient",), group_by=("normal_force",), where="velocity < 0.5")
    np.testing.assert_allclose(found["friction_coefficient_mean"], np.nanmean(means(study)[:, :3], axis=1), rtol=1e-13)
    assert found["cases"].tolist() == [3, 3, 3]
    assert found["status"].tolist() == ["2 missing, 1 not_converged, 7 failed", "done", "done"]


def test_the_standard_error_of_groups_of_unequal_cases_is_that_of_many_studies():
    """Two cases share their noise, one has a third of the results: 4000 studies, 4 sigma of their own scatter."""
    rng = np.random.default_rng(11)
    shared = rng.normal(0, 1, (4000, 30))
    values = np.stack([shared, 2 * shared], axis=1) + rng.normal(0, 0.5, (4000, 2, 30))
    values[:, 1, 10:] = np.nan
    dims = ("study", "case", "realisation")
    done = np.where(np.isnan(values), Status.NOT_NEEDED, Status.DONE).astype(np.int8)
    data = xr.Dataset({"y": (dims, values), "status": (dims, done)}, {"study": ("study", np.arange(4000))})
    found = rows(data, group_by=("study",))
    scatter = found["y_mean"].std(ddof=1)
    assert np.sqrt((found["y_standard_error"] ** 2).mean()) == pytest.approx(scatter, rel=0.05 + 4 / np.sqrt(8000))


def test_sampled_studies_have_a_number_for_each_case(study):
    sampled = study.drop_vars(["normal_force", "velocity"]).stack(case=["normal_force", "velocity"], create_index=False)
    sampled = sampled.assign_coords(velocity=("case", np.tile(VELOCITIES, 3), {"units": "m/s"}))
    found = rows(sampled, outputs=("rms_slope",), selections=("case=3..5",))
    assert found["case"].tolist() == [3, 4, 5]
    assert found["velocity"].tolist() == [1.0, 0.001, 0.01]
    assert rows(sampled, group_by=("velocity",))["cases"].tolist() == [3, 3, 3, 3]


def test_outputs_with_further_dimensions_are_left_out_with_a_message(study):
    told = []
    for ask in (table, labelled):
        ask(study, Question(), tell=told.append)
        ask(study, Question(("trace",)), tell=told.append)
    assert told == ["left out, because they have further dimensions: trace (name an output to include it)"] * 2


def test_an_output_along_a_dimension_of_its_own_has_a_row_for_each_place(study):
    found = rows(study, outputs=("trace",), selections=("normal_force=10", "velocity=1"))
    assert found["radius"].tolist() == [0.0, 1.0]
    np.testing.assert_allclose(found["trace_mean"], study.trace[2, 3].mean("realisation"))


@pytest.mark.parametrize("most", [1, 3, 7, 100])
def test_boxes_follow_the_rows_whatever_their_size(study, most, monkeypatch):
    sizes = {"a": 3, "b": 4, "c": 5}
    grid = xr.DataArray(np.arange(60).reshape(3, 4, 5), dims=tuple(sizes))
    cut = [grid.isel(box).to_numpy().ravel() for box in boxes(sizes, most)]
    np.testing.assert_array_equal(np.concatenate(cut), np.arange(60))
    assert max(map(len, cut)) <= most
    monkeypatch.setattr(room, "ROWS", most)
    pd.testing.assert_frame_equal(rows(study, limit=4).iloc[:4], rows(study.chunk(velocity=2)).iloc[:4])


@pytest.mark.parametrize("parts", [{}, {"where": "radius >= 0"}, {"statistics": None}, {"sort": ("radius", "status")}])
@pytest.mark.parametrize("axes", [{"normal_force": 2, "velocity": 3}, {"normal_force": [2], "velocity": [3]}])
def test_a_study_of_one_case_has_every_place_of_a_profile(study, axes, parts):
    one = study.isel(axes)
    places = 2 * one.sizes["realisation"] if "statistics" in parts else 2
    assert len(rows(one, outputs=("trace",), **parts)) == len(rows(one, columns=("radius", "trace"), **parts)) == places
    assert rows(one, outputs=("rms_slope",))["rms_slope_mean"].tolist() == pytest.approx([0.02])


@pytest.mark.parametrize("sort", ["-radius", "-velocity"])
def test_a_table_can_be_sorted_by_an_axis_alone(study, sort):
    found = rows(study, outputs=("trace",), sort=(sort,))
    assert len(found) == 24
    assert (np.diff(found[sort[1:]]) <= 0).all()


def test_arrays_hold_the_same_as_rows(study):
    question = Question(
        ("friction_coefficient",), where="velocity > 0.05", columns=("load_number",), units={"velocity": "km/h"}
    )
    found = labelled(study, question, silent)
    listed = rows(study, outputs=("friction_coefficient",), where="velocity > 0.05")
    kept = found.friction_coefficient_mean.where(found.velocity > 3.6 * 0.05, drop=True)
    np.testing.assert_array_equal(kept.to_numpy().ravel(), listed["friction_coefficient_mean"])
    assert found.friction_coefficient_mean.isel(velocity=0).isnull().all()
    np.testing.assert_allclose(found.load_number, np.array(FORCES) / 0.1)
    assert found.state_counts.sel(state="failed").sum() == 1
    single = labelled(study, Question(("rms_slope",), statistics=None), silent)
    xr.testing.assert_identical(single, study[["rms_slope", "status"]])
    grouped = labelled(study, Question(("rms_slope",), group_by=("velocity",)), silent)
    assert grouped.rms_slope_mean.dims == ("group",)


REFUSED = [
    ({"columns": ("wear",)}, "no column 'wear'"),
    ({"where": "velocity > 1 N"}, "expected quantities of the same kind"),
    ({"where": "velocity"}, "expected a comparison"),
    ({"sort": ("velocty",)}, "no column 'velocty' (did you mean 'velocity'?)"),
    ({"group_by": ("velocty",)}, "expected the name of an axis for --group-by, got 'velocty' (did you mean 'velocity"),
    ({"group_by": ("velocity",), "statistics": None}, "expected statistics with --group-by"),
    ({"units": {"velocity": "N"}}, "velocity: expected a velocity"),
    ({"selections": ("velocity=9",)}, "no velocity 9 m/s"),
]


@pytest.mark.parametrize(("parts", "told"), REFUSED)
def test_a_wrong_question_is_one_sentence_before_any_row(study, parts, told):
    with pytest.raises(DataError) as refused:
        table(study, Question(**parts), 40, silent)
    assert told in str(refused.value)


def test_a_number_without_its_ingredients_names_them(study):
    for part in ({"columns": ("load_number",)}, {"where": "load_number > 1"}):
        with pytest.raises(DataError, match=r"load_number = .*: the study lacks shear_modulus"):
            table(study.drop_vars("shear_modulus"), Question(**part), 0, silent)


def test_the_first_rows_read_the_chunks_that_they_need(study):
    """Not the ledger of the whole study, which may have a hundred thousand chunks."""
    read = []

    def seen(block, block_info=None):
        read.append(block_info)
        return block

    chunked = study.chunk(normal_force=1, velocity=1)
    watched = chunked.map(
        lambda array: array.copy(data=array.data.map_blocks(seen, dtype=array.dtype, meta=array.data._meta))
    )
    answer = table(watched, Question(("rms_slope",)), 1, silent)
    assert len(next(answer.frames)) == 1
    assert (answer.total, answer.keys) == (12, 2)
    assert len(read) <= 4
