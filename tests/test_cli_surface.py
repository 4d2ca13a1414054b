"""The command surface: from files of an instrument to statistics, a figure, and a spectrum that a campaign takes."""

import json

import numpy as np
import pandas as pd
import pytest
from references.areal import areal_surface

from mdr_dask.cli import main
from mdr_dask.models.parts.surface import Surface, spectra_of
from mdr_dask.physics.surfaces.spectrum import self_affine

LENGTH, POINTS, HURST = 4e-3, 512, 0.8
SPECTRUM = self_affine(HURST, LENGTH, LENGTH / 250, 3e-5, LENGTH / 16)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for k in range(2):
        height = 1e6 * areal_surface(SPECTRUM, (POINTS, POINTS), (LENGTH, LENGTH), 5, k)
        np.save(f"road{k}.npy", height.T)
    place = np.arange(POINTS) * LENGTH / POINTS * 1e3
    np.savetxt("scan.csv", np.column_stack([place, height[100]]), delimiter=",", header="x [mm],z [um]", comments="")
    return tmp_path


MAPS = ["road0.npy", "road1.npy", "--spacing", f"{LENGTH / POINTS * 1e6}um", "--unit", "um"]


def test_maps_to_numbers_figure_and_spectrum(folder, capsys):
    assert main(["surface", *MAPS, "--json", "-o", "c2d.csv", "--plot", "road.png"]) == 0
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert document["units"]["Sq"] == "m"
    for row in document["rows"]:
        assert row["rms_gradient"] == pytest.approx(SPECTRUM.rms_gradient(), rel=0.1)
        assert row["rms_gradient"] == pytest.approx(np.hypot(row["slope_x"], row["slope_y"]), rel=1e-9)
        assert row["hurst_low"] < HURST < row["hurst_high"]
        assert row["rolloff_low"] < LENGTH / 16 < row["rolloff_high"]
        assert row["cutoff"] is None
        assert row["resolution"] == pytest.approx(2 * LENGTH / POINTS)
        assert row["anisotropy"] < 0.1
    assert "plane subtracted, Hann's window" in err
    assert (folder / "road.png").stat().st_size > 10_000
    drawn = pd.read_csv(folder / "road.csv", comment="#")
    assert "# files: road0.npy, road1.npy" in (folder / "road.csv").read_text().splitlines()
    taken = drawn[(drawn["what"] == "line of the method, pi q C^{2D}") & (drawn["file"] == "road1.npy")]
    expected = np.pi * taken["x"] * SPECTRUM.at(taken["x"].to_numpy())
    assert np.median(taken["y"] / expected) == pytest.approx(1, rel=0.1)
    bins = drawn[(drawn["what"] == "spectrum in bins") & (drawn["file"] == "road0.npy")]
    assert len(bins) > 10
    assert ((bins["y_low"] < bins["y"]) & (bins["y"] < bins["y_high"])).all()
    law = drawn[(drawn["what"] == "power law") & (drawn["file"] == "road0.npy")]
    power, level = np.polyfit(np.log(law["x"]), np.log(law["y"]), 1)
    assert power == pytest.approx(-2 - 2 * document["rows"][0]["hurst"], abs=0.01)
    within = bins[bins["x"].between(law["x"].min(), law["x"].max())]
    assert np.median(np.log(within["y"]) - power * np.log(within["x"])) == pytest.approx(level, abs=0.02)
    assert main(["surface", *MAPS, "-o", "road.csv", "--plot", "road.png"]) == 2
    assert "road.csv is the table of the figure road.png: give the spectrum another name" in capsys.readouterr().err
    (spectrum,) = spectra_of(Surface.model_validate({"spectrum": str(folder / "c2d.csv")}))
    gradients = [row["rms_gradient"] for row in document["rows"]]
    assert spectrum.rms_gradient() == pytest.approx(np.sqrt(np.mean(np.square(gradients))), rel=0.01)
    assert main(["surface", "c2d.csv", "--csv"]) == 0
    assert capsys.readouterr().out.startswith("file,Sq [m]")


def test_a_scan_is_recognised_by_its_two_columns(folder, capsys):
    assert main(["surface", "scan.csv", "--json"]) == 0
    out, err = capsys.readouterr()
    (row,) = json.loads(out)["rows"]
    assert row["rms_gradient"] == pytest.approx(row["slope_x"] * np.sqrt(2), rel=0.15)
    assert "inverse Abel transform" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["road0.npy"], "road0.npy: does not state its spacing: give --spacing, such as 1 um"),
        (["road0.npy", "--spacing", "2 s"], "expected a length"),
        ([*MAPS, "--shortest-wavelength", "1um"], "expected shortest_wavelength of at least"),
        ([*MAPS, "--plot", "road.gif"], "expected a file that ends in"),
        (["scan.csv", "--detrend", "plane"], "'line' or 'parabola'"),
        (["none.npy"], "does not exist"),
    ],
)
def test_a_mistake_is_one_message_and_writes_nothing(folder, arguments, message, capsys):
    assert main(["surface", *arguments, "-o", "road.csv"]) == 2
    assert message in capsys.readouterr().err
    assert not (folder / "c2d.csv").exists()
