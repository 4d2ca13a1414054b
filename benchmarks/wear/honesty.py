"""How many stated errors of worn contacts hold: ``python -m benchmarks wear honesty [CASES [SEED [KIND...]]]``.

Random bodies (n = 0.6 to 8) at three random amounts of wear each, on a seed that nothing was chosen on, against a much
finer solution. Kinds are depth, force, slid and slid_force.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.measures import print_table
from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.wear.evolution import NotConvergedError
from mdr_dask.physics.wear.exact import exact
from mdr_dask.physics.wear.worn import Worn


class Kind(NamedTuple):
    """What is kept, whether all slips, the accuracies judged, that of the truth, and what is judged."""

    held: bool
    slid: bool
    accuracies: tuple[float, ...]
    truth: float
    outputs: tuple[str, ...]


NUMBERS = ("contact_radius", "normal_force", "wear_volume", "worn_depth")
KINDS = {
    "depth": Kind(False, False, (1e-1, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4), 1e-5, NUMBERS),
    "force": Kind(True, False, (1e-1, 1e-2, 1e-3, 3e-4, 1e-4), 2e-5, (*NUMBERS, "stick_border", "depth")),
    "slid": Kind(False, True, (1e-1, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4), 1e-5, NUMBERS),
    "slid_force": Kind(True, True, (1e-1, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4), 1e-5, (*NUMBERS, "depth")),
}


def judged(found: Worn, true: Worn, stick: float, outputs: Sequence[str]) -> list[tuple[float, float]]:
    """Return error and stated error of the worst place of the profile, and of numbers."""
    radii = stick + (1.2 * true.contact_radius - stick) * np.sin(0.5 * np.pi * np.arange(1, 200) / 200.0) ** 3
    gap = np.max(np.abs(found.height(radii) - true.height(radii)))
    pairs = [(float(gap), float(np.max(found.error("worn_profile", radii))))]
    for name in outputs:
        apart = abs(float(found.value(name, radii)) - float(true.value(name, radii)))
        pairs.append((apart, float(found.error(name, radii)) + 1e-14))
    return pairs


def main(cases: str = "40", seed: str = "0", *names: str) -> None:
    """Print for each kind and accuracy: error over accuracy, and share held, worst and median of each output."""
    for name in names or KINDS:
        kind, random = KINDS[name], np.random.default_rng(int(seed))
        rows: dict[float, list[list[tuple[float, float]]]] = {accuracy: [] for accuracy in kind.accuracies}
        missed: dict[float, list[float]] = {accuracy: [] for accuracy in kind.accuracies}
        for _ in range(int(cases)):
            profile = PowerProfile(float(np.exp(random.uniform(np.log(0.6), np.log(8.0)))))
            stick = 0.0 if kind.slid else float(random.uniform(0.05, 0.999))
            amounts = sorted((10.0 ** random.uniform(*((-3.0, 1.3) if kind.slid else (-1.5, 1.2)), 3)).tolist())
            try:
                truth = exact(profile, stick, amounts, kind.truth, constant_force=kind.held, errors=False)
            except NotConvergedError as reason:
                print(f"no truth for n = {profile.exponent:.3g}, c = {stick:.3g}: {reason}")
                continue
            scale = 1.0 - float(profile.image(np.array(stick)))
            for accuracy in kind.accuracies:
                found = exact(profile, stick, amounts, accuracy, constant_force=kind.held)
                for one, true in zip(found, truth, strict=True):
                    rows[accuracy].append(judged(one, true, stick, kind.outputs))
                    missed[accuracy].append(rows[accuracy][-1][0][0] / scale / accuracy)
        table = []
        for accuracy, pairs in rows.items():
            ratios = np.array([[error / stated for error, stated in row] for row in pairs])
            cells = [
                f"{100 * np.mean(column <= 1):.0f} %, {np.max(column):.2g}, {1 / np.median(column):.2g}"
                for column in ratios.T
            ]
            table.append((f"{accuracy:g}", f"{np.quantile(missed[accuracy], 0.95):.2g}", *cells))
        print(f"{name}: held, worst error over stated, median of stated over error")
        print_table(("accuracy", "error over accuracy, 95 %", "worn_profile", *kind.outputs), table)
        sys.stdout.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
