"""Figures from the command line: what is drawn, left out and reported."""

import hashlib
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from small_campaign import CAMPAIGN
from test_own_model import CAMPAIGN as PIN
from test_own_model import MODULE

import mdr_dask
from mdr_dask import plots
from mdr_dask.cli import main
from mdr_dask.plots.base import Plot
from mdr_dask.store import datasets

#: Figures of four speeds and two loads; whether they can be merged into a master curve is tested elsewhere.
HELD = {"velocity", "force", "contact_growth"}


def test_all_draws_what_the_store_holds(filled, capsys):
    assert main(["plot", filled, "--all", "-o", "drawn"]) == 0
    streams = capsys.readouterr()
    files = {path.name for path in Path("drawn").iterdir() if path.suffix == ".png"}
    assert files - {"small-master_curve.png"} == {f"small-{name}.png" for name in HELD}
    assert {path.stem for path in Path("drawn").glob("*.csv")} == {Path(file).stem for file in files}
    assert {line.rpartition("/")[2] for line in streams.out.splitlines() if "drawn/" in line} == files
    assert all((Path("drawn") / file).stat().st_size > 10_000 for file in files)
    for name in set(plots.available("sliding_friction")) - HELD - {"master_curve"}:
        assert f"{name}: left out: " in streams.err
    assert "Traceback" not in streams.err


def test_selected_values_are_stated(filled, capsys):
    capsys.readouterr()
    held = ["plot", filled, "friction_coefficient", "--over", "velocity", "--by", "velocity"]
    assert main([*held[:-2], "--select", "normal_force=0.1 N", "--size", "85mm", "-o", "one.png"]) == 0
    printed = capsys.readouterr().err
    assert all(part in printed for part in ("F_N = 0.1 N", "relaxation_time = 1 ms", "95 % intervals"))
    assert "held fixed: " in Path("one.csv").read_text()
    assert "normal_force = 100 mN" in Path("one.csv").read_text()
    assert "oversampling" not in Path("one.csv").read_text()  # a default setting of the solution
    map_of = ["plot", filled, "friction_coefficient", "--over", "normal_force", "--title", "Mine", "-o", "two.png"]
    assert main([*map_of, "--select", "velocity=1 m/s"]) == 0
    assert "v = 1 m/s" in capsys.readouterr().err
    assert main(["plot", filled, "velocity", "--select", "normal_farce=1"]) == 2
    assert "did you mean 'normal_force'" in capsys.readouterr().err
    assert main(["plot", filled, "velocity", "--series", "nowhere"]) == 2
    assert main(["plot", filled, "velociy"]) == 2
    assert "did you mean 'velocity'" in capsys.readouterr().err


def test_an_error_in_one_figure_does_not_prevent_the_others(filled, capsys, monkeypatch):
    def faulty(groups):
        raise KeyError("no such name")

    known = {name: plot for name, plot in plots.available("sliding_friction").items() if name == "velocity"}
    broken = Plot("broken", ("sliding_friction",), "a figure with a fault", faulty)
    monkeypatch.setattr(plots, "available", lambda model: {"broken": broken, **known})
    capsys.readouterr()
    assert main(["plot", filled, "--all", "-o", "drawn"]) == 2
    streams = capsys.readouterr()
    assert streams.out == "drawn/small-velocity.png\n"
    assert "broken: left out: internal error in the figure 'broken' of the module " in streams.err
    assert "Traceback" not in streams.err
    assert main(["plot", filled, "broken"]) != 0
    assert "Traceback" not in capsys.readouterr().err


def test_a_figure_of_an_output_has_its_data_and_their_origin_beside_it(filled, capsys):
    command = ["plot", filled, "friction_coefficient", "--over", "velocity", "--by", "normal_force"]
    units = ["--units", "velocity=km/h", "--units", "contact_fraction=%"]
    assert main([*command, *units, "--size", "85mm", "-o", "drawn/mu.pdf"]) == 0
    assert "--units contact_fraction: not shown in any figure that was drawn" in capsys.readouterr().err
    assert (Path("drawn") / "mu.pdf").read_bytes().startswith(b"%PDF")
    table = pd.read_csv("drawn/mu.csv", comment="#")
    data = table[table["what"] == "data"].set_index(["normal_force", "velocity"])
    (study,) = datasets(filled).values()
    mean = study["friction_coefficient"].mean("realisation").to_series()
    np.testing.assert_allclose(data["y"].reindex(mean.index), mean)
    np.testing.assert_allclose(data["x"], 3.6 * data.index.get_level_values("velocity"))
    assert np.all((data["y_low"] < data["y"]) & (data["y"] < data["y_high"]))
    head = "".join(line for line in Path("drawn/mu.csv").read_text().splitlines(True) if line.startswith("#"))
    digest = hashlib.sha256(CAMPAIGN.encode()).hexdigest()
    for text in (
        f"campaign small, sha256 {digest}, model sliding_friction",
        f"# command: mdr-dask plot {filled} friction_coefficient --over velocity",
        "# units: normal_force [N], velocity [m/s]",
    ):
        assert text in head
    shown = mdr_dask.plot(filled, "friction_coefficient", over="velocity", by="normal_force").table()
    np.testing.assert_array_equal(shown.loc[shown["what"] == "data", "y"], data["y"])


