"""Do the tests see a change of the code? ``python -m benchmarks stress mutations [NUMBER] [SEED] [FILE]``.

A mutant is one random change: an operator, a comparison, a condition, a constant, a sign, two arguments in each other's
place, a statement left out. Rooms are drawn by their lines, kinds of changes evenly. The suite runs once under coverage
in a copy of the checkout. Then each mutant stands there and meets the tests that execute its line, in a fork of this
process that has the libraries already. What is found is appended to FILE, a line of JSON each; a run that is broken off
goes on where it was.
"""

from __future__ import annotations

import ast
import importlib
import json
import math
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple

import pytest
from coverage import CoverageData

ROOT = Path(__file__).parents[2]
#: Seconds that the tests take which a mutant meets; processor time and time that they have.
SECONDS, LIMIT, PATIENCE = 60.0, 200, 400
QUIETLY = ["-q", "-p", "no:cacheprovider"]
#: What takes longest to import of what tests need.
LIBRARIES = ("distributed", "hypothesis", "matplotlib.pyplot", "numba", "pydantic", "scipy.stats", "xarray", "zarr")
#: Decorators of functions that are compiled; a test that runs one in Python says little of it.
KERNELS = {"kernel", "compiled", "spliced", "nested", "inlined", "fused"}
PHASE = re.compile(r"\|(setup|run|teardown)$")
#: Tests that read files of the project, or that start clusters: they say nothing about one line of code.
APART = re.compile(r"test_(habits|docs|api|slurm|buckets|watched_clusters|thesis|notebooks|memory)\.py")

Change = tuple[str, int, int, str]

ARITHMETIC = {ast.Add: "+-", ast.Sub: "-+", ast.Mult: "*/", ast.Div: "/*"}
COMPARISONS = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"),
    ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"),
}


class Mutant(NamedTuple):
    """A change of the bytes of a module: what stood there, and what stands there now."""

    module: str
    kind: str
    line: int
    start: int
    end: int
    old: str
    new: str


