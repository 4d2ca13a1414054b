"""Studies from Python: the same numbers and messages as the command line."""

import io
import shutil
import sys
import time
from contextlib import contextmanager
from types import ModuleType, SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from planted import SLIDING, make

import mdr_dask
from mdr_dask import bars, models, studies
from mdr_dask.cli import main
from mdr_dask.errors import CampaignError, DataError, StoreError

SMALL = {
    "model": "sliding_friction",
    "realisations": 6,
    "parameters": {
        "length": "20 mm",
        "points": 200,
        "rms_roughness": 5e-7,
        "shear_modulus": "10 MPa",
        "relaxation_time": "1 ms",
        "normal_force": ["0.1 N", 1],
        "velocity": np.geomspace(1e-3, 1, 4),
    },
    "outputs": ["friction_coefficient", "rms_slope"],
}


@pytest.fixture(scope="module")
def study():
    return mdr_dask.run(SMALL, progress=False)


@pytest.fixture(scope="module")
def url(study, tmp_path_factory):
    """The same in a store with a name."""
    folder = tmp_path_factory.mktemp("studies") / "small.zarr"
    mdr_dask.run(SMALL, store=folder, progress=False)
    return str(folder)


def test_a_dictionary_becomes_a_dataset_and_is_found_again(study, monkeypatch):
    assert dict(study.sizes) == {"normal_force": 2, "velocity": 4, "realisation": 6}
    assert (study.status == 1).all()
    assert study.friction_coefficient.attrs["units"] == "1"
    monkeypatch.setattr("mdr_dask.models.sliding_friction.solve.compute", None)  # nothing is computed again
    xr.testing.assert_identical(mdr_dask.run(SMALL, progress=False), study)


def test_a_store_holds_the_same_values_and_is_opened_by_its_path(study, url):
    opened = mdr_dask.open(url)
    np.testing.assert_array_equal(opened.friction_coefficient, study.friction_coefficient)
    assert "indentation_depth" not in opened


def test_python_and_the_command_line_give_the_same_table(url, capsys):
    asked = {"where": "velocity > 5 mm/s", "sort": ["-friction_coefficient"], "units": {"velocity": "km/h"}}
    found = mdr_dask.table(url, ["friction_coefficient"], **asked)
    command = ["show", url, "friction_coefficient", "--where", asked["where"], "--sort", asked["sort"][0]]
    assert main([*command, "--units", "velocity=km/h", "--csv"]) == 0
    printed = pd.read_csv(io.StringIO(capsys.readouterr().out))
    assert found.attrs["units"]["velocity"] == "km/h"
    pd.testing.assert_frame_equal(found.set_axis(list(printed), axis=1), printed)


def test_a_figure_is_shown_in_a_notebook(study):
    assert mdr_dask.plot(study, "velocity")._repr_png_().startswith(b"\x89PNG")


def test_laws_are_fitted_to_a_dataset_and_to_its_path(tmp_path):
    loads = "  normal_force: {geometric: [2 mN, 25 mN, 8]}\n  velocity: {geometric: [0.1 mm/s, 10 m/s, 11]}\n"
    planted = make(tmp_path, SLIDING + loads)[""]
    found = mdr_dask.fit(planted, "zone_one")
    assert found.law_holds.item().startswith("yes")
    xr.testing.assert_identical(planted.mdr.fit("zone_one"), found)
    xr.testing.assert_identical(mdr_dask.fit(tmp_path / "study.zarr", "zone_one"), found)


def test_the_accessor_returns_numbers_states_and_parts(study):
    found = study.mdr.numbers
    np.testing.assert_allclose(found.load_number, study.normal_force / (1e7 * 5e-7 * 0.02))
    np.testing.assert_allclose(found.deborah, study.velocity * 1e-3 / 0.02)
    assert set(found.velocity_number.dims) == {"normal_force", "velocity"}
    assert (study.mdr.states == "done").all()
    assert study.mdr.select("velocity=0.1..1", "normal_force=1").sizes["velocity"] == 2
    assert study.mdr.where("load_number > 5").friction_coefficient.notnull().sum() == 4 * 6
    assert len(study.mdr.table("rms_slope", group_by=("normal_force",))) == 2
    assert study.mdr.aggregate(statistics=["count"]).friction_coefficient_count.min() == 6
    assert study.mdr.plot("velocity").axes


