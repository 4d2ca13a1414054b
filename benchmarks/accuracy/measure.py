"""Measure every solver, or some: ``python -m benchmarks accuracy measure [SOLVER...]``, into a table of the evidence.

Times are least processor times of this process, with linear algebra on one thread. Names are those of `SOLVERS`; what
is not measured keeps its rows.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

from threadpoolctl import threadpool_limits

from benchmarks.accuracy import campaigns, contact, sliding, surfaces
from benchmarks.accuracy.points import Point, gathered, write

SOLVERS: dict[str, Callable[[bool], Iterator[Point]]] = {
    "friction": sliding.kelvin,
    "indenters": sliding.indenters,
    "solids": sliding.solids,
    "jumps": contact.jumps,
    "histories": contact.histories,
    "transforms": contact.revolution,
    "wear": contact.wear,
    "films": contact.films,
    "rollers": contact.rollers,
    "master_curves": contact.master_curves,
    "measured_lines": surfaces.measured_lines,
    "maps": surfaces.maps,
    **campaigns.CAMPAIGNS,
}


def main(*names: str) -> None:
    unknown = set(names) - set(SOLVERS)
    if unknown:
        sys.exit(f"no solver {', '.join(sorted(unknown))}; known: {', '.join(SOLVERS)}")
    threadpool_limits(limits=1, user_api="blas")  # as in a worker: threads that wait for each other spin
    for name in names or SOLVERS:
        points = gathered(SOLVERS[name](False))
        write(points)
        print(f"{name}: {len(points)} points", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
