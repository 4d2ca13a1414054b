"""The command master-curve on a measured table, kept and re-referenced."""

import json
import tempfile
from pathlib import Path

import numpy as np
import pytest

from mdr_dask.cli import main

WHOLE = Path(__file__).parent / "data/dma/time_user_raw.csv"
TABLE = Path(tempfile.mkdtemp()) / "relaxation.csv"  # four of its temperatures, 40 to 62 degC
TABLE.write_text(
    "\n".join([line for i, line in enumerate(WHOLE.read_text().splitlines()) if i < 2 or 121 < i < 162]) + "\n"
)


def test_a_table_is_shifted_kept_drawn_and_referenced_anew(tmp_path, capsys):
    kept, figure = tmp_path / "kept.json", tmp_path / "master.png"
    options = ["--reference", "45", "--keep", str(kept), "--plot", str(figure), "--json"]
    assert main(["master-curve", str(TABLE), *options]) == 0
    first = json.loads(capsys.readouterr().out)
    factors = np.array(first["data_vars"]["shift_factor"]["data"])
    groups = np.array(first["coords"]["T"]["data"])
    assert abs(np.interp(45.0, groups, factors)) < 0.3
    assert "a modulus: b_T" in first["attrs"]["vertical"]
    assert figure.stat().st_size > 10_000
    assert main(["master-curve", str(kept), "--reference", "60", "--json"]) == 0
    second = json.loads(capsys.readouterr().out)
    moved = np.array(second["data_vars"]["shift_factor"]["data"])
    np.testing.assert_allclose(np.diff(moved), np.diff(factors), atol=1e-10)
    assert abs(np.interp(60.0, groups, moved)) < 0.1


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("normal_force,velocity\n1,2\n", "name columns by --over, --of and --by"),
        ("frequncy,T,G'\n1,2,3\n2,3,4\n", "got frequncy (did you mean 'frequency'?), T, G': name"),
        ("force,mu,velocity\n1,0.5,1\n2,0.4,1\n", "two or more values of 'velocity', got one value"),
        ("normal_force,velocity,mu\n1,2,3 N\n1,3,4\n", ":2:5: expected a number, got '3 N'"),
    ],
)
def test_a_table_without_what_is_needed_is_one_clear_error(tmp_path, capsys, content, message):
    path = tmp_path / "table.csv"
    path.write_text(content)
    assert main(["master-curve", str(path)]) == 2
    assert message in capsys.readouterr().err


def test_factors_and_merged_curve_are_written_and_kept_results_are_recognised(tmp_path, capsys):
    factors, curve, kept = tmp_path / "new" / "factors.csv", tmp_path / "curve.csv", tmp_path / "kept.json"
    assert main(["master-curve", str(TABLE), "-o", str(kept)]) == 0
    assert main(["master-curve", str(kept), "-o", str(factors)]) == 0
    other = kept.rename(tmp_path / "kept.dat")
    assert main(["master-curve", str(other), "--reference", "60", "--show", "curve", "-o", str(curve)]) == 0
    assert factors.read_text().splitlines()[0].startswith("T [degC],shift_factor,shift_factor_error")
    assert factors.read_text().splitlines()[0].endswith(",log10 a_T")
    assert curve.read_text().splitlines()[0] == "curve,t [s],E_relax [MPa],curve_error"
    printed = capsys.readouterr()
    assert "the law wlf deviates from the factors by" in printed.err
    assert "shifted: E_relax; a modulus: b_T" in printed.err
    assert main(["master-curve", str(other), "--vertical", "free"]) == 2
    assert "was written by --keep: only --reference can be changed" in capsys.readouterr().err


def test_a_file_that_holds_no_master_curve_is_named(tmp_path, capsys):
    path = tmp_path / "other.json"
    path.write_text("{}")
    assert main(["master-curve", str(path)]) == 2
    assert "this is not a master curve that --keep has written" in capsys.readouterr().err


def table_of_two_groups(path):
    rows = [
        f"{force},{velocity},{kelvin},{1 / (1 + (force * velocity**-0.15 * 10 ** (0.02 * (kelvin - 300))) ** -0.7)}"
        for force in np.geomspace(1, 100, 12)
        for velocity in (1e-3, 1e-2, 1e-1)
        for kelvin in (290, 300, 310)
    ]
    path.write_text("force,velocity,temperature,mu\n" + "\n".join(rows))


def test_two_groups_are_drawn_printed_and_referenced_anew(tmp_path, capsys):
    path, kept, figure = tmp_path / "table.csv", tmp_path / "kept.json", tmp_path / "master.png"
    table_of_two_groups(path)
    assert main(["master-curve", str(path), "--keep", str(kept), "--plot", str(figure), "--csv"]) == 0
    printed = capsys.readouterr()
    assert "second_factor" in printed.out
    assert "chi-squared of the sum" in printed.err
    assert figure.stat().st_size > 10_000
    assert main(["master-curve", str(kept), "--reference", "0.001", "--json"]) == 0
    moved = json.loads(capsys.readouterr().out)["data_vars"]
    np.testing.assert_allclose(moved["shift_factor"]["data"], [0, -0.15, -0.3], atol=2e-3)
    np.testing.assert_allclose(moved["second_factor"]["data"], [-0.2, 0, 0.2], atol=2e-3)


def test_rows_of_a_table_are_selected_as_those_of_a_store(tmp_path, capsys):
    path = tmp_path / "table.csv"
    table_of_two_groups(path)
    assert (
        main(["master-curve", str(path), "--select", "temperature=299", "--select", "velocity=0..0.05", "--csv"]) == 0
    )
    printed = capsys.readouterr().out.splitlines()
    assert [line.split(",")[0] for line in printed[1:]] == ["0.001", "0.01"]
    path.write_text(path.read_text().replace("temperature", "temperature [K]", 1))
    selected = ["--select", "temperature=26.85 degC", "--select", "velocity=0..0.05", "--csv"]
    assert main(["master-curve", str(path), *selected]) == 0
    assert capsys.readouterr().out.splitlines() == printed
    assert main(["master-curve", str(path), "--select", "humidity=1"]) == 2
    assert "(known: force, velocity, temperature, mu)" in capsys.readouterr().err
    assert main(["master-curve", str(path), "--vertical", "free"]) == 2
    assert "keep one value of 'temperature" in capsys.readouterr().err
    assert main(["master-curve", str(path), "--series", "one"]) == 2
    assert "a table has no series, got --series one" in capsys.readouterr().err
