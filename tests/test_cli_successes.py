"""Further commands that succeed, with their options."""

import json
from pathlib import Path

import planted
import pytest
import xarray as xr
from planted import SLIDING

from mdr_dask import campaign, fits
from mdr_dask.cli import main

TABLE = Path(__file__).parent / "data/dma/time_user_raw.csv"


@pytest.fixture
def store(tmp_path, monkeypatch):
    """A study of sliding friction whose numbers are planted: forces and velocities."""
    monkeypatch.chdir(tmp_path)
    axes = "  normal_force: {geometric: [1 mN, 100 N, 5]}\n  velocity: {geometric: [0.001 mm/s, 1 km/s, 6]}\n"
    planted.make(tmp_path, SLIDING + axes)
    return "study.zarr"


@pytest.mark.parametrize("command", [["init", "sliding_friction"], ["schema"]])
def test_printed_text_equals_the_written_file(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(command) == 0
    printed = capsys.readouterr().out
    assert main([*command, "-o", "campaign.yaml"]) == 0
    assert Path("campaign.yaml").read_text() == printed
    if command == ["schema"]:
        assert json.loads(printed) == campaign.json_schema()
    else:
        assert main(["check", "campaign.yaml"]) == 0


def test_laws_of_a_store_are_listed_each_with_its_sentence(store, capsys):
    assert main(["fit", store]) == 0
    printed = capsys.readouterr().out
    known = fits.available("sliding_friction")
    assert [line.split()[0] for line in printed.splitlines() if not line.startswith(" ")] == list(known)
    assert all(law.summary in " ".join(printed.split()) for law in known.values())


def test_a_table_can_be_given_to_a_calibration_and_to_nothing_else(store, capsys):
    data = xr.open_zarr(store)
    force = data["normal_force"].values[2]
    at = data.sel(normal_force=force)["friction_coefficient"].mean("realisation")
    rows = [f"{v},{m},{0.02 * m}" for v, m in zip(data["velocity"].values, at.values, strict=True)]
    Path("rig.csv").write_text("\n".join(["velocity [m/s],friction_coefficient,standard_error", *rows]))
    assert main(["fit", store, "calibration", "--measured", "rig.csv", "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["rows"]
    assert found["normal_force_low"] < force < found["normal_force_high"]
    assert main(["fit", store, "plateau", "--measured", "rig.csv"]) == 2
    assert "--measured and --plot can be used only with `calibration`" in capsys.readouterr().err


def test_a_refused_law_is_named_after_the_others(store, capsys):
    assert main(["fit", store, "collapse", "indenter", "plateau"]) == 2
    printed = capsys.readouterr()
    assert "plateau" in printed.out
    assert "indenter: expected" in printed.err


def test_an_interrupted_command_reports_that_results_are_kept(monkeypatch, capsys):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(campaign, "json_schema", stopped)
    assert main(["schema"]) == 130
    assert capsys.readouterr().err.strip().startswith("interrupted; finished results are kept")
