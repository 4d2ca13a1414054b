"""A model of one's own, as docs/own-model.md tells it: through every command, and what is said where it is missing."""

import json
import os
import re
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mdr_dask import fits, models
from mdr_dask.cli import main
from mdr_dask.errors import ModelError
from mdr_dask.fits.base import Fit

PAGE = (Path(__file__).parents[1] / "docs/own-model.md").read_text()
MODULE, CAMPAIGN = (re.search(rf"^```{kind}\n(.*?)^```", PAGE, flags=re.M | re.S)[1] for kind in ("python", "yaml"))


@pytest.fixture
def example(tmp_path, monkeypatch):
    (tmp_path / "wear_rate.py").write_text(MODULE)
    (tmp_path / "pin.yaml").write_text(CAMPAIGN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    sys.modules.pop("wear_rate", None)


def test_the_example_of_the_page_goes_through_every_command(example, capsys):
    assert main(["models", "wear_rate:MODEL", "--json"]) == 0
    assert "wear_volume_error" in capsys.readouterr().out
    assert main(["check", "pin.yaml"]) == 0
    assert main(["run", "pin.yaml", "--quiet"]) == 0
    opened = xr.open_zarr("results/pin.zarr")
    assert opened.attrs["model"] == "wear_rate:MODEL"
    assert dict(opened.sizes) == {"normal_force": 5, "sliding_distance": 2, "realisation": 20}
    assert float(opened.wear_volume.std("realisation")[0, 0]) > 0
    law = 1e-4 * opened.normal_force * opened.sliding_distance / 2e9
    np.testing.assert_allclose(opened.wear_volume.mean("realisation"), law, rtol=0.1)
    np.testing.assert_allclose(opened.wear_volume_error, 1e-12 * opened.wear_volume)
    capsys.readouterr()
    assert main(["run", "pin.yaml"]) == 0
    assert "nothing to do" in capsys.readouterr().out
    assert main(["aggregate", "results/pin.zarr", "--json"]) == 0
    assert "wear_volume_grid_error" in json.loads(capsys.readouterr().out)["rows"][0]


def test_workers_import_it_too(example):
    environment = os.environ | {"PYTHONPATH": str(example), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "mdr_dask", "run", "pin.yaml", "--workers", "1", "--quiet"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "200 done, 0 failed" in done.stdout


def test_another_version_of_it_is_refused(example, capsys):
    assert main(["run", "pin.yaml", "--quiet"]) == 0
    (example / "wear_rate.py").write_text(MODULE.replace("version=1", "version=2"))
    del sys.modules["wear_rate"]
    assert main(["run", "pin.yaml", "--quiet"]) == 2
    assert "version" in capsys.readouterr().err


def test_a_case_that_raises_is_data(example, capsys):
    check = '    if case.normal_force > 50:\n        raise ValueError("too heavy")\n'
    broken = MODULE.replace("    coefficient = case", check + "    coefficient = case")
    (example / "wear_rate.py").write_text(broken)
    assert main(["run", "pin.yaml", "--quiet"]) == 1
    capsys.readouterr()
    assert main(["status", "results/pin.zarr", "--failures"]) == 0
    assert "40 x failed: ValueError: too heavy" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "module", "sentence"),
    [
        ("absent_module:MODEL", None, "cannot import 'absent_module' .* put its folder on PYTHONPATH"),
        (
            "wear_rate:NOTHING",
            MODULE,
            "cannot load model 'wear_rate:NOTHING': module 'wear_rate' has no attribute 'NOTHING'",
        ),
        ("wear_rate:solve", MODULE, "expected 'wear_rate:solve' to be a mdr_dask Model, got function"),
        ("wear_rate:MODEL", "1 / 0", "ZeroDivisionError: division by zero"),
        ("wear_rate:MODEL", "import lacking", "No module named 'lacking'"),
        ("wear_rate:", MODULE, "cannot load model 'wear_rate:'|expected 'wear_rate:'"),
        ("wear_rate", MODULE, "unknown model 'wear_rate'"),
    ],
)
def test_what_is_wrong_with_it_is_one_sentence_at_its_line(example, capsys, name, module, sentence):
    if module is not None:
        (example / "wear_rate.py").write_text(module)
    (example / "pin.yaml").write_text(CAMPAIGN.replace("wear_rate:MODEL", repr(name)))
    assert main(["check", "pin.yaml"]) == 2
    said = capsys.readouterr().err
    assert re.search(rf"^(error: )?pin.yaml:2:8: model: .*{sentence}", said, flags=re.M), said
    assert not Path("results").exists()


