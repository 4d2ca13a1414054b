"""Generated files of each kind are processed or refused with one message."""

import json
import shutil
from pathlib import Path

import fuzzing
import hypothesis
import pytest
import toy
from hypothesis import HealthCheck, given

from mdr_dask.cli import main


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        toy.register(patch)
        yield fuzzing.sound_store(tmp_path_factory.mktemp("whole"))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of libraries that read tables
@pytest.mark.parametrize("kind", fuzzing.CASES)
def test_generated_files_are_processed_or_refused_with_one_message(kind, whole):
    @hypothesis.settings(max_examples=6, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(fuzzing.CASES[kind])
    def holds(case):
        fuzzing.examine(case, whole)

    holds()


HALF = '{"name": "a", "model": "toy", "parameters": {}, "\\ud800": "\\ud800"}'
HUGE = fuzzing.SLIDING + fuzzing.SOFT + fuzzing.ROUGH.replace("20 mm", "1e308")
DOUBLED = "Hz, MPa, MPa\n0.1, 8, 1\n1, 9, 1.5\n"


@pytest.mark.parametrize(
    ("name", "text", "command", "code"),
    [
        ("a.yaml", HALF, ("check", "a.yaml"), 2),
        ("a.yaml", HUGE, ("check", "a.yaml"), 2),
        ("t.csv", DOUBLED, ("master-curve", "t.csv", "--over", "Hz", "--of", "MPa", "--by", "MPa"), 2),
    ],
    ids=["half a character", "a bare number near the largest", "names given twice"],
)
def test_files_that_broke_earlier_versions_are_refused(toy, tmp_path, monkeypatch, name, text, command, code):
    monkeypatch.chdir(tmp_path)
    Path(name).write_text(text)
    assert fuzzing.judge(*command) == code


@pytest.fixture
def stranger(whole, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(whole, "s.zarr")
    Path("a.yaml").write_text(fuzzing.TOY)


def change(name, act):
    path = Path("s.zarr", name)
    document = json.loads(path.read_text())
    act(document)
    path.write_text(json.dumps(document))


@pytest.mark.parametrize(
    ("name", "act", "message"),
    [
        ("zarr.json", lambda d: d["attributes"].pop("accuracy"), "accuracy: field required"),
        ("zarr.json", lambda d: members(d)["height"].update(chunk_grid={}), "height: chunk_grid.configuration"),
        ("zarr.json", lambda d: members(d)["slope"].update(shape=[10**15]), "expected the lengths of the other arrays"),
        ("zarr.json", lambda d: members(d).pop("position"), "expected the arrays position"),
        ("zarr.json", lambda d: d["attributes"]["blocks"].clear(), "expected blocks over position"),
    ],
)
def test_damaged_metadata_are_refused_and_repaired(stranger, capsys, name, act, message):
    change(name, act)
    assert main(["status", "s.zarr"]) == 2
    assert message in capsys.readouterr().err
    assert fuzzing.judge("verify", "s.zarr", "--repair") == 0
    assert fuzzing.judge("verify", "s.zarr") == fuzzing.judge("status", "s.zarr") == 0


def members(document):
    return document["consolidated_metadata"]["metadata"]


@pytest.mark.parametrize("wrong", [{"place": [[0]]}, {"place": [99, 0, 0]}, {"case": {"a": {}}}, {"status": "lost"}])
def test_damaged_messages_are_left_out(stranger, capsys, wrong):
    path = next(Path("s.zarr/status/records").glob("*.jsonl"))
    records = [json.loads(line) for line in path.read_text().splitlines()]
    for record in records:
        del record["digest"]
        for message in record["messages"]:
            message.update(wrong)
    path.write_text("".join(json.dumps(record) + "\n" for record in records))
    assert main(["status", "s.zarr", "--failures"]) == 0
    assert capsys.readouterr().out == "no failures\n"
