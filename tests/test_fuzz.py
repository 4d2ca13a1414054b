"""Campaigns and stores with generated changes are processed, or refused with one message."""

import contextlib
import copy
import io
import json
import re
import shutil
import tempfile
import time
from pathlib import Path

import hypothesis
import pytest
import toy
from hypothesis import HealthCheck, given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from mdr_dask.cli import main

ROOT = Path(__file__).parents[1]
TOY = """\
name: toy
model: toy
seed: 3
realisations: 3
parameters: {position: [1, 2, 3], slope: {linear: [1, 2, 2]}, fail_above: 2.5}
outputs: [height]
store: {blocks: {position: 1}}
"""
BASES = [TOY, *(path.read_text() for path in sorted((ROOT / "campaigns").glob("*.yaml")))]
RECORDS = "status/records/*.jsonl"
#: Commands that read a store, mend it and finish it.
COMMANDS = [
    *("status s.zarr", "status s.zarr --failures", "show s.zarr --csv", "verify s.zarr"),
    *("run a.yaml --quiet --threads 1 --store s.zarr", "verify s.zarr --repair"),
    *("run a.yaml --quiet --threads 1 --store s.zarr", "verify s.zarr"),
]
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f\x80-\x9f]")
# fmt: off
VALUES = [
    None, True, [], {}, 0, -1, 1, 7, 10**9, 10**400, 0.5, -0.0, 1e-320, 1e308, float("nan"), float("inf"), "", " ",
    "1 m", "5 %", "1,5 N", "1e400 m", "10 m**9**9", "nan", "1_000", "a\0b", "\x1b]0;owned\x07", "\u202egnp.exe",
    "\ud83d", "x" * 5000, "../../etc/passwd", "/dev/zero", "toy", "os:system", "height", "position", "zarr.json", "c",
    [[1, 2], [3]], {"": 1}, [1, 1], {"linear": [0, 1, 10**8]}, {"geometric": [0, 1, 3]}, {"file": "/dev/zero"},
    {"halton": 10**9}, {"at_least": 10**7, "at_most": 10**8, "until": {"height": 0}},
]
# fmt: on
values = st.one_of(st.sampled_from(VALUES), st.integers(-5, 50), st.floats(width=32), st.text(max_size=12))
acts = st.sampled_from(["replace", "drop", "rename", "wrap"])
changes = st.lists(st.tuples(st.integers(0, 10**6), acts, values), min_size=1, max_size=3)


def places(tree):
    """Yield every container of a tree with each of its keys."""
    for key in list(tree) if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ():
        yield tree, key
        yield from places(tree[key])


def changed(tree, steps):
    """Return a copy of a tree with some values replaced, dropped, wrapped in a list, or under other keys."""
    tree = [copy.deepcopy(tree)]
    for where, act, value in steps:
        found = list(places(tree))
        holder, key = found[where % len(found)]
        if act == "drop" and holder is not tree:
            del holder[key]
        elif act == "wrap":
            holder[key] = [holder[key]]
        elif act == "rename" and isinstance(holder, dict):
            holder[str(value)] = holder.pop(key)
        else:
            holder[key] = copy.deepcopy(value)
    return tree[0]


def faults(*commands):
    """Run commands; return internal errors, refusals without a message, control characters and long computations."""
    found = []
    for command in commands:
        out, err, began = io.StringIO(), io.StringIO(), time.process_time()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = main(command.split())
        errors = err.getvalue()
        if code not in (0, 1, 2) or "Traceback" in errors:
            found.append(f"{command}: exit code {code}: {errors[:400]}")
        if code == 2 and not errors.strip():
            found.append(f"{command}: refused without a message")
        if CONTROL.search(out.getvalue() + errors.replace("\r", "")):
            found.append(f"{command}: control characters")
        if time.process_time() - began > 10:
            found.append(f"{command}: more than 10 s of processor time")
    return found


@contextlib.contextmanager
def new_folder():
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        yield


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a finished store of the toy model, which some cases failed."""
    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch, contextlib.chdir(folder):
        toy.register(patch)
        Path("a.yaml").write_text(TOY)
        assert main(["run", "a.yaml", "--quiet", "--threads", "1", "--store", "whole.zarr"]) == 1
        yield folder / "whole.zarr"


generated = hypothesis.settings(max_examples=10, deadline=None, suppress_health_check=list(HealthCheck), database=None)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of libraries that read tables
@generated
@given(base=st.sampled_from(BASES), steps=changes)
def test_a_changed_campaign_is_checked_or_refused(toy, base, steps):
    tree = YAML(typ="safe").load(base)
    with new_folder():
        Path("data").symlink_to(ROOT / "campaigns/data")
        Path("a.yaml").write_text(json.dumps(changed(tree, steps), default=str))
        assert faults("check a.yaml") == []


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["zarr.json", "status/zarr.json", "position/zarr.json", ".layout/zarr.json", RECORDS])
def test_a_changed_store_is_read_or_refused_and_repaired(toy, whole, name):
    @generated
    @given(steps=changes)
    def holds(steps):
        with new_folder():
            shutil.copytree(whole, "s.zarr")
            Path("a.yaml").write_text(TOY)
            (path,) = Path("s.zarr").glob(name)
            trees = (
                [json.loads(line) for line in path.read_text().splitlines()]
                if name == RECORDS
                else [json.loads(path.read_text())]
            )
            digests = [tree.pop("digest", None) for tree in trees]
            texts = [changed(tree, steps) for tree in trees]
            if name == RECORDS:  # a record without digest counts as a record of version 0.1
                pairs = zip(texts, digests, strict=True)
                texts = [{**text, "digest": digest} if isinstance(text, dict) else {} for text, digest in pairs]
            path.write_text("".join(json.dumps(text) + "\n" for text in texts))
            assert faults(*COMMANDS) == []

    holds()


HALF = '{"name": "a", "model": "toy", "parameters": {}, "\\ud800": "\\ud800"}'
HUGE = """\
name: a
model: sliding_friction
parameters:
  {normal_force: 1 N, velocity: [1 mm/s, 1 m/s], shear_modulus: 10 MPa, relaxation_time: 1 ms,
   length: 1e308, points: 500, rms_roughness: 1 um}
"""
DOUBLED = "Hz, MPa, MPa\n0.1, 8, 1\n1, 9, 1.5\n"


@pytest.mark.parametrize(
    ("name", "text", "command"),
    [
        ("a.yaml", HALF, "check a.yaml"),
        ("a.yaml", HUGE, "check a.yaml"),
        ("t.csv", DOUBLED, "master-curve t.csv --over Hz --of MPa --by MPa"),
    ],
    ids=["half a character", "a bare number near the largest", "names given twice"],
)
def test_files_that_broke_earlier_versions_are_refused(toy, tmp_path, monkeypatch, name, text, command):
    monkeypatch.chdir(tmp_path)
    Path(name).write_text(text)
    assert faults(command) == []
    assert main(command.split()) == 2