def test_installed_packages_offer_models_and_fits_by_name(example, monkeypatch):
    entry = EntryPoint("wear_rate", "wear_rate:MODEL", models.GROUP)
    monkeypatch.setattr(models, "_installed", lambda: {"wear_rate": entry})
    assert models.load("wear_rate").summary == "Archard's law"
    assert models.names()[-1] == "wear_rate"
    with pytest.raises(ModelError, match="unknown model 'wear'"):
        models.load("wear")
    law = Fit("archard", ("wear_rate",), "V = k F s / H", lambda groups: xr.Dataset())

    class Offered:
        def load(self):
            return (law,)

    monkeypatch.setattr(fits, "entry_points", lambda group: [Offered()])
    assert fits.available("wear_rate").keys() == {"archard", "calibration"}
    assert fits.available("wear_rate")["archard"] == law


def test_where_every_case_fails_outputs_with_dimensions_of_their_own_are_written_too(example, capsys):
    traced = MODULE.replace(
        "has_error=True),)", 'has_error=True), Output("trace", "m", "depth along the track", ("place",)))'
    ).replace(
        "    seconds=", '    coordinates=lambda _: {"place": Coordinate(np.arange(3.0), "1", "place")},\n    seconds='
    )
    broken = traced.replace("    coefficient = case", '    raise ValueError("no pin")\n    coefficient = case')
    imports = "import numpy as np\nfrom mdr_dask.models.base import Coordinate\n"
    (example / "wear_rate.py").write_text(imports + broken)
    assert main(["run", "pin.yaml", "--quiet"]) == 1
    assert "0 done, 200 failed" in capsys.readouterr().out
    assert xr.open_zarr("results/pin.zarr").trace.shape == (5, 2, 20, 3)
    assert main(["status", "results/pin.zarr", "--failures"]) == 0
    assert "200 x failed: ValueError: no pin" in capsys.readouterr().out


MISBEHAVIOUR = {
    "NaN": ('volume = float("nan")', "wear_volume is nan"),
    "infinity": ('volume = float("inf")', "wear_volume is inf"),
    "None": ('return {"wear_volume": None, "wear_volume_error": 0.0}', "wear_volume is None"),
    "masked": ("import numpy; volume = numpy.ma.masked", "wear_volume is masked"),
    "a vector": ("import numpy; volume = numpy.zeros(3)", "wear_volume: expected a number for each case"),
    "text": ('return {"wear_volume": "large", "wear_volume_error": 0.0}', "could not convert string to float"),
    "no output": ("return {}", "the output wear_volume is missing"),
    "exit": ("import sys; sys.exit(0)", "SystemExit: 0"),
    "a long message": ('raise ValueError("x" * 10**6)', "ValueError: xxx"),
}


@pytest.mark.parametrize("kind", MISBEHAVIOUR)
def test_a_case_without_a_proper_result_has_failed_and_the_others_go_on(example, capsys, kind):
    line, reason = MISBEHAVIOUR[kind]
    place = "    volume = coefficient * case.normal_force * case.sliding_distance / case.hardness\n"
    bad = f"{place}    if case.normal_force > 50:\n        {line}\n"
    (example / "wear_rate.py").write_text(MODULE.replace(place, bad))
    assert main(["run", "pin.yaml", "--quiet"]) == 1
    assert "160 done, 40 failed" in capsys.readouterr().out
    assert main(["status", "results/pin.zarr", "--failures"]) == 0
    told = capsys.readouterr().out
    assert "40 x failed" in told
    assert reason in told
    assert len(told) < 5000
    (example / "wear_rate.py").write_text(MODULE)
    sys.modules.pop("wear_rate")
    assert main(["run", "pin.yaml", "--quiet", "--retry-failed"]) == 0
    assert "160 kept, 40 done, 0 failed" in capsys.readouterr().out


def test_an_output_may_declare_that_nan_is_normal(example, capsys):
    declared = MODULE.replace("has_error=True", "has_error=True, allow_nan=True")
    (example / "wear_rate.py").write_text(declared.replace("return {", 'volume = float("nan")\n    return {'))
    assert main(["run", "pin.yaml", "--quiet"]) == 0
    assert "200 done, 0 failed" in capsys.readouterr().out
