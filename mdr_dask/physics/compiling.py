"""The six decorators of compiled kernels, and functions that stand in for some of numba's, which compile for long."""

from __future__ import annotations

import gc
import hashlib
import re
from collections.abc import Callable
from functools import cache, update_wrapper
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import types
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager
from numba.core.event import Event, Listener, register
from numba.core.types import unliteral
from numba.extending import typeof_impl

from mdr_dask.arrays import FloatArray
from mdr_dask.version import __version__

Kernel = TypeVar("Kernel", bound=Callable[..., object])

PACKAGE = Path(__file__).parents[1]
IMPORTS = re.compile(r"^\s*(?:from|import) mdr_dask\.([\w.]+)(?: import ([\w, ]+))?", re.MULTILINE)
# Passes of numba for closures, expressions of whole arrays, and variables of several types
UNNEEDED = {"InlineClosureLikes", "NopythonRewrites", "ReconstructSSA", "PreLowerStripPhis"}


class _CollectLater(Listener):
    """No garbage is collected while a thread compiles: looking through the objects of numba would take a seventh."""

    def __init__(self) -> None:
        self._depth, self._collects = 0, False  # one thread compiles at a time, one kernel within another

    def on_start(self, event: Event) -> None:
        """Stop collecting when the outermost compilation begins."""
        if self._depth == 0:
            self._collects = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: Event) -> None:
        """Go on collecting after it."""
        self._depth -= 1
        if self._depth == 0 and self._collects:
            gc.enable()


register("numba:compile", _CollectLater())  # type: ignore[no-untyped-call]


class BarePasses(CompilerBase):
    """The passes of numba that a function of numbers and given arrays needs; the others take a seventh of the time."""

    def define_pipelines(self) -> list[PassManager]:
        """Return the passes."""
        whole: Any = DefaultPassBuilder.define_nopython_pipeline(self.state)  # type: ignore[no-untyped-call]
        passes: Any = PassManager("bare")  # type: ignore[no-untyped-call]
        for each, description in whole.passes:
            if each.__name__ not in UNNEEDED:
                passes.add_pass(each, description)
        passes.finalize()
        return [passes]


BARE: dict[str, Any] = {"_nrt": False, "pipeline_class": BarePasses}


class Nested:
    """A function in kernels: what Python would call, and a file, take as long as a small one. Python has another."""

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        self.py_func = function
        self.in_kernels = _compiled(function, no_cpython_wrapper=True, **BARE, **options)
        self.in_python = _compiled(function, **BARE, **options)  # compiled when a test or a reader calls it
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        """Call the function from Python."""
        return self.in_python(*arguments)


@typeof_impl.register(Nested)
def _type_of_nested(function: Nested, _: object) -> types.Dispatcher:
    return types.Dispatcher(function.in_kernels)


def kernel(function: Kernel) -> Kernel:
    """Compile a function that never raises and may allocate arrays."""
    return _kept(function)


def compiled(function: Kernel) -> Kernel:
    """Compile a function that allocates nothing and never raises: counting references would take half of its time.

    Its variables keep their types from their first value on, a whole number that becomes a fraction aside.
    """
    return _kept(function, **BARE)


def spliced(function: Kernel) -> Kernel:
    """Compile a function into its only caller before types are known: each level of callers optimises all below it."""
    return _kept(function, inline="always", **BARE)


def nested(function: Kernel) -> Kernel:
    """Compile a function that only kernels call, a small one or of one kernel: it has no file."""
    return cast(Kernel, Nested(function))


def inlined(function: Kernel) -> Kernel:
    """Compile a nested function into its callers: handing over a line, word by word, would take most of its time."""
    return cast(Kernel, Nested(function, forceinline=True))


def fused(function: Kernel) -> Kernel:
    """Compile a nested function into its callers, products and sums in one rounding."""
    return cast(Kernel, Nested(function, forceinline=True, fastmath={"contract", "nsz"}))


def _kept(function: Kernel, **options: Any) -> Kernel:
    """Compile a function into a file that is not read any more when what it is made from has changed."""
    kernel = _compiled(function, cache=True, **options)
    kept = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    if kept is not None:  # numba looks at the kernel's own file only, and reads types that are no more
        source = _sources(Path(function.__code__.co_filename))
        kept._version = f"{numba.__version__}, mdr_dask {__version__}, {source}"
    return cast(Kernel, kernel)


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a function once for every type of its arguments, of which a number written in a call is none."""
    njit: Any = numba.njit
    kernel = njit(nogil=True, error_model="numpy", no_cfunc_wrapper=True, **options)(function)
    if hasattr(kernel, "get_call_template"):
        template: Any = kernel.get_call_template
        plain: Callable[[Any], Any] = unliteral
        kernel.get_call_template = lambda types, named: template(
            [plain(each) for each in types], {name: plain(each) for name, each in named.items()}
        )
    return kernel


@cache
def _sources(file: Path) -> str:
    """Return a digest of a file and of all files of the package that it imports: what a kernel in it is made from."""
    content = file.read_text(encoding="utf-8")
    digest = hashlib.sha1(content.encode(), usedforsecurity=False)
    for module, names in IMPORTS.findall(content):
        place = PACKAGE.joinpath(*module.split("."))
        within = [place / name.strip() for name in names.split(",")] if place.is_dir() else [place]
        for imported in (path.with_suffix(".py") for path in within):
            if imported.is_file():
                digest.update(_sources(imported).encode())
    return digest.hexdigest()


@inlined
def copy_into(target: FloatArray, source: FloatArray) -> None:
    """Copy an array to the front of another: assigning to a slice would compile the words of its error, for seconds."""
    for i in range(source.size):
        target[i] = source[i]


@inlined
def greater(one: float, other: float) -> float:
    """Return the greater of two numbers: numba compiles a `max` of its own for every kind of caller."""
    return other if other > one else one


@inlined
def lesser(one: float, other: float) -> float:
    """Return the lesser of two numbers."""
    return other if other < one else one


@inlined
def last_until(values: FloatArray, x: float, low: int, high: int) -> int:
    """Return the index of the last of the ascending values from `low` to before `high` that is x at most, or `low`."""
    while high - low > 1:
        middle = (low + high) // 2
        if values[middle] <= x:
            low = middle
        else:
            high = middle
    return low