def test_series_become_a_tree_and_are_named(tmp_path):
    parameters = {**SMALL["parameters"], "normal_force": 1, "velocity": 1}
    asked = {**SMALL, "parameters": parameters, "series": {"rough": {"hurst": [0.3, 0.7]}, "flat": {"hurst": 1.0}}}
    tree = mdr_dask.run(asked, tmp_path / "series.zarr", progress=False)
    assert sorted(tree.children) == ["flat", "rough"]
    assert tree["rough"].friction_coefficient.sizes["hurst"] == 2
    assert len(mdr_dask.table(tree, series="rough")) == 2
    with pytest.raises(DataError, match=r"expected --series \(in Python series=\) with one of rough, flat"):
        mdr_dask.aggregate(tree)


def test_an_interrupted_cell_goes_on_where_it_stopped(tmp_path, monkeypatch):
    """The interrupt comes after a block; the next call keeps it, and ends with the numbers of an undisturbed run."""
    asked = {**SMALL, "store": {"path": str(tmp_path / "study.zarr"), "blocks": {"normal_force": 1, "realisation": 2}}}

    @contextmanager
    def interrupting(quiet):
        def report(state):
            if state.done:
                raise KeyboardInterrupt

        yield report

    kept = []

    @contextmanager
    def watching(quiet):
        yield lambda state: kept.append(state.kept)

    monkeypatch.setattr(studies, "reporter", interrupting)
    with pytest.raises(KeyboardInterrupt):
        mdr_dask.run(asked)
    monkeypatch.setattr(studies, "reporter", watching)
    resumed = mdr_dask.run(asked)
    assert 0 < kept[0] < resumed.status.size
    assert (resumed.status == 1).all()


def test_check_prints_what_the_command_prints(tmp_path, monkeypatch, capsys):
    asked = {**SMALL, "parameters": {**SMALL["parameters"], "velocity": [1, 2], "shear_modulus": 10}}
    found = mdr_dask.check(asked)
    assert (found.cases, found.results) == (4, 24)
    campaign = tmp_path / "study.yaml"
    campaign.write_text(mdr_dask.read(asked).text)
    monkeypatch.delenv("COLUMNS", raising=False)
    assert main(["check", str(campaign)]) == 0
    printed = capsys.readouterr()
    assert repr(found).splitlines()[1:-1] == printed.out.splitlines()[1:]
    assert found.questions[0].startswith("parameters.shear_modulus: 10 is read as 10 Pa")
    assert found.questions[0] in printed.err
    with pytest.warns(UserWarning, match="shear_modulus"):
        mdr_dask.run(asked, tmp_path / "asked.zarr", progress=False)


REFUSED = [
    (lambda: mdr_dask.check({**SMALL, "realisation": 3}), CampaignError, "realisation: unknown key (did"),
    (lambda: mdr_dask.run({"model": "slidin_friction"}), CampaignError, "did you mean 'sliding_friction'"),
    (lambda: mdr_dask.run({"model": models.load("ehl_line")}), CampaignError, "model: expected numbers, texts"),
    (lambda: mdr_dask.run({"model": "json:loads", "parameters": {}}), CampaignError, "(see docs/own-model.md)"),
    (lambda: mdr_dask.open("nowhere.zarr"), StoreError, "nowhere.zarr: no store here"),
]


@pytest.mark.parametrize(("call", "error", "message"), REFUSED)
def test_exceptions_have_the_messages_of_the_command_line(call, error, message):
    with pytest.raises(error) as refused:
        call()
    assert message in str(refused.value)
    assert "campaign:" not in str(refused.value)


