"""Whether the stated errors of breakthrough hold: ``python -m benchmarks mixed honesty [cases] [seed] [points...]``.

Random rollers, layers, edge rules and shortest waves, one in five with creep, each against the same waves on eight
times the points.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.measures import alone, print_table
from mdr_dask.models.mixed_lubrication import MODEL, declaration
from mdr_dask.physics.lubrication.breakthrough import EDGE_RULES

OUTPUTS = "breakthrough_probability", "contact_length"
PERIMETER = 2 * np.pi * 0.05
FINER = 8


def rollers(points, random):
    """Return a random case whose shortest wave has 2.5 to 20 spacings."""
    return declaration.MixedLubrication(
        normal_force=random.uniform(200, 1200),
        rotation_speed=10 ** random.uniform(-1, 1),
        temperature=random.uniform(315, 370),
        rms_roughness=2e-7,
        layer_thickness=10 ** random.uniform(-9, -7.5),
        edge_rule=random.choice(EDGE_RULES),
        slide_roll_ratio=random.choice([0.0, 0.0, 0.0, 0.0, 0.03]),
        points=points,
        shortest_wavelength=2.5 * 8 ** random.uniform() * PERIMETER / points,
    )


def judged(number, seed, points):
    """Return errors and stated errors of both outputs, shape (2, cases, 2), of cases that touch at times."""
    random, rows = np.random.default_rng(seed), []
    names = MODEL.with_companions(OUTPUTS)
    while len(rows) < number:
        case = rollers(points, random)
        realisation = len(rows)
        found = alone(MODEL, case, realisation, names, seed)
        truth = alone(MODEL, case.model_copy(update={"points": FINER * points}), realisation, OUTPUTS, seed)
        if found and truth and 0 < truth[OUTPUTS[0]] < 1:
            errors = [abs(found[name] - truth[name]) for name in OUTPUTS]
            rows.append((errors, [found[f"{name}_error"] for name in OUTPUTS]))
    return np.array(rows).swapaxes(0, 1)


def main():
    number, seed, *chosen = (int(argument) for argument in (*sys.argv[1:], "40", "3")[: max(2, len(sys.argv) - 1)])
    rows = []
    for points in chosen or (50_000, 200_000, 1_000_000):
        errors, stated = judged(number, seed, points)
        for name, error, told in zip(OUTPUTS, errors.T, stated.T, strict=True):
            held, worst = np.mean(error <= told), np.max(error / np.maximum(told, 1e-12))
            over = np.median(told / np.maximum(error, 1e-12))
            rows.append((points, name, f"{100 * held:.0f}", f"{worst:.2f}", f"{over:.1f}"))
    print_table(("points", "output", "held [%]", "largest error over stated", "median stated over error"), rows)


if __name__ == "__main__":
    main()
