"""The four decorators of compiled kernels."""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.core.event import Event, Listener, register
from numba.core.types import unliteral

from mdr_dask.arrays import FloatArray
from mdr_dask.version import __version__

Kernel = TypeVar("Kernel", bound=Callable[..., object])


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
    if kept is not None:  # numba reads all of an index of its own version, types that are no more included
        kept._version = f"{numba.__version__}, mdr_dask {__version__}"
    return cast(Kernel, kernel)


@inlined
def copy_into(target: FloatArray, source: FloatArray) -> None:
    """Copy an array to the front of another: assigning to a slice would compile the words of its error, for seconds."""
    for i in range(source.size):
        target[i] = source[i]
