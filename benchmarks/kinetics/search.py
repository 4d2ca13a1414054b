"""Who touches after a jump beside the largest displacement of every element: ``benchmarks kinetics search [N [SEED]]``.

Random lines, loads, speeds and jumps between a tenth and ten times, at six moments of each march. The reference knows
nothing of patches and places of leaving. Printed are the cases in which the load is off by more than a thousandth.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import Waves
from mdr_dask.physics.transients.ends import PreparedLine, ends_on
from mdr_dask.physics.transients.velocity_jump import Transient, _Relaxation

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from references.largest_displacement import worst_moment

RATIOS = (0.1, 0.2, 0.5, 0.8, 1.2, 2.0, 5.0, 10.0)


def judged(seed: int, number: int) -> tuple[float, dict[str, float]]:
    """Return how far a random case is off, NaN if it has no transient, and what it was."""
    random = np.random.default_rng([seed, number])
    points, grid = int(random.choice([40, 80, 160])), int(random.choice([2, 4, 8, 16]))
    hurst = float(random.uniform(0, 1))
    amplitude = roughness.amplitudes(points // 2, hurst)
    line = RoughLine(Waves(0.5 * amplitude * roughness.phase_factors(seed, number, points // 2), points))
    load, ratio = 10 ** random.uniform(-3, 0.7), float(random.choice(RATIOS))
    deborah = 10 ** random.uniform(-2.5, 1.5) / roughness.spectral_slope(amplitude)
    prepared = PreparedLine.of(line.cubic(points * grid))
    loads, numbers = np.array([load]), np.array([[deborah, deborah * ratio]])
    ends = ends_on(prepared, loads, numbers)
    case = {"points": points, "grid": grid, "hurst": hurst, "load": load, "deborah": deborah, "ratio": ratio}
    if ends.outcome[0] != Outcome.CONVERGED:
        return np.nan, case
    asked = Transient(np.geomspace(0.01, 3, 20), np.pi * points, float(random.choice([6, 8, 24])))
    relaxation = _Relaxation.of(prepared, load, numbers[0], ends, 0, asked)
    return (np.nan if relaxation.is_full else worst_moment(relaxation, 6, random)), case


def main(cases: str = "500", seed: str = "0") -> None:
    found = [(number, *judged(int(seed), number)) for number in range(int(cases))]
    known = [each for each in found if np.isfinite(each[1])]
    off = sorted((each for each in known if each[1] > 1e-3), key=lambda each: -each[1])
    print(f"{len(known)} judged, {len(off)} off by more than a thousandth of the load")
    for number, worst, case in off:
        print(f"{number}: {worst:.2g}", ", ".join(f"{name} {value:.3g}" for name, value in case.items()))


if __name__ == "__main__":
    main(*sys.argv[1:])