class Source:
    """A module as text, and the changes that can be made in it."""

    def __init__(self, module: str, path: Path) -> None:
        self.module, self.raw = module, path.read_bytes()
        self.tree = ast.parse(self.raw)
        self.starts = [0]
        for line in self.raw.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))

    def place(self, node: ast.AST) -> tuple[int, int]:
        return self.starts[node.lineno - 1] + node.col_offset, self.starts[node.end_lineno - 1] + node.end_col_offset

    def text(self, node: ast.AST) -> str:
        return self.raw[slice(*self.place(node))].decode()

    def mutants(self) -> list[Mutant]:
        """Return every change that can be made: beyond annotations, messages and declarations of settings."""
        left_out = {id(part) for node in ast.walk(self.tree) for part in _parts_left_out(node)}
        nodes = [node for node in ast.walk(self.tree) if id(node) not in left_out]
        found = [
            Mutant(self.module, kind, node.lineno, start, end, self.raw[start:end].decode(), new)
            for node in nodes
            for kind, start, end, new in self._changes(node)
        ]
        return [mutant for mutant in found if mutant.new != mutant.old]

    def lines(self, mutant: Mutant) -> range:
        """Return the lines of a changed statement, without its body; in kernels and beyond functions none."""
        functions = [node for node in ast.walk(self.tree) if isinstance(node, ast.FunctionDef) and not _is_kernel(node)]
        inner = [
            node
            for function in functions
            for part in function.body
            for node in ast.walk(part)
            if isinstance(node, ast.stmt) and self._holds(node, mutant)
        ]
        if not inner:
            return range(0)
        least = max(inner, key=lambda node: self.place(node)[0])
        body = getattr(least, "body", None)
        return range(least.lineno, max(least.lineno, body[0].lineno - 1 if body else least.end_lineno) + 1)

    def _holds(self, node: ast.AST, mutant: Mutant) -> bool:
        start, end = self.place(node)
        return start <= mutant.start and mutant.end <= end

    def compiles(self, mutant: Mutant) -> bool:
        try:
            compile(self.raw[: mutant.start] + mutant.new.encode() + self.raw[mutant.end :], self.module, "exec")
        except SyntaxError:
            return False
        return True

    def _between(self, kind: str, left: ast.AST, right: ast.AST, old: str, new: str) -> Iterator[Change]:
        start, end = self.place(left)[1], self.place(right)[0]
        between = self.raw[start:end].decode()
        if between.count(old) == 1 and "#" not in between:
            yield kind, start, end, between.replace(old, new)

    def _changes(self, node: ast.AST) -> Iterator[Change]:
        """Yield kind, place and text of the changes of one node."""
        if hasattr(node, "end_col_offset"):
            for changes in (self._of_signs, self._of_conditions, self._of_constants, self._of_statements):
                yield from changes(node, *self.place(node))

    def _of_signs(self, node: ast.AST, start: int, end: int) -> Iterator[Change]:
        match node:
            case ast.BinOp(left, operator, right) if type(operator) in ARITHMETIC:
                yield from self._between("operator", left, right, *ARITHMETIC[type(operator)])
            case ast.Compare(left, [comparison], [right]):
                yield from self._between("comparison", left, right, *COMPARISONS[type(comparison)])
            case ast.UnaryOp(ast.USub(), operand) if not isinstance(operand, ast.Constant):
                yield "sign", start, end, self.text(operand)

    def _of_conditions(self, node: ast.AST, start: int, end: int) -> Iterator[Change]:
        match node:
            case ast.BoolOp(operator, [first, second]):
                words = ("and", "or") if isinstance(operator, ast.And) else ("or", "and")
                yield from self._between("condition", first, second, *words)
            case ast.UnaryOp(ast.Not(), operand):
                yield "condition", start, end, f"bool({self.text(operand)})"
            case ast.If(test) | ast.IfExp(test):
                yield "condition", *self.place(test), f"(not ({self.text(test)}))"

    def _of_constants(self, node: ast.AST, start: int, end: int) -> Iterator[Change]:
        match node:
            case ast.Constant(bool(value)):
                yield "constant", start, end, str(not value)
            case ast.Constant(int(value)) if abs(value) < 10**6:
                yield "off by one", start, end, str(value + 1)
            case ast.Constant(float(value)):
                yield "constant", start, end, repr(1.05 * value if value else 0.05)
                if value and math.log10(abs(value)).is_integer():
                    yield "unit", start, end, repr(1e3 * value)

    def _of_statements(self, node: ast.AST, start: int, end: int) -> Iterator[Change]:
        match node:
            case ast.Call(args=[*_, first, second]) if not isinstance(first, ast.Starred | ast.Constant):
                (start, middle), (other, end) = self.place(first), self.place(second)
                between = self.raw[middle:other].decode()
                yield "swap", start, end, self.text(second) + between + self.text(first)
            case ast.Expr(value) if not isinstance(value, ast.Constant):
                yield "statement", start, end, "pass"
            case ast.AugAssign() | ast.Assign(targets=[ast.Subscript()]) | ast.Continue() | ast.Break():
                yield "statement", start, end, "pass"


def _is_kernel(function: ast.FunctionDef) -> bool:
    return any(isinstance(each, ast.Name) and each.id in KERNELS for each in function.decorator_list)


def _parts_left_out(node: ast.AST) -> Iterator[ast.AST]:
    """Yield all below a node that no test of numbers can see."""
    match node:
        case ast.FunctionDef():
            arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            parts = [*(each.annotation for each in arguments), node.returns, *node.decorator_list]
        case ast.AnnAssign():
            parts = [node.annotation]
        case ast.ClassDef():  # that data is frozen has a test of its own
            parts = [node] if node.name.endswith("Settings") else node.decorator_list
        case ast.Raise() | ast.JoinedStr() | ast.Assert():
            parts = [node]
        case ast.If(ast.Name("TYPE_CHECKING")):
            parts = [node]
        case _:
            return
    for part in filter(None, parts):
        yield from ast.walk(part)


