"""A real SLURM of one node: job arrays of parts, and Dask workers as its jobs."""

import json
import re
from pathlib import Path

import pytest
import slurm as room
from slow_campaign import make, mdr_dask
from test_execute import digests

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
    """A folder with a long campaign, as SLURM's jobs and this test see it."""
    (tmp_path / "parts.sh").write_text(SCRIPT)
    monkeypatch.chdir(tmp_path)
    for name, value in {**slurm.environment, **make(tmp_path, blocks=24, pause=1)}.items():
        monkeypatch.setenv(name, value)
        slurm.environment[name] = value
    return tmp_path


def missing(store):
    told = mdr_dask("status", store, "--json")
    return json.loads(told.stdout)["rows"][0]["missing"] if told.returncode == 0 else 1


def test_a_campaign_longer_than_the_wall_time_finishes_by_submitting_its_script_again(folder, slurm):
    ends = []
    while missing("long.zarr") and len(ends) < 8:
        options = [
            "--array=1-3",
            "--cpus-per-task=1",
            "--time=1",
            "--signal=B:TERM@45",
            "--output=%a.txt",
            "--open-mode=append",
        ]
        ends.append(slurm.wait(slurm.submit(*options, "parts.sh", "long.yaml")))
    told = "".join(path.read_text() for path in folder.glob("*.txt"))
    assert missing("long.zarr") == 0, told
    assert len(ends) > 1, told
    assert "interrupted; nothing is lost" in told
    assert ends[-1] == {"COMPLETED"}
    assert mdr_dask("run", "long.yaml", "--store", "whole.zarr", PAUSE="0").returncode == 0
    assert digests("long.zarr") == digests("whole.zarr")
    events = [json.loads(line) for path in folder.glob("*.jsonl") for line in path.read_text().splitlines()]
    begun = [(*event["block"],) for event in events if event["event"] == "block begun"]
    assert len(begun) == len(set(begun)) == 48
