"""The two decorators of compiled kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

from mdr_dask.version import __version__

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(function: Kernel) -> Kernel:
    """Compile a function that allocates nothing and never raises: counting references would take half of its time."""
    return _compiled(function)


def inlined(function: Kernel) -> Kernel:
    """Compile a function into its callers: handing over a line, word by word, would take most of its time."""
    return _compiled(function, forceinline=True)


def _compiled(function: Kernel, **options: bool) -> Kernel:
    compile_it = numba.njit(nogil=True, cache=True, _nrt=False, error_model="numpy", **options)  # type: ignore[call-overload]
    kernel = compile_it(function)
    kept = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    if kept is not None:  # numba reads all of an index of its own version, types that are no more included
        kept._version = f"{numba.__version__}, mdr_dask {__version__}"
    return cast(Kernel, kernel)