class Checkout:
    """Modules of a checkout, and the kernels that are compiled from them."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.modules = {_name(path, root): path for path in sorted((root / "mdr_dask").rglob("*.py"))}

    @cached_property
    def users(self) -> dict[str, set[str]]:
        """Modules that import a module."""
        found = defaultdict(set)
        for module, path in self.modules.items():
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.ImportFrom):
                    for name in {node.module, *(f"{node.module}.{each.name}" for each in node.names)} - {module}:
                        found[name].add(module)
        return found

    def kernels(self, module: str) -> list[Path]:
        """Return the files of kernels that may hold code of a module: its own, and those of all that use it."""
        reached, edge = set(), {module}
        while edge:
            reached |= edge
            edge = {user for each in edge for user in self.users[each] if "physics" in user} - reached
        paths = [self.modules[each] for each in reached]
        return [kernel for path in paths for kernel in (path.parent / "__pycache__").glob(f"{path.stem}.*.nb?")]

    @contextmanager
    def changed(self, mutant: Mutant) -> Iterator[None]:
        """Hold a change, without the kernels that were compiled before it, and then what was there before."""
        path = self.modules[mutant.module]
        source, stat = path.read_bytes(), path.stat()
        kept = {kernel: kernel.read_bytes() for kernel in self.kernels(mutant.module)}
        for kernel in kept:
            kernel.unlink()
        path.write_bytes(source[: mutant.start] + mutant.new.encode() + source[mutant.end :])
        try:
            yield
        finally:
            path.write_bytes(source)
            os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
            for kernel in self.kernels(mutant.module):
                kernel.unlink()
            for kernel, compiled in kept.items():
                kernel.write_bytes(compiled)


class Suite:
    """What each test executes, as coverage saw it in one run of the suite, and how long the test takes."""

    def __init__(self, checkout: Checkout, kept: Path) -> None:
        self.users, times = checkout.users, kept.with_suffix(".seconds")
        if not times.exists():
            times.write_text(json.dumps(_measured(checkout, kept)))
        self.seconds: dict[str, float] = json.loads(times.read_text())
        self.data = CoverageData(str(kept))
        self.data.read()
        inside = {file.rpartition("/mdr_dask/")[2]: file for file in self.data.measured_files()}
        self.files = {_name(Path("mdr_dask", path), Path()): file for path, file in inside.items()}

    def by_line(self, module: str) -> dict[int, set[str]]:
        """Return the tests that execute each line of a module; of what is compiled there are none."""
        found = self.data.contexts_by_lineno(self.files[module]) if module in self.files else {}
        return {line: {PHASE.sub("", test) for test in tests} & self.seconds.keys() for line, tests in found.items()}

    def chosen(self, module: str, lines: range) -> list[str]:
        """Return tests that execute one of the lines, near and fast ones first, and then others of their files.

        Where none does, as beyond functions and in kernels, they are those of the module and of its users.
        """
        here = self.by_line(module)
        tests = _union(here.get(line, ()) for line in lines)
        tests = tests or _union(seen for each in (module, *self.users[module]) for seen in self.by_line(each).values())
        files = {_file(test) for test in tests}
        beside = [test for test in self.seconds if _file(test) in files]  # the first test of a file makes its fixtures
        parts = {part.rstrip("s") for part in module.split(".")[1:]}
        near = {file: sum(part in file for part in parts) for file in files}
        beside.sort(key=lambda test: (test not in tests, -near[_file(test)], self.seconds[test]))
        before = accumulate((self.seconds[test] for test in beside), initial=0.0)
        return [test for test, seconds in zip(beside, before, strict=False) if seconds < SECONDS]


def _file(test: str) -> str:
    return test.partition("::")[0]


def _union(sets: Iterable[Iterable[str]]) -> set[str]:
    return set().union(*sets)


def _measured(checkout: Checkout, kept: Path) -> dict[str, float]:
    """Run the suite under coverage; return the seconds of every test that passed."""
    command = [sys.executable, "-P", "-m", "pytest", *QUIETLY, "--numprocesses=auto", "-m", "not slow", "--tb=no"]
    command += ["--durations=0", "--durations-min=0", "--cov=mdr_dask", "--cov-context=test", "--cov-report=", "tests"]
    command += [f"--ignore={path}" for path in checkout.root.rglob("test_*.py") if APART.search(path.name)]
    environment = {**os.environ, "PYTHONPATH": str(checkout.root), "COVERAGE_FILE": str(kept)}
    run = subprocess.run(command, cwd=checkout.root, env=environment, capture_output=True, text=True, check=False)
    told = run.stdout
    seconds: dict[str, float] = defaultdict(float)
    for taken, test in re.findall(r"^([\d.]+)s (?:setup|call|teardown) +(\S.*)$", told, flags=re.M):
        seconds[test] += float(taken)
    failed = re.findall(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", told, flags=re.M)
    return {test: taken for test, taken in seconds.items() if test not in failed}


def _forked(checkout: Checkout, tests: list[str]) -> tuple[int, str]:
    """Run tests until the first fails, in a fork of this process; return how it ended, and what it said."""
    with tempfile.TemporaryFile() as said:
        child = os.fork()
        if child == 0:
            os.setsid()
            os.dup2(said.fileno(), 1)
            os.dup2(said.fileno(), 2)
            os.chdir(checkout.root)
            for name in [name for name in sys.modules if name.partition(".")[0] in ("benchmarks", "mdr_dask")]:
                del sys.modules[name]
            os.environ["PYTHONPATH"] = sys.path[0] = str(checkout.root)
            resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT))
            signal.alarm(PATIENCE)
            late = "ignore::pytest.PytestAssertRewriteWarning"  # libraries with parts for tests are here already
            ended = int(pytest.ExitCode.INTERNAL_ERROR)
            try:
                ended = int(pytest.main([*QUIETLY, "-x", "-n0", "--tb=line", "-W", late, *tests]))
            finally:  # whatever was raised: what comes next is the parent's
                os._exit(ended)
        _, status = os.waitpid(child, 0)
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        said.seek(0)
        return os.waitstatus_to_exitcode(status), said.read().decode(errors="replace")


def _name(path: Path, root: Path) -> str:
    return ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")


def drawn(checkout: Checkout, number: int, seed: int) -> list[Mutant]:
    """Return mutants: rooms by their lines, kinds evenly."""
    sources = {module: Source(module, path) for module, path in checkout.modules.items()}
    rooms: dict[str, dict[str, list[Mutant]]] = defaultdict(lambda: defaultdict(list))
    lines: dict[str, int] = defaultdict(int)
    for module, source in sources.items():
        room = ".".join(module.split(".")[:2])
        for mutant in source.mutants():
            rooms[room][mutant.kind].append(mutant)
        lines[room] += len(source.starts)
    chance = random.Random(seed)
    found: dict[Mutant, None] = {}
    names = [room for room in rooms if rooms[room]]
    while len(found) < number:
        kinds = rooms[chance.choices(names, [lines[room] for room in names])[0]]
        mutant = chance.choice(kinds[chance.choice(sorted(kinds))])
        if sources[mutant.module].compiles(mutant):
            found[mutant] = None
    return list(found)


def judged(checkout: Checkout, mutant: Mutant, tests: list[str]) -> tuple[str, str]:
    """Run tests on a mutant in place; return the verdict, and the first that failed."""
    if not tests:
        return "lives", ""
    with checkout.changed(mutant):
        ended, said = _forked(checkout, tests)
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", said, flags=re.M)
    if ended <= 0:
        return "time is up" if ended else "lives", ""
    return "killed", failed[1] if failed else said[-200:]


def main(number: str = "20", seed: str = "1", file: str = "mutations.jsonl") -> None:
    log = Path(file).resolve()
    there = len(log.read_text().splitlines()) if log.exists() else 0
    with tempfile.TemporaryDirectory(prefix="mutations-") as folder:
        for part in ("mdr_dask", "tests", "benchmarks", "docs", "campaigns", "pyproject.toml", "README.md"):
            copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy2
            copy(ROOT / part, Path(folder, part))
        checkout = Checkout(Path(folder))
        suite = Suite(checkout, log.with_suffix(".coverage"))
        for library in LIBRARIES:
            importlib.import_module(library)
        for mutant in drawn(checkout, int(number), int(seed))[there:]:
            source = Source(mutant.module, checkout.modules[mutant.module])
            verdict, test = judged(checkout, mutant, suite.chosen(mutant.module, source.lines(mutant)))
            with log.open("a") as lines:
                lines.write(json.dumps({**mutant._asdict(), "verdict": verdict, "test": test}) + "\n")
            print(
                f"{verdict:10s} {mutant.module}:{mutant.line} {mutant.kind}: {mutant.old!r} -> {mutant.new!r}",
                flush=True,
            )


if __name__ == "__main__":
    main(*sys.argv[1:])
