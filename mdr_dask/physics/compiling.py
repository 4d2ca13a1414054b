"""The four decorators of compiled kernels."""

from __future__ import annotations

import gc
import hashlib
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core.event import Event, Listener, register
from numba.core.types import unliteral

from mdr_dask.arrays import FloatArray
from mdr_dask.version import __version__

Kernel = TypeVar("Kernel", bound=Callable[..., object])

PACKAGE = Path(__file__).parents[1]
IMPORTS = re.compile(r"^\s*(?:from|import) mdr_dask\.([\w.]+)(?: import ([\w, ]+))?", re.MULTILINE)


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


def kernel(function: Kernel) -> Kernel:
    """Compile a function that never raises and may allocate arrays."""
    return _compiled(function)


def compiled(function: Kernel) -> Kernel:
    """Compile a function that allocates nothing and never raises: counting references would take half of its time."""
    return _compiled(function, _nrt=False)


def inlined(function: Kernel) -> Kernel:
    """Compile a function into its callers: handing over a line, word by word, would take most of its time."""
    return _compiled(function, _nrt=False, forceinline=True)


def fused(function: Kernel) -> Kernel:
    """Compile a function into its callers, products and sums in one rounding."""
    return _compiled(function, _nrt=False, forceinline=True, fastmath={"contract", "nsz"})


def _compiled(function: Kernel, **options: object) -> Kernel:
    """Compile a function once for every type of its arguments, of which a number written in a call is none."""
    compile_it = numba.njit(nogil=True, cache=True, error_model="numpy", no_cfunc_wrapper=True, **options)  # type: ignore[call-overload]
    kernel: Any = compile_it(function)
    if hasattr(kernel, "get_call_template"):
        template: Any = kernel.get_call_template
        plain: Callable[[Any], Any] = unliteral
        kernel.get_call_template = lambda types, named: template(
            [plain(each) for each in types], {name: plain(each) for name, each in named.items()}
        )
    kept = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    if kept is not None:  # numba looks at the kernel's own file only, and reads types that are no more
        source = _sources(Path(function.__code__.co_filename))
        kept._version = f"{numba.__version__}, mdr_dask {__version__}, {source}"
    return cast(Kernel, kernel)


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
