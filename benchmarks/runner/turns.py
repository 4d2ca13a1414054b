"""Threads against processes: ``python -m benchmarks runner turns``.

A study of sliding friction on two threads and on two worker processes, short and long. What the long one costs more
holds no starting.
"""

from __future__ import annotations

import resource
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.measures import print_table
from mdr_dask.campaign import loads
from mdr_dask.execute import Resources, run

#: Realisations of the short and of the long study.
LENGTHS = 1000, 6000
FRICTION = """
name: turns
model: sliding_friction
seed: 1
realisations: {realisations}
parameters:
  length: 20 mm
  points: 2000
  hurst: 0.7
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  normal_force: [0.1 N, 1.5 N, 20 N]
  velocity: {{geometric: [0.1 mm/s, 100 m/s, 25]}}
"""


def spent() -> float:
    """Return processor seconds of this process and of those that it has started and seen end."""
    found = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in found)


def compare(folder: Path) -> None:
    """Run the studies; print what each costs."""

    def cost(kind: str, realisations: int) -> np.ndarray:
        study = loads(FRICTION.format(realisations=realisations), "turns.yaml", ".")
        url = str(folder / f"{kind}{realisations}.zarr")
        wall, used = time.monotonic(), spent()
        run(study, url, Resources(**{kind: 2}), lambda _: None)
        return np.array([time.monotonic() - wall, spent() - used])

    cost("threads", 1)  # compiles
    costs = {kind: [cost(kind, realisations) for realisations in LENGTHS] for kind in ("threads", "workers")}
    longer = {kind: long - short for kind, (short, long) in costs.items()}
    rows = [
        (f"two {kind}", *(f"{each:.1f} s" for each in (*longer[kind], *costs[kind][0])))
        for kind in ("threads", "workers")
    ]
    few, many = LENGTHS
    more = f"{many - few} realisations more"
    print_table(("on", f"{more}, wall", "processors", f"{few} realisations, wall", "processors"), rows)
    print(
        "\nprocesses / threads: {:.3f} on the wall, {:.3f} of processors".format(*longer["workers"] / longer["threads"])
    )


def main() -> None:
    memory = Path("/dev/shm")  # a disk that others use would be measured instead
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        compare(Path(folder))


if __name__ == "__main__":
    main()
