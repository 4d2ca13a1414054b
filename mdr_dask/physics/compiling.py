"""The five decorators of compiled kernels."""

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
# Passes of numba that are for variables of several types; and for closures and expressions of whole arrays
ONE_TYPE = {"ReconstructSSA", "PreLowerStripPhis"}
ONE_NUMBER = {"InlineClosureLikes", "NopythonRewrites"}


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


class Allocating(CompilerBase):
    """The passes of numba that kernels need whose variables keep their types."""

    unneeded = ONE_TYPE

    def define_pipelines(self) -> list[PassManager]:
        """Return numba's own pipeline without the others."""
        lean = PassManager("lean")  # type: ignore[no-untyped-call]
        whole: Any = DefaultPassBuilder.define_nopython_pipeline(self.state)  # type: ignore[no-untyped-call]
        for each, description in whole.passes:
            if each.__name__ not in self.unneeded:
                lean.add_pass(each, description)  # type: ignore[no-untyped-call]
        lean.finalize()  # type: ignore[no-untyped-call]
        return [lean]


class Bare(Allocating):
    """The passes for what allocates nothing: there are no expressions of whole arrays."""

    unneeded = ONE_TYPE | ONE_NUMBER


#: Options of what allocates nothing
BARE: dict[str, object] = {"_nrt": False, "pipeline_class": Bare}


class Nested:
    """A function that kernels are made from: Python calls it as it is written."""

    def __init__(self, function: Callable[..., Any], dispatcher: Any) -> None:
        self.py_func, self.dispatcher = function, dispatcher
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        """Call what was compiled into kernels, uncompiled."""
        return self.py_func(*arguments)


@typeof_impl.register(Nested)
def _type_of_nested(function: Nested, _: object) -> types.Dispatcher:
    return types.Dispatcher(function.dispatcher)


def kernel(function: Kernel) -> Kernel:
    """Compile a function that never raises and may allocate arrays."""
    return _kept(_compiled(function, cache=True, pipeline_class=Allocating))


def compiled(function: Kernel) -> Kernel:
    """Compile a function that allocates nothing and never raises: counting references would take half of its time."""
    return _kept(_compiled(function, cache=True, **BARE))


def spliced(function: Kernel) -> Kernel:
    """Compile a function into its only caller before types are known: each level of callers optimises those below."""
    return _kept(_compiled(function, cache=True, inline="always", **BARE))


def nested(function: Kernel) -> Kernel:
    """Compile a function that only kernels call, allocates nothing and never raises."""
    return _nested(function)


def inlined(function: Kernel) -> Kernel:
    """Compile a nested function into its callers: handing over a line, word by word, would take most of its time."""
    return _nested(function, forceinline=True)


def fused(function: Kernel) -> Kernel:
    """Compile a nested function into its callers, products and sums in one rounding."""
    return _nested(function, forceinline=True, fastmath={"contract", "nsz"})


def _nested(function: Kernel, **options: object) -> Kernel:
    """Compile a function without what Python would call, and without a file: both take as long as a small part."""
    dispatcher = _compiled(function, no_cpython_wrapper=True, **BARE, **options)
    return cast(Kernel, Nested(function, dispatcher) if hasattr(dispatcher, "py_func") else function)


def _compiled(function: Callable[..., Any], **options: object) -> Any:
    """Compile a function once for every type of its arguments, of which a number written in a call is none."""
    compile_it = numba.njit(nogil=True, error_model="numpy", no_cfunc_wrapper=True, **options)  # type: ignore[call-overload]
    kernel: Any = compile_it(function)
    if hasattr(kernel, "get_call_template"):
        template: Any = kernel.get_call_template
        plain: Callable[[Any], Any] = unliteral
        kernel.get_call_template = lambda types, named: template(
            [plain(each) for each in types], {name: plain(each) for name, each in named.items()}
        )
    return kernel


def _kept(kernel: Any) -> Any:
    """Return a kernel whose file is another one when what it is made from has changed."""
    kept = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    if kept is not None:  # numba looks at the kernel's own file only, and reads types that are no more
        source = _sources(Path(kernel.py_func.__code__.co_filename))
        kept._version = f"{numba.__version__}, mdr_dask {__version__}, {source}"
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
