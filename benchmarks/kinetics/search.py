"""Who touches after a jump beside the largest displacement of every element: ``benchmarks kinetics search [N [SEED]]``.

Random lines, loads, speeds and jumps between a tenth and ten times, at six moments of each march. The reference knows
nothing of patches and places of leaving. Printed are the cases in which the load is off by more than a thousandth.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from references.largest_displacement import judged

MOMENTS = 6


def main(cases: str = "500", seed: str = "0") -> None:
    found = [(number, *judged(int(seed), number, MOMENTS)) for number in range(int(cases))]
    known = [each for each in found if np.isfinite(each[1])]
    off = sorted((each for each in known if each[1] > 1e-3), key=lambda each: -each[1])
    print(f"{len(known)} judged, {len(off)} off by more than a thousandth of the load")
    for number, worst, case in off:
        print(f"{number}: {worst:.2g}", ", ".join(f"{name} {value:.3g}" for name, value in case.items()))


if __name__ == "__main__":
    main(*sys.argv[1:])
