"""A run as a guest: in the caller's process, on read-only disks, beside crashes, and with the files of strangers."""

import os
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from test_own_model import CAMPAIGN, MODULE
from threadpoolctl import threadpool_info, threadpool_limits

import mdr_dask
from mdr_dask import execute, store
from mdr_dask.cli import main
from mdr_dask.errors import MachineError, StoreError
from mdr_dask.execute import Part, Resources

PLACE = "    coefficient = case"


@pytest.fixture
def example(tmp_path, monkeypatch):
    """A folder with the model of docs/own-model.md; returns a function that runs the command line in a process."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))

    def command(*arguments, line=""):
        Path("wear_rate.py").write_text(MODULE.replace(PLACE, f"{line}\n{PLACE}"))
        text = CAMPAIGN.replace("realisations: 20", "realisations: 4")
        Path("pin.yaml").write_text(f"{text}store: {{blocks: {{realisation: 4}}}}\n")
        environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
        words = [sys.executable, "-m", "mdr_dask", *arguments]
        return subprocess.run(words, env=environment, capture_output=True, text=True, check=False)

    yield command
    sys.modules.pop("wear_rate", None)


CRASH = """    if case.normal_force > 50 and case.sliding_distance > 10:
        import os, signal
        os.kill(os.getpid(), signal.SIGSEGV)
