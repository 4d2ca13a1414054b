"""A real SLURM of one node: job arrays of parts, and Dask workers as jobs."""

import json
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
import slurm as room
from slow_campaign import make, mdr_dask
from test_execute import digests

BLOCKS = 12
PAGE = (Path(__file__).parents[1] / "docs/cluster.md").read_text()
SCRIPT = re.search(r"^```bash\n(.*?)^```", PAGE, flags=re.M | re.S)[1]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(room.reason_to_skip() is not None, reason=str(room.reason_to_skip())),
]


@pytest.fixture(scope="module")
def slurm():
    with room.running() as found:
        yield found


@pytest.fixture
def folder(tmp_path, monkeypatch, slurm):
    """A folder with a campaign of twice BLOCKS blocks, as SLURM's jobs and this test see it."""
    (tmp_path / "parts.sh").write_text(SCRIPT)
    monkeypatch.chdir(tmp_path)
    for name, value in {**slurm.environment, **make(tmp_path, blocks=BLOCKS, pause=1)}.items():
        monkeypatch.setenv(name, value)
        slurm.environment[name] = value
    return tmp_path


def missing(store):
    printed = mdr_dask("status", store, "--json")
    return json.loads(printed.stdout)["rows"][0]["missing"] if printed.returncode == 0 else 1


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The digests of an undisturbed run."""
    folder = tmp_path_factory.mktemp("whole")
    environment = make(folder, blocks=BLOCKS, pause=0)
    store = str(folder / "long.zarr")
    assert mdr_dask("run", str(folder / "long.yaml"), "--store", store, **environment).returncode == 0
    return digests(store)


def test_a_campaign_longer_than_the_wall_time_finishes_by_submitting_its_script_again(folder, slurm, whole):
    slurm.environment["PAUSE"] = "5"  # eight of them: longer than SLURM may take to see that the signal is due
    ends = []
    while ends[-1:] != [{"COMPLETED"}] and len(ends) < 12:
        options = "--array=1-3 --cpus-per-task=1 --time=1 --signal=B:TERM@45 --output=%a.txt --open-mode=append"
        ends.append(slurm.wait(slurm.submit(*options.split(), "parts.sh", "long.yaml")))
    printed = "".join(path.read_text() for path in folder.glob("*.txt"))
    assert missing("long.zarr") == 0, printed
    assert len(ends) > 1, printed
    assert "interrupted; finished results are kept" in printed
    assert ends[-1] == {"COMPLETED"}
    assert digests("long.zarr") == whole
    done = [
        event["block"] for path in folder.glob("*.jsonl") for event in events(path) if event["event"] == "block done"
    ]
    assert len(done) == len({tuple(block) for block in done})


def events(log):
    return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []


CLUSTER = f"""
class: dask_jobqueue.SLURMCluster
arguments:
  cores: 1
  memory: 1 GiB
  walltime: "00:05:00"
  interface: lo
  python: {sys.executable}
  log_directory: log
adapt: {{minimum: 0, maximum: 3}}
"""


def test_dask_workers_come_and_go_as_jobs_of_the_queue(folder, slurm, whole):
    (folder / "queue.yaml").write_text(CLUSTER)
    log = folder / "log.jsonl"
    command = ["mdr-dask", "run", "long.yaml", "--cluster", "queue.yaml", "--log", "log.jsonl"]
    driver = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    while driver.poll() is None and sum(event["event"] == "block done" for event in events(log)) < 8:
        time.sleep(0.2)
    jobs = slurm.call("squeue", "-h", "-t", "RUNNING", "-o", "%i").split()
    (keys,) = folder.glob(".mdr-dask-keys-*")
    assert keys.stat().st_mode & 0o077 == 0
    slurm.call("scancel", "--signal=KILL", jobs[0])
    printed = driver.communicate()[1]
    assert driver.returncode == 0, printed
    assert "starting dask_jobqueue.SLURMCluster" in printed
    assert "Traceback" not in printed
    names = [event["event"] for event in events(log)]
    assert len(jobs) > 1
    assert {"worker joined", "worker lost", "run ended"} <= set(names)
    assert names.count("block done") == 2 * BLOCKS
    assert digests("long.zarr") == whole
    assert not keys.exists()


def test_the_message_of_the_queue_is_shown(folder, slurm):
    (folder / "queue.yaml").write_text(CLUSTER.replace("1 GiB", "900 GiB"))
    done = mdr_dask("run", "long.yaml", "--cluster", "queue.yaml")
    assert done.returncode == 2
    assert "the cluster starts no worker: " in done.stderr.splitlines()[-1]
    assert "sbatch: error: Memory specification can not be satisfied" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