UNFIT = [
    (lambda study: mdr_dask.fit(study, "zone_on"), "no law for sliding_friction is called 'zone_on'"),
    (lambda study: mdr_dask.plot(study, "stribeck"), "no figure of sliding_friction is called 'stribeck'"),
    (
        lambda study: mdr_dask.aggregate(study, statistics="medan"),
        "no statistic is called 'medan' (did you mean 'mean'?)",
    ),
    (lambda study: mdr_dask.plot(xr.Dataset(), "velocity"), "expected a study as returned by run or open"),
    (lambda study: mdr_dask.plot(study.isel(realisation=0), "velocity"), "isel(realisation=[0]) keeps"),
    (
        lambda study: mdr_dask.table(study.friction_coefficient),
        "expected a study as returned by run or open, or its path, got DataArray",
    ),
    (lambda study: mdr_dask.fit(study.mean("realisation"), "plateau"), "the dimension 'realisation'"),
]


@pytest.mark.parametrize(("call", "message"), UNFIT)
def test_invalid_datasets_and_names_are_one_message(call, message, study):
    with pytest.raises(DataError) as refused:
        call(study)
    assert message in str(refused.value)


def test_a_string_is_accepted_instead_of_a_sequence(study):
    parts = {"select": "velocity=1 mm/s", "group_by": "normal_force", "columns": "load_number"}
    one = mdr_dask.aggregate(study, statistics="mean", **parts)
    xr.testing.assert_identical(
        one, mdr_dask.aggregate(study, statistics=["mean"], **{key: [word] for key, word in parts.items()})
    )
    assert "friction_coefficient_mean" in one
    assert "friction_coefficient_standard_error" not in one
    assert len(mdr_dask.table(study, "rms_slope", sort="normal_force", select="velocity=1")) == 2


def test_failed_results_are_a_warning(toy, tmp_path):
    asked = {"model": "toy", "realisations": 2, "parameters": {"position": [1, 2, 3], "fail_above": 2}}
    with pytest.warns(UserWarning, match=r"2 of 6 results failed; mdr-dask status .* --failures shows the reasons"):
        found = mdr_dask.run(asked, tmp_path / "toy.zarr", progress=False)
    assert found.mdr.states.to_numpy().tolist() == ["done", "done", "2 failed"]


def test_a_run_in_a_notebook_moves_its_bar(monkeypatch):
    shown = []
    room = ModuleType("IPython.display")
    room.HTML = str
    room.display = lambda html, display_id: SimpleNamespace(update=shown.append)
    monkeypatch.setitem(sys.modules, "ipykernel", ModuleType("ipykernel"))
    monkeypatch.setitem(sys.modules, "IPython.display", room)
    monkeypatch.setattr(bars, "LOOK", 0.02)
    with bars.reporter(quiet=False) as report:
        report(studies.execute.__globals__["Progress"](total=10, done=4))
        end = time.monotonic() + 20
        while not shown and time.monotonic() < end:
            time.sleep(0.01)
    assert 'value="4" max="10"' in shown[0]


def test_a_damaged_chunk_is_named_where_python_reads_it(study, url, tmp_path):
    damaged = tmp_path / "damaged.zarr"
    shutil.copytree(url, damaged)
    chunk = next(path for path in (damaged / "friction_coefficient/c").rglob("*") if path.is_file())
    chunk.write_bytes(b"not what was written")
    opened = mdr_dask.open(damaged)
    for call in (
        lambda: mdr_dask.table(opened),
        lambda: mdr_dask.aggregate(opened).compute(),
        lambda: mdr_dask.plot(opened, "velocity"),
        lambda: opened.friction_coefficient.mean(),
    ):
        with pytest.raises(StoreError, match=r"friction_coefficient/c/.* is damaged; 'mdr-dask verify"):
            call()
    (damaged / "zarr.json").write_text("{")
    with pytest.raises(StoreError, match=r"zarr\.json is damaged; 'mdr-dask verify"):
        mdr_dask.open(damaged)