"""


@pytest.mark.slow
@pytest.mark.parametrize("options", [[], ["--workers", "1"]])
def test_a_case_that_crashes_its_process_has_failed(example, options):
    done = example("run", "pin.yaml", "--quiet", *options, line=CRASH)
    assert (done.returncode, "36 done, 4 failed" in done.stdout) == (1, True), done.stderr
    told = example("status", "results/pin.zarr", "--failures", line=CRASH).stdout
    assert "4 x failed: its process crashed: Segmentation fault" in told
    assert example("verify", "results/pin.zarr").returncode == 0
    healed = example("run", "pin.yaml", "--quiet", "--retry-failed")
    assert (healed.returncode, "36 kept, 4 done, 0 failed" in healed.stdout) == (0, True)


@pytest.mark.slow
def test_a_crash_in_a_thread_ends_the_run_and_the_next_run_finds_the_case(example):
    command = ("run", "pin.yaml", "--quiet", "--threads", "1")
    assert example(*command, line=CRASH).returncode == -11
    assert "4 failed" in example(*command, line=CRASH).stdout


@pytest.mark.parametrize(
    "hang",
    [
        "time.sleep(60)",
        pytest.param("signal.pthread_sigmask(0, [signal.SIGALRM]); time.sleep(60)", marks=pytest.mark.slow),
    ],
)
def test_a_case_that_takes_too_long_has_failed(example, hang):
    """Python code raises an exception; a library that does not return is killed with its process."""
    line = (
        f"    if case.normal_force > 50 and case.sliding_distance > 10:\n        import signal, time\n        {hang}\n"
    )
    done = example("run", "pin.yaml", "--quiet", "--case-timeout", "0.3", line=line)
    assert done.returncode == 1, done.stderr
    assert "36 done, 4 failed" in done.stdout
    assert "took longer than 0.3 s" in example("status", "results/pin.zarr", "--failures").stdout


@pytest.mark.slow
def test_a_second_interrupt_stops_cases_that_do_not_end(heeds_interrupts, example):
    example("check", "pin.yaml", line="    import time, pathlib; pathlib.Path('begun').touch(); time.sleep(600)")
    words = [sys.executable, "-m", "mdr_dask", "run", "pin.yaml", "--workers", "1"]
    run = subprocess.Popen(words, env={**os.environ, "PYTHONPATH": "."}, stderr=subprocess.PIPE, text=True)
    while not Path("begun").exists():
        time.sleep(0.1)
    run.send_signal(signal.SIGINT)
    assert any("a second interrupt stops at once" in line for line in run.stderr)
    run.send_signal(signal.SIGINT)
    assert "interrupted" in run.communicate(timeout=60)[1]
    assert run.returncode == 130


def test_threads_of_blas_are_as_before_a_run(toy, url):
    import scipy.linalg  # noqa: F401  (brings a BLAS of its own)

    with threadpool_limits(limits=2, user_api="blas"):
        before = [found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas"]
        execute.run(toy.campaign(toy.axis("position", [1.0])), url, Resources(threads=1), lambda _: None)
        assert [found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas"] == before


def test_a_script_without_a_guard_gets_one_sentence(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import mdr_dask\nfrom mdr_dask import Resources\nmdr_dask.run({'model': 'ehl_line', 'parameters': {"
        "'load_parameter': 1e-5, 'speed_parameter': 1e-11, 'material_parameter': 4500}}, "
        "resources=Resources(cluster={'class': 'distributed.LocalCluster', 'arguments': {'n_workers': 1}}))\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 1
    assert "put what it does below 'if __name__ == \"__main__\":'" in done.stderr.splitlines()[-1]


def test_a_dask_client_in_this_process_computes_and_stays_open(toy, url):
    from distributed import Client

    with Client(processes=False, dashboard_address="127.0.0.1:0", n_workers=1, threads_per_worker=1) as client:
        campaign = toy.campaign(toy.axis("position", [1.0, 2.0]))
        assert execute.run(campaign, url, Resources(client=client), lambda _: None).done == 12
        assert client.submit(lambda: 3).result() == 3


def test_a_fault_of_the_machine_is_no_failed_case(toy, url, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    campaign = toy.campaign(toy.axis("position", [1.0, 2.0]))
    with monkeypatch.context() as patch:
        patch.setattr(sys.modules["mdr_dask.models.toy"], "MODEL", replace(toy.MODEL, compute=full))
        with pytest.raises(MachineError, match="No space left on device"):
            execute.run(campaign, url, Resources(threads=1), lambda _: None)
    assert execute.run(campaign, url, Resources(threads=1), lambda _: None).done == 12


@pytest.mark.slow
def test_a_model_that_changes_the_working_directory_is_no_matter(example):
    assert example("run", "pin.yaml", "--quiet", line="    import os; os.chdir('/')").returncode == 0
    assert example("verify", "results/pin.zarr").returncode == 0


@pytest.fixture
def read_only(toy, tmp_path, monkeypatch):
    """A finished study whose folder cannot be written."""
    study = tmp_path / "mine" / "study.zarr"
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0]))
    execute.run(campaign, str(study), Resources(threads=1), lambda _: None)
    for lock in study.parent.glob(".*lock"):
        lock.unlink()
    opened = os.open

    def refuse(path, flags, *more, **options):
        if flags & (os.O_CREAT | os.O_RDWR | os.O_WRONLY) and str(path).startswith(str(study.parent)):
            raise OSError(30, os.strerror(30), str(path))
        return opened(path, flags, *more, **options)

    monkeypatch.setattr(os, "open", refuse)
    return campaign, str(study)


def test_a_finished_study_is_verified_and_run_on_a_disk_that_is_read_only(toy, read_only, tmp_path, capsys):
    campaign, url = read_only
    before = sorted(Path(url).parent.iterdir())
    assert store.verify(url).findings == []
    assert main(["status", url]) == 0
    told = capsys.readouterr().out
    assert "toy: toy, version 1 of the model" in told
    assert "permission" not in told.lower()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    assert main(["verify", url]) == 0
    assert main(["show", url]) == 0
    assert main(["report", url, "-o", str(elsewhere / "page.html")]) == 0
    assert main(["publish", url, "-o", str(elsewhere / "study.zip")]) == 0
    assert main(["verify", str(elsewhere / "study.zip")]) == 0
    assert execute.run(campaign, url, Resources(threads=1), lambda _: None).kept == 12
    more = toy.campaign(toy.axis("position", [1.0, 2.0, 3.0]))
    with pytest.raises(StoreError, match="nothing can be written here"):
        execute.run(more, url, Resources(threads=1), lambda _: None)
    assert sorted(Path(url).parent.iterdir()) == before


def test_two_parts_that_were_computed_apart_are_joined_by_a_copy(toy, tmp_path):
    campaign = replace(toy.campaign(toy.axis("position", [1.0, 2.0, 3.0, 4.0])), blocks={"position": 1})
    one, two = str(tmp_path / "one.zarr"), str(tmp_path / "two.zarr")
    for number, url in ((1, one), (2, two)):
        execute.run(campaign, url, Resources(threads=1), lambda _: None, part=Part(number, 2))
        assert mdr_dask.open(url).attrs["complete"] is False
    shutil.copytree(two, one, dirs_exist_ok=True)
    assert store.verify(one).findings == []
    assert execute.run(campaign, one, Resources(threads=1), lambda _: None).done == 0
    assert mdr_dask.open(one).attrs["complete"] is True
    assert not np.isnan(xr.open_zarr(one).height).any()


@pytest.mark.parametrize("kind", ["bomb", "encrypted", "compression", "outside"])
def test_a_zip_of_a_stranger_is_refused_before_it_is_unpacked(tmp_path, capsys, monkeypatch, kind):
    if kind == "bomb":
        monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=50))
    path = tmp_path / "x.zip"
    name = "../../evil.txt" if kind == "outside" else "zarr.json"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_BZIP2 if kind == "compression" else zipfile.ZIP_DEFLATED) as packed:
        packed.writestr(name, b"0" * 10)
        packed.writestr("published/checksums.sha256", f"{'0' * 64}  {name}\n")
    if kind == "encrypted":
        content = bytearray(path.read_bytes())
        for mark, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
            content[content.index(mark) + offset] |= 1
        path.write_bytes(bytes(content))
    assert main(["verify", str(path)]) == 2
    told = capsys.readouterr().err
    assert len(told.splitlines()) == 1
    assert str(path) in told
    assert not (tmp_path.parent / "evil.txt").exists()


def test_a_store_of_another_version_of_its_model_says_how_to_extend_it(toy, url, monkeypatch):
    """The remedy must hold for a model of the user too, which no version of mdr_dask brings back."""
    campaign = toy.campaign(toy.axis("position", [1.0]))
    execute.run(campaign, url, Resources(threads=1), lambda _: None)
    monkeypatch.setattr(sys.modules["mdr_dask.models.toy"], "MODEL", replace(toy.MODEL, version=2))
    with pytest.raises(StoreError, match=r"made with version 1 of the model toy .*not extended: use the version that"):
        execute.run(campaign, url, Resources(threads=1), lambda _: None)
    assert store.verify(url).findings == []
