"""What comparisons share: methods that are called in turns, and peers that may be missing."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from benchmarks.measures import timed

OURS = "mdr_dask"


def single_threaded() -> None:
    """Keep libraries that are imported from here on to one thread, so that processor time is work done."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"


def called(package: str) -> str | None:
    """Return name and version of a peer, or tell how to install it and return None."""
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        print(f"{package} is not installed and left out: pip install '.[peers]'")
        return None


def in_turns(methods: dict[Any, Callable[[], Any]], turns: int = 3) -> dict[Any, tuple[Any, float]]:
    """Return value and least processor time of each method, called once to warm up and then one after the other."""
    for method in methods.values():
        method()
    found = [{name: timed(method) for name, method in methods.items()} for _ in range(turns)]
    return {name: (found[0][name][0], min(each[name][1] for each in found)) for name in methods}
