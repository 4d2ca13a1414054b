"""``show`` returns the same rows in every output format."""

import csv
import io
import json
import re

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from planted import ROLLERS, SLIDING, make

from mdr_dask import aggregate
from mdr_dask.cli import main
from mdr_dask.cli.answers import print_answer
from mdr_dask.questions.table import Table

ASKED = ("friction_coefficient", "--where", "velocity > 5 mm/s", "--sort", "-friction_coefficient")
COLUMNS = ["normal_force", "velocity", "friction_coefficient_mean", "friction_coefficient_standard_error"]
COLUMNS += ["friction_coefficient_grid_error", "realisations", "status"]
FORCES = "  normal_force: [0.1 N, 1 N, 10 N]\n  velocity: {geometric: [1 mm/s, 1 m/s, 7]}\n"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A planted study in which the first case and the last result failed."""
    folder = tmp_path_factory.mktemp("questions")
    make(folder, SLIDING + FORCES, failed=True)
    return str(folder / "study.zarr")


@pytest.fixture
def expected(study):
    data = xr.open_zarr(study)
    mean = data.friction_coefficient.mean("realisation").to_series().rename("mean").reset_index()
    kept = mean[mean.velocity > 5e-3].sort_values("mean", ascending=False, na_position="last")
    return kept.to_numpy()


def output(capsys, *arguments):
    assert main([*arguments]) == 0
    return capsys.readouterr()


def rows(text):
    """Return the rows of a printed table, without the lines above them and the headings."""
    return [line for line in text.splitlines() if re.match(r"\s*[-+.\d]", line) and "=" not in line]


def test_every_form_holds_the_same_rows(study, expected, tmp_path, capsys):
    frames = {}
    frames["csv"] = pd.read_csv(io.StringIO(output(capsys, "show", study, *ASKED, "--csv").out))
    frames["csv"].columns = [title.partition(" [")[0] for title in frames["csv"]]
    document = json.loads(output(capsys, "show", study, *ASKED, "--json").out)
    assert document["units"]["velocity"] == "m/s"
    frames["json"] = pd.DataFrame(document["rows"])
    for suffix in ("csv", "json"):
        path = tmp_path / f"rows.{suffix}"
        assert output(capsys, "show", study, *ASKED, "-o", str(path)).out.startswith(
            f"{path}: {len(expected)} rows of "
        )
    assert (tmp_path / "rows.csv").read_text() == output(capsys, "show", study, *ASKED, "--csv").out
    assert json.loads((tmp_path / "rows.json").read_text()) == document
    for form, frame in frames.items():
        assert list(frame) == COLUMNS, form
        np.testing.assert_array_equal(frame[COLUMNS[:3]].to_numpy(dtype=float), expected, err_msg=form)
        assert frame["status"].value_counts().to_dict() == {"done": len(frame) - 1, "1 failed": 1}, form


def test_printed_tables_are_limited_and_count_the_other_rows(study, expected, capsys):
    streams = output(capsys, "show", study, *ASKED, "--limit", "3")
    lines = rows(streams.out)
    assert "in these rows: realisations = 4, status = done" in " ".join(streams.out.split())
    assert [float(line.split()[0]) for line in lines] == expected[:3, 0].tolist()
    assert all(" +- " in line for line in lines)
    assert streams.err == f"... {len(expected) - 3} more rows (--limit 0 prints all)\n"
    whole = output(capsys, "show", study, *ASKED, "--limit", "0")
    assert len(rows(whole.out)) == len(expected)
    assert not whole.err
    assert output(capsys, "show", study, "--limit", "4").err == "... 17 more rows (--limit 0 prints all)\n"
    assert output(capsys, "show", study, "--where", "velocity > 1 mm/s", "--limit", "4").err.startswith("... more rows")
    none = output(capsys, "show", study, "--where", "velocity > 1 km/s")
    assert (none.out, none.err) == ("", "no rows\n")


def test_statistics_have_columns_and_single_results_have_a_status(study, capsys):
    asked = ("--group-by", "normal_force", "--statistic", "interval", "--statistic", "quantile", "--csv")
    titles = output(capsys, "show", study, "rms_slope", *asked).out.splitlines()[0].split(",")
    assert {"rms_slope_low", "rms_slope_quantile_0.05", "cases"} <= {*titles}
    out = output(capsys, "show", study, "rms_slope", "--realisations", "--csv").out
    rows = list(csv.DictReader(io.StringIO(out)))
    assert len(rows) == 84
    assert {(row["status"], row["rms_slope"] == "nan") for row in rows} == {("done", False), ("failed", True)}


def test_labelled_arrays_carry_units_numbers_and_states(study, tmp_path, capsys):
    path = tmp_path / "answer.nc"
    arguments = ["--columns", "load_number,friction_coefficient", "--units", "velocity=km/h"]
    arguments += ["--where", "velocity > 5 mm/s"]
    assert "variables over" in output(capsys, "show", study, *arguments, "-o", str(path)).out
    with xr.open_dataset(path) as found:
        assert found.velocity.attrs["units"] == "km/h"
        assert found.load_number.dims == ("normal_force",)
        assert found.friction_coefficient_mean.isnull().sum() == 3 * 2
        assert found.state_counts.sel(state="failed").sum() == 1


def test_a_table_to_read_has_the_units_of_the_campaign_and_a_file_has_those_of_si(tmp_path, capsys):
    axes = "  rotation_speed: [10 rpm, 1000 rpm]\n  temperature: [40 degC, 60 degC]\n  normal_force: [1 kN, 200 N]\n"
    make(tmp_path, ROLLERS + axes)
    asked = ("show", str(tmp_path / "study.zarr"), "film_ratio")
    out = output(capsys, *asked).out
    assert re.search(r"\[rpm\] +\[degC\] +\[N\]", out)
    assert rows(out)[0].split()[:3] == ["10", "40", "200"]
    assert rows(output(capsys, *asked, "--units", "temperature=K").out)[0].split()[:2] == ["10", "313.15"]
    head, first, *_ = output(capsys, *asked, "--csv").out.splitlines()
    assert head.startswith("rotation_speed [rad/s],temperature [K],normal_force [N],")
    assert first.startswith("1.0471975511965976,313.15,200.0,")


def test_a_study_with_series_lists_them(tmp_path, capsys):
    make(
        tmp_path,
        SLIDING + "  normal_force: 1 N\n  velocity: 1 m/s\nseries:\n  a: {hurst: [0.3, 0.7]}\n  b: {hurst: [1]}\n",
    )
    store = str(tmp_path / "study.zarr")
    assert main(["show", store]) == 2
    assert (
        capsys.readouterr().err
        == "expected --series (in Python series=) with one of a, b, because this study has series\n"
    )
    assert len(rows(output(capsys, "show", store, "rms_slope", "--series", "a").out)) == 2


@pytest.mark.parametrize(
    ("call", "told"), [("show STORE --columns a/b", "formulas"), ("plot STORE a/b", "no store, figure")]
)
def test_a_formula_is_refused_where_a_name_is_expected(study, capsys, call, told):
    assert main(call.replace("STORE", study).split()) == 2
    assert told in capsys.readouterr().err


def test_names_of_outputs_and_laws_have_every_form(study, capsys):
    both = output(capsys, "show", study, "rms_slope,friction_coefficient", "--csv").out
    assert both == output(capsys, "show", study, "rms_slope", "friction_coefficient", "--csv").out
    assert "zone_one" in {row["law"] for row in json.loads(output(capsys, "fit", study, "--json").out)["rows"]}


def test_without_h5py_netcdf_is_one_message_and_no_file(study, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("mdr_dask.store.reading.find_spec", lambda name: None if name == "h5py" else name)
    path = tmp_path / "means.nc"
    assert main(["show", study, "-o", str(path)]) == 2
    assert "mdr_dask[netcdf]" in capsys.readouterr().err
    assert not path.exists()


def test_means_from_python_can_be_written_to_netcdf(study, tmp_path):
    path = tmp_path / "means.nc"
    aggregate(study).to_netcdf(path)
    with xr.open_dataset(path) as found:
        assert "friction_coefficient_mean" in found


def test_an_error_that_is_zero_in_all_rows_is_not_printed(capsys):
    frame = pd.DataFrame({"a_mean": [1.0, 2.0], "a_standard_error": [0.0, 1e-17], "a_grid_error": [0.0, 0.5]})
    print_answer(Table(iter([frame]), dict.fromkeys(frame, "m"), 2, 0), "table", 0, True)
    assert capsys.readouterr().out.split("\n")[0] == "mean +- grid error"


def test_numbers_of_a_model_are_listed(capsys):
    text = output(capsys, "models", "sliding_friction").out
    assert "normal_force / (shear_modulus" in " ".join(text.split())
    assert max(map(len, text.splitlines())) <= 100
    document = json.loads(output(capsys, "models", "ehl_line", "--json").out)
    assert "speed_parameter" in [number["number"] for number in document["numbers"]]
