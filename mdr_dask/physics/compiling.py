"""The four decorators of compiled kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

from mdr_dask.arrays import FloatArray
from mdr_dask.version import __version__

Kernel = TypeVar("Kernel", bound=Callable[..., object])


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
    """Compile a function for every type of its arguments; a number written in a call is one of its own, and quicker."""
    compile_it = numba.njit(nogil=True, cache=True, error_model="numpy", no_cfunc_wrapper=True, **options)  # type: ignore[call-overload]
    kernel: Any = compile_it(function)
    kept = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    if kept is not None:  # numba reads all of an index of its own version, types that are no more included
        kept._version = f"{numba.__version__}, mdr_dask {__version__}"
    return cast(Kernel, kernel)


@inlined
def copy_into(target: FloatArray, source: FloatArray) -> None:
    """Copy an array into another one: assigning to a slice would compile the words of its error, for seconds."""
    for i in range(target.size):
        target[i] = source[i]
