"""Files of strangers, made up: campaigns, metadata, stores and records, with something wrong in them.

`examine` gives one to the commands that read it. Each has to end with an exit code that the command line knows, in
seconds, with a sentence for what it refuses, and with nothing for the terminal.
"""

from __future__ import annotations

import copy
import io
import json
import re
import shutil
import signal
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import chdir, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hypothesis import strategies as st
from ruamel.yaml import YAML

from mdr_dask.cli import BROKE, main

ROOT = Path(__file__).parents[1]
#: Processor seconds that a command may take.
PATIENCE = 10.0
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f\x80-\x9f]")
NUMBERS = [0, -1, 1, 2, 7, 10**6, 10**9, 10**18, 10**400, 0.5, -0.0, 1e-320, 1e308, 1e-9, float("nan"), float("inf")]
# fmt: off
TEXTS = [
    "", " ", "1 m", "5 %", "-3 K", "1,5 N", "1e400 m", "10 m**9**9", "1 kN/mm^2 s", "nan", "inf Pa", "1_000", "0x10",
    "1:30", "١ m", "１ m", "a\0b", "\x1b]0;owned\x07", "\x1b[31mred", "\u202egnp.exe", "\ud83d\ude00", "x" * 5000,
    "../../etc/passwd", "/dev/zero", "/proc/self/mem", "toy", "toy:MODEL", "os:system", "os.system", "builtins.eval",
    "sliding_friction", "t.csv", "a.yaml", ".", "/", "~", "s3://none/none", "height", "position", "realisation",
    "status", "zarr.json", "velocity", "hurst", "method", "c", "-",
]
SHAPES = [
    None, True, [], {}, [[]], [[1, 2], [3]], {"": 1}, [1, 1, 1], ["1 m", "2 m"], {"linear": [0, 1, 3]},
    {"linear": [0, 1, 10**8]}, {"geometric": [1e-3, 1, 5]}, {"geometric": [0, 1, 3]}, {"geometric": [1, 10, -2]},
    {"file": "t.csv"}, {"table": "t.csv"}, {"table": "/dev/zero"}, {"shape": "table", "file": "t.csv"},
    {"halton": 10**9}, {"at_least": 5, "at_most": 1, "until": {"height": "1 %"}},
    {"at_least": 10**7, "at_most": 10**8, "until": {"height": 0}}, {"map": {"files": ["t.csv"]}},
    {"spectrum": "t.csv"}, {"scan": "t.csv"},
]
MARKS = [
    "&a ", "*a", "<<: *a\n", "!!python/object/apply:os.system [id]", "---\n", "\t", "%YAML 1.1\n", "? ", "- ", ": ",
    "|\n", "'", '"', "{", "[", "}", "# ", "\0", "\ufeff", ";", ",", ",,", "nan", "1e999", "-", "é",
    "=cmd|' /C calc'!A0", "\r", "\x1b[2J",
]
# fmt: on
leaves = st.one_of(
    st.sampled_from(NUMBERS),
    st.sampled_from(TEXTS),
    st.sampled_from(SHAPES),
    st.integers(-5, 50),
    st.floats(allow_nan=False, width=32),
    st.text(max_size=12),
)
#: Where in a tree, what is done there, and with what; and the same in a text.
ACTS_ON_TREES = ["replace", "add", "drop", "rename", "move", "wrap"]
edits = st.lists(st.tuples(st.integers(0, 10**6), st.sampled_from(ACTS_ON_TREES), leaves), min_size=1, max_size=3)
ACTS_ON_TEXTS = ["cut a line", "cut a character", "twice", "insert", "cut the rest"]
marks = st.one_of(st.sampled_from(MARKS), st.text(max_size=6))
scribbles = st.lists(st.tuples(st.integers(0, 10**6), st.sampled_from(ACTS_ON_TEXTS), marks), min_size=1, max_size=4)


