"""A model of one's own, as in docs/own-model.md: every command, and messages for its faults."""

import importlib
import json
import re
import subprocess
import sys
import time
from contextlib import ExitStack
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import mdr_dask
from mdr_dask import execute, fits, models, plots, task, units
from mdr_dask.cli import main
from mdr_dask.errors import ClusterError, MachineError, ModelError
from mdr_dask.execute import Resources
from mdr_dask.execute.children import children
from mdr_dask.fits.base import Fit
from mdr_dask.models.base import Block, Status
from mdr_dask.models.per_case import per_case
from mdr_dask.questions.progress import messages

PAGE = (Path(__file__).parents[1] / "docs/own-model.md").read_text()
MODULE, CAMPAIGN = (re.search(rf"^```{kind}\n(.*?)^```", PAGE, flags=re.M | re.S)[1] for kind in ("python", "yaml"))


@pytest.fixture
def example(tmp_path, monkeypatch):
    (tmp_path / "wear_rate.py").write_text(MODULE)
    (tmp_path / "pin.yaml").write_text(CAMPAIGN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # a module that changes within a second would stay as it was
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
    assert main(["show", "results/pin.zarr", "--json"]) == 0
    assert "wear_volume_grid_error" in json.loads(capsys.readouterr().out)["rows"][0]


def test_the_second_example_of_the_page_has_a_profile_and_a_data_file(example, capsys):
    module = re.search(r'^```python\n(""\"track.*?)^```', PAGE, flags=re.M | re.S)[1]
    (example / "track.py").write_text(module)
    (example / "p.csv").write_text("x,p\n0,0\n0.02,1e6\n")
    text = "name: track\nmodel: track:MODEL\nparameters: {pressure: p.csv, length: 20 mm, distance: [1 km, 2 km]}\n"
    (example / "track.yaml").write_text(text)
    assert main(["init", "track:MODEL"]) == 0
    assert "distance: 1 km" in capsys.readouterr().out
    assert main(["run", "track.yaml", "--quiet"]) == 0
    depth = mdr_dask.open("results/track.zarr").worn_depth.isel(realisation=0)
    np.testing.assert_allclose(depth.sel(distance=2000, place=[0, 0.02]), [0, 2e-6])
    assert main(["show", "results/track.zarr", "--columns", "passes"]) == 0
    assert main(["plot", "results/track.zarr", "worn_depth", "--over", "place", "-o", "track.png"]) == 0
    assert main(["report", "results/track.zarr", "-o", "track.html"]) == 0
    assert "in the module track, which is not included" in Path("track.html").read_text()
    (example / "p.csv").write_text("x,p\n0,0\n0.02,2e6\n")
    assert main(["run", "track.yaml", "--quiet"]) == 2
    assert "  pressure: p.csv has changed\n" in capsys.readouterr().err
    del sys.modules["track"]


def test_a_changed_function_with_the_same_version_is_noticed(example, caplog):
    assert main(["run", "pin.yaml", "--quiet"]) == 0
    for change, is_noticed in (("    # a comment\n\n    volume =", False), ("    volume = 2 *", True)):
        (example / "wear_rate.py").write_text(MODULE.replace("    volume =", change))
        del sys.modules["wear_rate"]
        assert main(["run", "pin.yaml", "--quiet"]) == 0
        assert ("the file of the model wear_rate:MODEL has changed" in caplog.text) == is_noticed


def test_a_module_that_changed_after_its_import_is_refused_until_it_is_reloaded(example):
    campaign = {"model": "wear_rate:MODEL", "parameters": {"normal_force": 1, "sliding_distance": 1, "hardness": 1e9}}
    first = mdr_dask.run(campaign, progress=False)
    changed = MODULE.replace("    volume =", "    volume = 2 *").replace("version=1", "version=2")
    (example / "wear_rate.py").write_text(changed)
    with pytest.raises(ModelError, match="restart Python"):
        mdr_dask.run(campaign, progress=False)
    importlib.reload(sys.modules["wear_rate"])
    again = mdr_dask.run(campaign, progress=False)
    np.testing.assert_allclose(again.wear_volume, 2 * first.wear_volume)


def test_workers_import_from_the_current_folder_only_what_their_parent_imports(example, monkeypatch):
    (example / "enum.py").write_text("1 / 0")
    monkeypatch.setattr(sys, "path", [each for each in sys.path if Path(each or ".").resolve() != example])
    with children(1, "ehl_line") as (child,):
        assert child.server.poll() is None
    (example / "bad").mkdir()
    (example / "bad/enum.py").write_text("1 / 0")
    monkeypatch.syspath_prepend(str(example / "bad"))
    with children(1, "ehl_line") as (child,), pytest.raises(MachineError, match="ended with exit code 1"):
        child.run("work")


@pytest.mark.parametrize(
    ("name", "module", "sentence"),
    [
        ("absent_module:MODEL", None, "cannot import 'absent_module' .* put its folder on PYTHONPATH"),
        ("wear_rate:NOTHING", MODULE, "'wear_rate:NOTHING': module 'wear_rate' has no attribute 'NOTHING'"),
        ("wear_rate:solve", MODULE, "expected 'wear_rate:solve' to be an mdr_dask.models.base.Model, got function"),
        ("wear_rate:MODEL", "1 / 0", "ZeroDivisionError: division by zero"),
        ("wear_rate", MODULE, "unknown model 'wear_rate'"),
    ],
)
def test_a_model_that_cannot_be_loaded_is_one_message_at_its_line(example, capsys, name, module, sentence):
    if module is not None:
        (example / "wear_rate.py").write_text(module)
    (example / "pin.yaml").write_text(CAMPAIGN.replace("wear_rate:MODEL", repr(name)))
    assert main(["check", "pin.yaml"]) == 2
    printed = capsys.readouterr().err
    assert re.search(rf"^(error: )?pin.yaml:2:8: model: .*{sentence}", printed, flags=re.M), printed
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


def test_a_fault_in_a_law_or_figure_of_ones_own_is_named_and_the_others_go_on(example, monkeypatch, capsys, caplog):
    (example / "wear_laws.py").write_text(
        "import xarray as xr\nfrom mdr_dask.fits.base import Fit\nfrom mdr_dask.plots.base import Plot\n"
        "from mdr_dask.plots.figure import Axis, Figure, Panel, Trace\n\ndef wrong(groups):\n    return 1 / 0\n\n"
        "def odd(groups):\n    point = xr.Dataset({'x': ('x', [1.0]), 'y': ('x', [1.0])})\n"
        "    trace = Trace('curve', point, marker='odd')\n"
        "    return Figure([Panel(Axis('x'), Axis('y'), [trace])], 'y')\n\n"
        "FITS = (Fit('wrong', ('wear_rate',), 'a law', wrong),)\n"
        "PLOTS = (Plot('wrong', ('wear_rate',), 'a figure', wrong), Plot('odd', ('wear_rate',), 'a figure', odd))\n"
    )
    offers = {fits.GROUP: ["wear_laws:FITS", "absent_laws:FITS"], plots.GROUP: ["wear_laws:PLOTS", "absent:PLOTS"]}
    installed = EntryPoint("wear_rate", "wear_rate:MODEL", models.GROUP)  # the campaign names it by its module
    monkeypatch.setattr(models, "_installed", lambda: {"wear_rate": installed})
    for room in (fits, plots):
        monkeypatch.setattr(room, "entry_points", lambda group: [EntryPoint(o, o, group) for o in offers[group]])
    assert main(["run", "pin.yaml", "--quiet"]) == 0
    assert main(["fit", "results/pin.zarr", "wrong"]) == 2
    assert "law 'wrong' of the module wear_laws: ZeroDivisionError: division by zero (wear_laws.py:7)" in (
        capsys.readouterr().err
    )
    assert main(["plot", "results/pin.zarr", "--all"]) == 2
    told = capsys.readouterr().err
    assert "wrong: left out: internal error in the figure 'wrong' of the module wear_laws: ZeroDivisionError" in told
    assert "odd: left out: internal error in the figure 'odd' of the module wear_laws: ValueError" in told
    assert main(["report", "results/pin.zarr"]) == 0
    assert Path("report.html").read_text().count("of the module wear_laws") == 3
    assert main(["plot", "results/pin.zarr", "wear_volume", "-o", "volume.png"]) == 0
    assert "mdr_dask plots are left out: cannot load absent:PLOTS: ModuleNotFoundError" in caplog.text
    del sys.modules["wear_laws"]


def test_the_law_and_the_figure_of_the_page(example, monkeypatch, capsys):
    (example / "wear_laws.py").write_text(re.search(r'^```python\n(""\"wear_laws.*?)^```', PAGE, flags=re.M | re.S)[1])
    installed = EntryPoint("wear_rate", "wear_rate:MODEL", models.GROUP)
    monkeypatch.setattr(models, "_installed", lambda: {"wear_rate": installed})
    for room, offer in ((fits, "wear_laws:FITS"), (plots, "wear_laws:PLOTS")):
        entry = EntryPoint("wear_rate", offer, room.GROUP)
        monkeypatch.setattr(room, "entry_points", lambda group, entry=entry: [entry])
    assert main(["run", "pin.yaml", "--quiet"]) == 0
    capsys.readouterr()
    assert main(["fit", "results/pin.zarr", "load_exponent", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"][0]["exponent"] == pytest.approx(1)
    assert main(["plot", "results/pin.zarr", "growth", "-o", "growth.png"]) == 0
    assert Path("growth.csv").read_text().count(" N,") == 10
    del sys.modules["wear_laws"]


def test_a_worker_with_another_file_of_the_model_is_refused(example, monkeypatch):
    others = task.versions("wear_rate:MODEL")[:2]
    monkeypatch.setattr(task, "versions", lambda _: (*others, "other"))
    with pytest.raises(ClusterError, match=r"wear_rate:MODEL 1 \(file other\), but the run .* \(file [0-9a-f]+\)"):
        execute.run(mdr_dask.read("pin.yaml"), "pin.zarr", Resources(threads=1), lambda _: None)


@pytest.mark.slow
def test_the_scheduler_needs_no_model_and_a_worker_without_it_is_named(example, tmp_path_factory):
    """The scheduler runs in a process of its own, in another folder."""
    folder = tmp_path_factory.mktemp("elsewhere")
    words = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--scheduler-file", "address.json"]
    words += ["--no-dashboard"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", "address.json", "--no-nanny"]
    with ExitStack() as stack:
        for command in (words, worker):
            process = subprocess.Popen(command, cwd=folder, stderr=subprocess.DEVNULL)
            stack.callback(process.wait)
            stack.callback(process.kill)
            while not (folder / "address.json").exists():
                time.sleep(0.1)
        resources = Resources(scheduler=json.loads((folder / "address.json").read_text())["address"])
        with pytest.raises(ClusterError, match="lacks the Python module 'wear_rate': install its package"):
            execute.run(mdr_dask.read("pin.yaml"), "pin.zarr", resources, lambda _: None)


def test_where_every_case_fails_outputs_with_dimensions_of_their_own_are_written_too(example, capsys):
    traced = MODULE.replace(
        "has_error=True),)", 'has_error=True), Output("trace", "m", "depth along the track", ("place",)))'
    ).replace(
        "    compute=", '    coordinates=lambda _: {"place": Coordinate(np.arange(3.0), "1", "place")},\n    compute='
    )
    broken = traced.replace("    coefficient = case", '    raise ValueError("no pin")\n    coefficient = case')
    imports = "import numpy as np\nfrom mdr_dask.models.base import Coordinate\n"
    (example / "wear_rate.py").write_text(imports + broken)
    assert main(["run", "pin.yaml", "--quiet"]) == 1
    assert "0 done, 200 failed" in capsys.readouterr().out
    assert xr.open_zarr("results/pin.zarr").trace.shape == (5, 2, 20, 3)
    assert main(["status", "results/pin.zarr", "--failures"]) == 0
    assert "200 x failed: ValueError: no pin" in capsys.readouterr().out


class UnprintableError(Exception):
    def __str__(self):
        raise RuntimeError("no text")


def raises(error):
    def outputs(*_):
        raise error

    return outputs


def gives(volume, error=0.0):
    return lambda _: {"wear_volume": volume, "wear_volume_error": error}


NUMBER = "wear_volume: expected a real number or an array of them, in SI units, got"
#: Values and exceptions of a model that make a case fail, and the recorded reason.
MISBEHAVIOUR = {
    "NaN": (gives(np.nan), "wear_volume: expected a finite number, got nan"),
    "too large": (gives(10**400), "OverflowError: int too large to convert to float"),
    "negative error": (gives(1.0, -1), "wear_volume_error: expected at least 0, got -1"),
    "number in quotes": (gives("3.5"), f"ValueError: {NUMBER} '3.5'"),
    "ragged list": (gives([[1.0], [2.0, 3.0]]), rf"ValueError: {NUMBER} \[\[1.0\], \[2.0, 3.0\]\]"),
    "quantity": (gives(units.registry().Quantity(1.0, "m^3")), f"ValueError: {NUMBER} "),
    "vector": (gives(np.zeros(3)), r"wear_volume: expected a number for each case, got shape \(3,\)"),
    "nothing": (
        lambda _: None,
        r"expected a dictionary with a value for each output, got None \(is the return statement missing\?\)",
    ),
    "other names": (lambda _: {"wear": 1.0}, "the output wear_volume is missing, got wear"),
    "further output": (
        lambda volume: {**gives(1.0)(volume), "depth": 1.0},
        "ValueError: the output 'depth' is not declared, declared: wear_volume, wear_volume_error",
    ),
    "exception": (raises(ValueError("two\n  lines\n")), r"ValueError: two lines \(test_own_model.py:\d+\)"),
    "exception that has no text": (raises(UnprintableError()), "UnprintableError"),
    "exit": (raises(SystemExit(0)), "SystemExit: 0"),
    "interrupt of its own": (raises(KeyboardInterrupt()), "KeyboardInterrupt"),
}


def reason_of_failures():
    """Run the campaign, in which every fifth result fails, and return the only reason."""
    outcome = execute.run(mdr_dask.read("pin.yaml"), "pin.zarr", Resources(threads=1), lambda _: None)
    assert (outcome.done, outcome.failed) == (160, 40)
    (text,) = {each["message"] for each in messages("pin.zarr", "", xr.open_zarr("pin.zarr"))}
    return text


@pytest.mark.parametrize("kind", MISBEHAVIOUR)
def test_a_case_without_a_proper_result_has_failed_and_the_others_go_on(example, monkeypatch, kind):
    misbehave, why = MISBEHAVIOUR[kind]
    module = importlib.import_module("wear_rate")
    solve = module.solve

    def compute(case, random):
        outputs = solve(case, random)
        return misbehave(outputs["wear_volume"]) if case.normal_force > 50 else outputs

    monkeypatch.setattr(module, "MODEL", replace(module.MODEL, compute=per_case(compute)))
    text = reason_of_failures()
    assert re.match(f"([a-zA-Z]+: )?{why}", text), text
    assert "\n" not in text
    assert len(text) <= 1000
    opened = xr.open_zarr("pin.zarr")
    assert bool((opened.wear_volume.isnull() == (opened.status == Status.FAILED)).all())
    monkeypatch.setattr(module, "MODEL", replace(module.MODEL, compute=per_case(solve)))
    campaign = mdr_dask.read("pin.yaml")
    again = execute.run(campaign, "pin.zarr", Resources(threads=1), lambda _: None, retry_failed=True)
    assert (again.kept, again.done, again.failed) == (160, 40, 0)


def changed(values=None, **fields):
    """Return what changes a Result, and the values in it."""
    return lambda result: replace(result, values={**result.values, **(values or {})}, **fields)


DONE = np.full((1, 1), Status.DONE)
#: Invalid results of a model's `compute`, and the recorded reason.
RESULTS = {
    "no Result": (lambda result: result.values, "TypeError: expected a Result, got dict"),
    "unknown state": (changed(status=DONE * 7), "ValueError: status: expected DONE, NOT_CONVERGED or FAILED"),
    "output missing": (lambda result: replace(result, values={}), "ValueError: the output 'wear_volume' is missing"),
    "shape": (changed(values={"wear_volume": np.ones(3)}), "ValueError: wear_volume: expected a number for each case"),
    "place of a message": (changed(messages={(5, 5): "far"}), r"ValueError: messages: expected keys"),
}


@pytest.mark.parametrize("kind", RESULTS)
def test_a_result_that_is_not_as_declared_is_a_failed_case(example, monkeypatch, kind):
    change, why = RESULTS[kind]
    module = importlib.import_module("wear_rate")

    def compute(block):
        result = per_case(module.solve)(block)
        return change(result) if block.cases == 1 and block.case(0).normal_force > 50 else result

    def at_once(block):
        if (block.column("normal_force") > 50).any() and block.cases > 1:
            raise ValueError("one of them")
        return compute(block)

    monkeypatch.setattr(module, "MODEL", replace(module.MODEL, compute=at_once))
    assert re.match(why, reason_of_failures())


@pytest.mark.parametrize(
    ("broken", "sentence"),
    [
        ("operations=lambda block: 1 / 0", "'operations' of model 'wear_rate:MODEL' failed: ZeroDivisionError"),
        ("notes=lambda cases: cases[9]", "'notes' of model .* failed: "),
    ],
)
def test_a_fault_in_another_function_of_the_model_is_one_message(example, capsys, broken, sentence):
    Path("wear_rate.py").write_text(MODULE.replace("    compute=", f"    {broken},\n    compute="))
    assert main(["check", "pin.yaml"]) == 2
    assert re.search(sentence, capsys.readouterr().err)


def test_ctrl_c_during_a_case_of_the_main_thread_is_no_failed_case(heeds_interrupts):
    with pytest.raises(KeyboardInterrupt):
        per_case(raises(KeyboardInterrupt()))(Block(None, {}, 1, (0,), 1, ("y",)))


def test_an_output_may_declare_that_nan_is_normal(example, capsys):
    declared = MODULE.replace("has_error=True", "has_error=True, allow_nan=True")
    (example / "wear_rate.py").write_text(declared.replace("return {", 'volume = float("nan")\n    return {'))
    assert main(["run", "pin.yaml", "--quiet"]) == 0
    assert "200 done, 0 failed" in capsys.readouterr().out
