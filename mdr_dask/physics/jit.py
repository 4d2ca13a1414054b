"""Compilation of numerical kernels by numba: `jit` for kernels, `jit_inline` for small functions inside them.

To decide whether a stored kernel is out of date, numba checks only the file that contains the kernel. If you change a
function that is called by kernels in other files, empty numba's cache or set NUMBA_CACHE_DIR to a new folder.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar, cast

import numba

Kernel = TypeVar("Kernel", bound=Callable[..., object])

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
UNCOUNTED = OPTIONS | {"_nrt": False}  # if `_nrt` is False, numba does not count references to arrays


def jit(function: Kernel) -> Kernel:
    """Compile a function of numbers and arrays, and store the machine code in numba's cache if possible."""
    return _cached(function, OPTIONS)


def jit_uncounted(function: Kernel) -> Kernel:
    """Compile a function that must not create arrays. Arrays in named tuples are then read several times faster."""
    return _cached(function, UNCOUNTED)


def jit_inline(function: Kernel) -> Kernel:
    """Compile a function into each kernel that calls the function."""
    return cast(Kernel, numba.njit(forceinline=True, **OPTIONS)(function))


def jit_inline_fused(function: Kernel) -> Kernel:
    """Compile a function into each kernel that calls the function, and let ``a * b + c`` be rounded only once."""
    return cast(Kernel, numba.njit(forceinline=True, fastmath={"contract"}, **OPTIONS)(function))


def jit_inline_uncounted(function: Kernel) -> Kernel:
    """Compile a function that must not create arrays (see `jit_uncounted`) into each kernel that calls the function."""
    return cast(Kernel, numba.njit(forceinline=True, **UNCOUNTED)(function))


def _cached(function: Kernel, options: dict[str, Any]) -> Kernel:
    try:
        kernel: Any = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # neither the package folder nor the home folder is writable
        _warn_once("numba finds no folder for compiled kernels")
        return cast(Kernel, numba.njit(**options)(function))
    # numba has no public way to survive a full disk or a damaged file of the cache
    stored = getattr(kernel, "_cache", None)  # None if NUMBA_DISABLE_JIT is set
    if stored is not None:
        stored.load_overload = _or_none(stored.load_overload, "read")
        stored.save_overload = _or_none(stored.save_overload, "written")
    return cast(Kernel, kernel)


def _or_none(step: Callable[..., Any], done: str) -> Callable[..., Any]:
    """Wrap a step of numba's cache: instead of raising an error, the step warns and returns None."""

    def tried(*arguments: Any) -> Any:
        try:
            return step(*arguments)
        except Exception as fault:  # reading an incomplete pickle can raise almost any exception
            _warn_once(f"numba's cache of compiled kernels cannot be {done} ({type(fault).__name__})")
            return None

    return tried


@cache
def _warn_once(problem: str) -> None:
    remedy = "set NUMBA_CACHE_DIR to a folder that can be written, otherwise kernels are compiled in every process"
    warnings.warn(f"{problem}; {remedy}", RuntimeWarning, stacklevel=2)


@jit_inline
def last_until(values: Any, x: float, count: int) -> int:
    """Return the last index below `count` where the ascending array `values` is <= x, or 0 if there is none."""
    low, length = 0, count
    while length > 1:  # the compiled loop has no branches that a processor could predict wrongly
        half = length // 2
        if values[low + half] <= x:
            low += half
        length -= half
    return low