def places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every container of a tree with each of its keys."""
    for key in list(tree) if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ():
        yield tree, key
        yield from places(tree[key])


def edited(tree: Any, changes: list[tuple[int, str, Any]]) -> Any:
    """Return a tree with something changed in it."""
    tree = copy.deepcopy(tree)
    for where, act, value in changes:
        found = list(places(tree))
        if not found:
            return copy.deepcopy(value)
        holder, key = found[where % len(found)]
        value = copy.deepcopy(value)
        if act == "drop":
            del holder[key]
        elif act == "wrap":
            holder[key] = {"series": holder[key]} if where % 2 else [holder[key]]
        elif act == "move":
            other, name = found[(7 * where + 1) % len(found)]
            holder[key] = copy.deepcopy(other[name])
        elif act in ("add", "rename") and isinstance(holder, dict):
            name = value if isinstance(value, str) else repr(value)[:40]
            holder[name] = holder.pop(key) if act == "rename" else holder[key]
        else:
            holder[key] = value
    return tree


def scribbled(text: str, changes: list[tuple[int, str, str]]) -> str:
    """Return a text with something changed in it."""
    for where, act, what in changes:
        lines = text.splitlines(keepends=True) or [""]
        at, line = where % (len(text) + 1), where % len(lines)
        if act == "cut a line":
            text = "".join(lines[:line] + lines[line + 1 :])
        elif act == "cut a character":
            text = text[:at] + text[at + 1 :]
        elif act == "twice":
            text = "".join(lines[: line + 1] + lines[line:])
        elif act == "insert":
            text = text[:at] + what + text[at:]
        else:
            text = text[:at]
    return text


def written(tree: Any) -> str:
    """Return a tree as YAML that reads like its JSON."""
    try:
        return json.dumps(tree, default=str)
    except ValueError:  # a whole number with too many digits
        return str(tree)


@dataclass(frozen=True)
class Case:
    """A made-up file: its kind, and what was done to which base."""

    kind: str
    base: str
    content: Any


def bases() -> dict[str, str]:
    """Return the campaigns of the house by name, and one of the toy model."""
    found = {path.stem: path.read_text() for path in sorted((ROOT / "campaigns").glob("*.yaml"))}
    return {"toy": TOY, **found}


TOY = """\
name: toy
model: toy
seed: 3
realisations: 3
parameters: {position: [1, 2, 3], slope: {linear: [1, 2, 2]}, fail_above: 2.5}
outputs: [height]
store: {blocks: {position: 1}}
"""
SLIDING = "name: a\nmodel: sliding_friction\nparameters:\n  normal_force: 1 N\n  velocity: [1 mm/s, 1 m/s]\n"
SOFT = "  shear_modulus: 10 MPa\n  relaxation_time: 1 ms\n"
ROUGH = "  length: 20 mm\n  points: 500\n  hurst: 0.7\n  rms_roughness: 1 um\n"
METADATA = (
    "zarr.json",
    "height/zarr.json",
    "status/zarr.json",
    "position/zarr.json",
    "layout.json",
)


def _cases(kind: str, bases: Iterable[str], content: st.SearchStrategy[Any]) -> st.SearchStrategy[Case]:
    return st.builds(Case, st.just(kind), st.sampled_from(sorted(bases)), content)


CASES = {
    "campaign": _cases("campaign", bases(), edits),
    "text of a campaign": _cases("text of a campaign", bases(), scribbles),
    "run": _cases("run", ["toy"], edits),
    "metadata": _cases("metadata", METADATA, edits),
    "store": _cases("store", ["zarr.json"], edits),
    "record": _cases("record", [""], edits),
}


class FaultError(AssertionError):
    """Something that no stranger's file may do."""


@contextmanager
def in_time(what: str) -> Iterator[None]:
    """Raise a fault in what takes too many processor seconds."""

    def over(*_: object) -> None:
        raise FaultError(f"{what}: still at work after {PATIENCE:g} s of processor time")

    before = signal.signal(signal.SIGPROF, over)
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def judge(*arguments: str) -> int:
    """Give files to a command; return its exit code."""
    out, err, what = io.StringIO(), io.StringIO(), f"mdr-dask {' '.join(arguments)}"
    with redirect_stdout(out), redirect_stderr(err), in_time(what):
        code = main(list(arguments))
    said = err.getvalue()
    if code == BROKE:
        report = re.search(r"please send (\S+)", said)
        raise FaultError(f"{what}: {_brief(Path(report[1])) if report else said}")
    if code not in (0, 1, 2):
        raise FaultError(f"{what}: exit code {code}")
    if code == 2 and not said.strip():
        raise FaultError(f"{what}: refused without a word")
    if "Traceback" in said or CONTROL.search(out.getvalue() + said.replace("\r", "")):
        raise FaultError(f"{what}: a traceback, or something for the terminal: {said!r:.300}")
    return code


def _brief(report: Path) -> str:
    """Return what went wrong and where, of a report, which goes."""
    text = report.read_text()
    report.unlink()
    frames = re.findall(r'File ".*/(mdr_dask/\S+)", line (\d+), in (\S+)', text)
    return f"{text.strip().splitlines()[-1]:.200} in {' < '.join(':'.join(frame) for frame in frames[:-5:-1])}"


