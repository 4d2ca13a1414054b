"""The command line: exit codes, streams, tables, JSON, and runs that are killed."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from small_campaign import CAMPAIGN
from test_execute import digests

from mdr_dask.cli import main

#: Seconds after which a process is not waited for, on a machine that may be busy.
PATIENCE = 300


def test_run_then_run_again(campaign, capsys):
    assert main(["run", str(campaign)]) == 0
    first = capsys.readouterr()
    assert first.out == "results/small.zarr: 64 done, 0 failed\n"
    assert "block" in first.err
    assert main(["run", str(campaign)]) == 0
    assert capsys.readouterr().out == "results/small.zarr: all 64 results are there already; nothing to do\n"
    assert main(["run", str(campaign), "--quiet", "--json"]) == 0
    counts = json.loads(capsys.readouterr().out)
    assert (counts["store"], counts["kept"], counts["done"]) == ("results/small.zarr", 64, 0)


def test_dry_run_prints_the_range_of_rounds(campaign, capsys):
    until = "realisations: {at_least: 8, at_most: 24, until: {friction_coefficient: 1 %}}"
    campaign.write_text(CAMPAIGN.replace("realisations: 8", until))
    assert main(["run", str(campaign), "--dry-run"]) == 0
    printed = capsys.readouterr().out
    assert "8 cases x 8 to 24 realisations = 64 to 192 results" in printed
    assert not Path("results").exists()
    assert "the first number is for the first round" in printed
    assert main(["run", str(campaign), "--dry-run", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["realisations"], document["at_most"], document["results"]) == (8, 24, 64)
    assert document["results_at_most"] == 192
    assert document["seconds_at_most"] == pytest.approx(3 * document["seconds"])
    assert (document["counted"], document["kept"], document["to_do"]) == ("first round", 0, 64)


def test_the_error_of_a_fitted_material_is_printed_and_stored(campaign, capsys):
    table = Path(__file__).parent / "data/dma/freq_user_raw.csv"
    material = f"material: {{dma_table: {{file: {table}, table_temperature: 298 K, poisson_ratio: 0.5}}}}"
    text = CAMPAIGN.replace("shear_modulus: 10 MPa", material).replace("  relaxation_time: 1 ms\n", "")
    campaign.write_text(text + "outputs: [friction_coefficient, material_error]\n")
    note = r"rms error 1\.6% in G', 4\.2% in G'', largest 8\.7% at 62\.8 rad/s"
    for command in (["check"], ["run", "--dry-run"]):
        assert main([*command, str(campaign)]) == 0
        assert re.search(note, " ".join(capsys.readouterr().out.split()))
    assert main(["check", str(campaign), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert re.search(note, " ".join(row["notes"]))
    assert main(["run", str(campaign), "--quiet"]) == 0
    kept = xr.open_zarr("results/small.zarr")
    assert re.search(note, " ".join(kept.attrs["notes"]))
    np.testing.assert_allclose(kept["material_error"], np.hypot(0.016, 0.042) / np.sqrt(2), rtol=0.03)


def test_problems_of_a_file_go_to_stderr_with_exit_code_2(campaign, capsys):
    campaign.write_text(CAMPAIGN.replace("hurst: 0.7", "hurst: 1.2").replace("points: 500", "points: many"))
    assert main(["run", str(campaign)]) == 2
    streams = capsys.readouterr()
    assert streams.out == ""
    assert f"{campaign}:7:" in streams.err
    assert f"{campaign}:8:" in streams.err
    assert not Path("results").exists()


def test_status_counts_and_lists_failures(filled, capsys):
    assert main(["status", "results/small.zarr", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)["rows"][0]
    assert (row["results"], row["done"], row["missing"]) == (64, 64, 0)
    assert main(["status", "results/small.zarr", "--failures"]) == 0
    assert capsys.readouterr().out == "no failures\n"


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "mdr_dask", *arguments]


@pytest.mark.slow
def test_killed_at_any_moment_a_run_ends_with_the_same_bytes(campaign, tmp_path):
    """SIGKILL at random moments, again and again, until a run gets through: no byte differs, no block is done twice."""
    long = CAMPAIGN.replace("realisations: 8", "realisations: 64").replace("points: 500", "points: 20000")
    campaign.write_text(long + "store: {path: killed.zarr, blocks: {realisation: 2}}\n")
    random = np.random.default_rng(1)
    kills = 0
    there = 0
    while there < 32:
        enough = there + random.integers(1, 16)
        with subprocess.Popen(command("run", str(campaign), "--quiet"), stdout=subprocess.DEVNULL) as process:
            while process.poll() is None and there < enough:
                time.sleep(random.uniform(0.0, 0.05))
                there = len(list(Path("killed.zarr").glob("status/c/*/*/*[0-9]")))
            if process.poll() is None and there < 32:
                process.send_signal(signal.SIGKILL)
                kills += 1
    assert process.returncode == 0
    assert kills >= 1
    subprocess.run(command("run", str(campaign), "--quiet", "--store", "whole.zarr"), check=True, capture_output=True)
    assert digests("killed.zarr") == digests("whole.zarr")


@pytest.mark.slow
def test_a_cluster_file_is_used(campaign):
    Path("cluster.yaml").write_text(
        "class: distributed.LocalCluster\n"
        "arguments: {n_workers: 1, threads_per_worker: 1, dashboard_address: '127.0.0.1:0'}\n"
        "scale: {n: 1}\n"
    )
    for store, options in (("a.zarr", ["--cluster", "cluster.yaml"]), ("b.zarr", [])):
        words = command("run", str(campaign), "--store", store, *options)
        subprocess.run(words, check=True, capture_output=True)
    assert digests("a.zarr") == digests("b.zarr")


LONG = CAMPAIGN.replace("realisations: 8", "realisations: 400").replace("points: 500", "points: 20000")
LIVE = LONG + "store: {path: live.zarr, blocks: {realisation: 1}}\n"


def started(*arguments: str) -> subprocess.Popen[str]:
    """Start a command that runs into live.zarr, in a process group of its own, and wait for its first blocks."""
    process = subprocess.Popen(
        command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline and not list(Path("live.zarr").glob("status/c/*/*/*")):
        time.sleep(0.05)
    return process


@pytest.mark.slow
@pytest.mark.parametrize(("options", "sent"), [("--threads", signal.SIGINT), ("--workers", signal.SIGTERM)])
def test_an_interrupted_process_group_ends_with_one_message_and_no_process_left(
    heeds_interrupts, campaign, options, sent
):
    psutil = pytest.importorskip("psutil")
    campaign.write_text(LIVE)
    process = started("run", str(campaign), "--quiet", options, "1")
    children = psutil.Process(process.pid).children(recursive=True)
    os.killpg(process.pid, sent)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert " ".join(errors.split()) == "interrupted; finished results are kept; the same command computes the others"
    _, alive = psutil.wait_procs(children, timeout=PATIENCE)
    assert not alive
    assert not list(Path().glob(".live.zarr.*.runner"))


def _at_work(process: int) -> bool:
    return any(str(process) in runner.read_text() for runner in Path().glob(".live.zarr.*.runner"))


@pytest.mark.slow
def test_a_second_process_is_refused_until_the_first_has_ended(campaign, capsys):
    campaign.write_text(LIVE)
    first = started("run", str(campaign), "--quiet")
    assert main(["run", str(campaign), "--quiet"]) == 2
    assert f"process {first.pid} on " in capsys.readouterr().err
    first.kill()
    first.communicate(timeout=PATIENCE)
    second = started("run", str(campaign), "--quiet")
    deadline = time.monotonic() + PATIENCE
    while not _at_work(second.pid) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert main(["run", str(campaign), "--quiet"]) == 2
    assert f"process {second.pid} on " in capsys.readouterr().err
    second.terminate()
    _, errors = second.communicate(timeout=PATIENCE)
    assert second.returncode == 130, errors


def test_dry_run_on_a_store_counts_what_remains(campaign, filled, capsys):
    campaign.write_text(CAMPAIGN.replace("realisations: 8", "realisations: 12"))
    assert main(["run", str(campaign), "--dry-run"]) == 0
    assert "64 results are in the store already, 32 remain" in capsys.readouterr().out
    assert main(["run", str(campaign), "--dry-run", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["results"], document["kept"], document["to_do"]) == (96, 64, 32)
    assert xr.open_zarr(filled).sizes["realisation"] == 8


def test_a_store_may_be_named_by_a_file_url(campaign, tmp_path, capsys):
    url = f"file://{tmp_path}/named.zarr"
    assert main(["run", str(campaign), "--quiet", "--store", url]) == 0
    assert main(["show", url, "friction_coefficient"]) == 0
    assert main(["run", str(campaign), "--quiet", "--store", str(tmp_path / "named.zarr")]) == 0
    assert "all 64 results are there already" in capsys.readouterr().out
