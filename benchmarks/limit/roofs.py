"""Measured time of every hot kernel beside the least that this processor allows: ``python -m benchmarks limit roofs``.

Operations are counted by running each kernel as plain Python with every operation counted, in a process of its own.
The roof of a kernel is the time of its busiest part: additions and comparisons, multiplications, divisions and roots,
or loads and stores, each at the measured throughput, of vector instructions where its loops are such; elementary
functions come on top.

    python -m benchmarks limit roofs [PART OF A NAME]
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping

from benchmarks.limit import operations
from benchmarks.limit.kernels import KERNELS, Kernel, Work
from benchmarks.limit.machine import roofs
from benchmarks.measures import print_table, timed

NUMBER = 8  # bytes


def counts(part: str) -> dict[str, dict[str, float]]:
    """Return the operations of every kernel for each unit, counted in another process."""
    first = "from benchmarks.limit import operations; operations.count_kernels()"
    code = f"{first}; from benchmarks.limit.roofs import count; count({part!r})"
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    found: dict[str, dict[str, float]] = json.loads(done.stdout)
    return found


def count(part: str) -> None:
    """Print the operations of every kernel for each unit; in a process that counts them."""
    found = {}
    for kernel in KERNELS:
        if part not in kernel.name:
            continue
        work = kernel.prepare()
        operations.COUNTS.clear()
        if work.operations is None:
            work.call()
        counted = work.operations or operations.COUNTS
        found[kernel.name] = {kind: number / work.units for kind, number in counted.items()}
    print(json.dumps(found))


def roof(kernel: Kernel, work: Mapping[str, float], machine: Mapping[str, float]) -> tuple[float, str]:
    """Return the least time of a unit, and what bounds it."""
    wide = "vector " if kernel.is_wide else ""

    def spent(kind: str, rate: str = "") -> float:
        return work.get(kind, 0.0) * machine.get(wide + (rate or kind), machine[rate or kind])

    functions = spent("function") + spent("power", "power")
    bounds = {
        "additions": spent("add") + spent("compare", "add") + functions,
        "products": spent("multiply") + functions,
        "quotients": spent("divide") + spent("root") + functions,
        "bytes": NUMBER * (work.get("load", 0.0) + work.get("store", 0.0)) * machine["byte in cache"],
    }
    what = max(bounds, key=lambda name: bounds[name])
    return bounds[what], what


def _seconds(work: Work) -> float:
    """Return the time of a unit."""
    work.call()
    calls = max(int(2e-3 / max(timed(work.call)[1], 1e-6)), 1)

    def often() -> None:
        for _ in range(calls):
            work.call()

    return timed(often, calls=9)[1] / calls / work.units


def main(part: str = "") -> None:
    """Print what the processor does, and the table of kernels."""
    machine, work = roofs(), counts(part)
    print_table(("operation", "ns"), ((name, f"{1e9 * seconds:.3g}") for name, seconds in machine.items()))
    print()
    rows = []
    for kernel in KERNELS:
        if kernel.name not in work:
            continue
        measured, counted = _seconds(kernel.prepare()), work[kernel.name]
        least, what = roof(kernel, counted, machine)
        numbers = [sum(counted.get(kind, 0.0) for kind in kinds) for kinds in COLUMNS.values()]
        cells = [f"{number:.3g}" for number in (*numbers, 1e9 * measured, 1e9 * least)]
        rows.append((kernel.name, kernel.unit, *cells, what, f"{measured / least:.1f}"))
    print_table(("kernel", "unit", *COLUMNS, "ns", "roof", "by", "ratio"), rows)


COLUMNS = {
    "+ - <": ("add", "compare"),
    "x": ("multiply",),
    "/ root": ("divide", "root"),
    "exp": ("function", "power"),
    "numbers moved": ("load", "store"),
}

if __name__ == "__main__":
    main(*sys.argv[1:])