def examine(case: Case, whole: Path) -> None:
    """Lay a case out in a folder of its own, beside a copy of a sound store, and give it to the commands.

    Raises
    ------
    FaultError
        If one does what it may not do.
    """
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        ACTS[case.kind](case, whole)


def _campaign(case: Case, _: Path) -> None:
    text = bases()[case.base]
    Path("data").symlink_to(ROOT / "campaigns/data")
    if case.kind == "campaign":
        text = written(edited(YAML(typ="safe").load(text), case.content))
    else:
        text = scribbled(text, case.content)
    Path("a.yaml").write_bytes(text.encode(errors="surrogatepass"))
    judge("check", "a.yaml")


def _run(case: Case, _: Path) -> None:
    text = written(edited(YAML(typ="safe").load(TOY), case.content))
    Path("a.yaml").write_bytes(text.encode(errors="surrogatepass"))
    if judge("check", "a.yaml"):
        return
    if judge("run", "a.yaml", "--dry-run", "--store", "own.zarr") or not _is_small():
        return
    code = judge("run", "a.yaml", "--quiet", "--threads", "1", "--store", "own.zarr")
    beside = {path.name for path in Path().iterdir()} - {"a.yaml", "own.zarr"}
    if any(not name.startswith(".own.zarr.") for name in beside):
        raise FaultError(f"run: files outside the store: {beside}")
    if code < 2 and (judge("verify", "own.zarr") or judge("status", "own.zarr") or judge("show", "own.zarr")):
        raise FaultError("run: a store that is not sound")


def _is_small() -> bool:
    """Say whether a campaign that passes `check` can be run here, which would take long with most models."""
    from mdr_dask.campaign import load
    from mdr_dask.plan import estimate

    study = load("a.yaml")
    costs = estimate(study)
    return study.model == "toy" and costs.results * costs.rounds < 500 and costs.blocks < 100


def _metadata(case: Case, whole: Path) -> None:
    """Change a document of a store; of kind "store" without the record that would give it away."""
    shutil.copytree(whole, "s.zarr")
    Path("a.yaml").write_text(TOY)
    name = Path("s.zarr", case.base)
    tree = edited(json.loads(name.read_bytes()), case.content)
    if case.kind == "store":
        Path("s.zarr/layout.json").unlink()
        if isinstance(tree, dict) and isinstance(tree.get("attributes"), dict):
            tree["attributes"]["mdr_dask_layout"] = 1
    try:
        name.write_text(json.dumps(tree))
    except ValueError:  # a whole number with too many digits
        name.write_text(str(tree))
    _look()


def _record(case: Case, whole: Path) -> None:
    shutil.copytree(whole, "s.zarr")
    Path("a.yaml").write_text(TOY)
    name = next(Path("s.zarr/status/records").glob("*.jsonl"))
    told = [json.loads(line) for line in name.read_bytes().splitlines()]
    for record in told:
        del record["digest"]
    changed = edited(told, case.content)
    lines = changed if isinstance(changed, list) else [changed]
    name.write_text("".join(written(line) + "\n" for line in lines))
    _look()


def _look() -> None:
    """Give a store to whatever reads one, mend it, and finish it."""
    for command in (
        "status",
        "status --failures",
        "status --messages --json",
        "show",
        "show --csv",
        "verify",
        "aggregate",
    ):
        name, *options = command.split()
        judge(name, "s.zarr", *options)
    judge("run", "a.yaml", "--quiet", "--threads", "1", "--store", "s.zarr", "--dry-run")
    judge("run", "a.yaml", "--quiet", "--threads", "1", "--store", "s.zarr")
    judge("verify", "s.zarr", "--repair")
    if judge("run", "a.yaml", "--quiet", "--threads", "1", "--store", "s.zarr") < 2 and judge("verify", "s.zarr"):
        judge("verify", "s.zarr", "--repair")  # strange files stay strange


ACTS: dict[str, Callable[[Case, Path], None]] = {
    "campaign": _campaign,
    "text of a campaign": _campaign,
    "run": _run,
    "metadata": _metadata,
    "store": _metadata,
    "record": _record,
}


def sound_store(folder: Path) -> Path:
    """Make the store that is harmed."""
    with chdir(folder):
        Path("a.yaml").write_text(TOY)
        judge("run", "a.yaml", "--quiet", "--threads", "1", "--store", "whole.zarr")
    return folder / "whole.zarr"
