"""The command master-curve on a measured table."""

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


def test_factors_merged_curve_and_figure_are_written(tmp_path, capsys):
    factors, curve, figure = tmp_path / "new" / "factors.csv", tmp_path / "curve.csv", tmp_path / "master.png"
    options = ["--reference", "45", "-o", str(factors), "--plot", str(figure), "--json"]
    assert main(["master-curve", str(TABLE), *options]) == 0
    found = json.loads(capsys.readouterr().out)
    shifts, groups = found["data_vars"]["shift_factor"]["data"], found["coords"]["T"]["data"]
    assert abs(np.interp(45.0, groups, shifts)) < 0.3
    assert "a modulus: b_T" in found["attrs"]["vertical"]
    assert figure.stat().st_size > 10_000
    assert factors.read_text().splitlines()[0].startswith("T [degC],shift_factor,shift_factor_error")
    assert factors.read_text().splitlines()[0].endswith(",log10 a_T")
    assert main(["master-curve", str(TABLE), "--show", "curve", "-o", str(curve)]) == 0
    assert curve.read_text().splitlines()[0] == "curve,t [s],E_relax [MPa],curve_error"
    printed = capsys.readouterr()
    assert "the law wlf deviates from the factors by" in printed.err
    assert "shifted: E_relax; a modulus: b_T" in printed.err


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("normal_force,velocity\n1,2\n", "name columns by --over, --of and --by"),
        ("frequncy,T,G'\n1,2,3\n2,3,4\n", "got frequncy (did you mean 'frequency'?), T, G': name"),
        ("force,mu,velocity\n1,0.5,1\n2,0.4,1\n", "two or more values of 'velocity', got one value"),
        ("normal_force,velocity,mu\n1,2,3 N\n1,3,4\n", ":2: column mu: expected a number, got '3 N'"),
    ],
)
def test_a_table_without_what_is_needed_is_one_clear_error(tmp_path, capsys, content, message):
    path = tmp_path / "table.csv"
    path.write_text(content)
    assert main(["master-curve", str(path)]) == 2
    assert message in capsys.readouterr().err


def table_of_two_groups(path):
    rows = [
        f"{force},{velocity},{kelvin},{1 / (1 + (force * velocity**-0.15 * 10 ** (0.02 * (kelvin - 300))) ** -0.7)}"
        for force in np.geomspace(1, 100, 12)
        for velocity in (1e-3, 1e-2, 1e-1)
        for kelvin in (290, 300, 310)
    ]
    path.write_text("force,velocity,temperature,mu\n" + "\n".join(rows))


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
    assert main(["master-curve", str(path)]) == 2
    assert "varies in 'temperature' too: keep one of its values" in capsys.readouterr().err
    assert main(["master-curve", str(path), "--series", "one"]) == 2
    assert "a table has no series, got --series one" in capsys.readouterr().err