def test_several_figures_and_parts_of_a_study_are_drawn(filled, capsys):
    assert main(["plot", filled, filled, "contact_fraction", "--over", "velocity", "--over", "normal_force"]) == 0
    assert main(["plot", filled, "friction_coefficient", "rms_slope", "--over", "velocity", "-o", "drawn"]) == 0
    assert (Path("drawn") / "small-rms_slope-over-velocity.csv").exists()
    assert main(["plot", filled, "velocity", "--where", "friction_coefficient < 1e-4", "-o", "drawn/slow.png"]) == 0
    assert "not drawn: cases other than friction_coefficient < 1e-4" in capsys.readouterr().err
    slow = pd.read_csv("drawn/slow.csv", comment="#")
    mean = datasets(filled)[""]["friction_coefficient"].mean("realisation")
    assert len(slow[slow["what"] == "data"]) == int((mean < 1e-4).sum()) > 0


def test_a_warning_is_printed_once_for_all_figures(filled, capsys, monkeypatch):
    """Warnings are counted by case: the first and the last message are of two realisations of one case."""
    message = {"series": "", "status": "done", "case": {}, "attempt": 0}
    texts = ["the film is thin: ratio 0.2; the load is high", "the film is thin: ratio 0.3", "the film is thin"]
    places = ([0, 0, 0], [1, 0, 0], [0, 0, 1])
    found = [message | {"message": text, "place": place} for text, place in zip(texts, places, strict=True)]
    monkeypatch.setattr("mdr_dask.questions.progress.messages", lambda *_: found)
    assert main(["plot", filled, "velocity", "force", "-o", "drawn"]) == 0
    errors = capsys.readouterr().err.splitlines()
    assert f"all figures: warning: the film is thin (2 cases of {filled})" in errors
    assert sum("warning: the load is high" in line for line in errors) == 1
    assert "warning: the film is thin" in Path("drawn/small-force.csv").read_text()
    first, *_ = datasets(filled)[""]["status"].dims
    chosen = float(datasets(filled)[""][first][1])
    assert main(["plot", filled, "friction_coefficient", "--select", f"{first}={chosen!r}", "-o", "one.png"]) == 0
    errors = capsys.readouterr().err
    assert f"warning: the film is thin (1 case of {filled})" in errors
    assert "the load is high" not in errors


def test_the_look_of_a_figure_needs_a_figure(filled, capsys):
    assert main(["fit", filled, "calibration", "--size", "85mm"]) == 2
    assert "need --plot FILE" in capsys.readouterr().err


def test_outputs_of_a_model_of_ones_own_have_figures_too(tmp_path, monkeypatch, capsys):
    view = "--over normal_force --by sliding_distance"
    (tmp_path / "wear_rate.py").write_text(MODULE)
    (tmp_path / "pin.yaml").write_text(PIN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "wear_rate", raising=False)
    assert main(["run", "pin.yaml", "--quiet"]) == 0
    capsys.readouterr()
    assert main(["plot", "results/pin.zarr"]) == 0
    listed = capsys.readouterr().out
    assert "wear_volume" in listed.splitlines()[0]
    assert "axes: normal_force, sliding_distance" in listed
    assert main(["plot", "results/pin.zarr", "--all", "-o", "all"]) == 0
    against = pd.read_csv("all/pin-wear_volume.csv", comment="#")
    assert set(against["normal_force"]) == set(datasets("results/pin.zarr")[""]["normal_force"].values)
    units = ["--units", "wear_volume=m^3"]
    assert main(["plot", "results/pin.zarr", "wear_volume", *view.split(), *units, "-o", "own.svg"]) == 0
    table = pd.read_csv("own.csv", comment="#")
    (study,) = datasets("results/pin.zarr").values()
    wanted = study["wear_volume"].mean("realisation").values.ravel()
    drawn = table["value" if "value" in table else "y"]
    assert all(np.isclose(drawn, mean, rtol=1e-9, atol=0).any() for mean in wanted)
    sys.modules.pop("wear_rate", None)
