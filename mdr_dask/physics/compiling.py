"""The two decorators of compiled kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(function: Kernel) -> Kernel:
    """Compile a function that allocates nothing and never raises: counting references would take half of its time."""
    compile_it = njit(nogil=True, cache=True, _nrt=False, error_model="numpy")  # type: ignore[call-overload]
    return cast(Kernel, compile_it(function))


def inlined(function: Kernel) -> Kernel:
    """Compile a function into its callers: handing over a line, word by word, would take most of its time."""
    compile_it = njit(nogil=True, cache=True, _nrt=False, error_model="numpy", forceinline=True)  # type: ignore[call-overload]
    return cast(Kernel, compile_it(function))
