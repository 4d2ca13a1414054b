"""Whether the stated errors of breakthrough hold: ``python -m benchmarks mixed honesty [cases] [seed] [points...]``.

Random rollers, layers, edge rules and shortest waves, one in five with creep, each against the same waves on eight
times the points. A number below 1 is an accuracy, which chooses the points: the reference has four times its finest.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.measures import alone, print_table
from mdr_dask.models.mixed_lubrication import MODEL, declaration
from mdr_dask.models.mixed_lubrication.operation import operation_of
from mdr_dask.models.mixed_lubrication.revolution import with_first_points
from mdr_dask.physics.lubrication.breakthrough import EDGE_RULES

OUTPUTS = "breakthrough_probability", "contact_length"
PERIMETER = 2 * np.pi * 0.05
FINER = 8
#: Where the accuracy chooses: points of which every twentieth has a wave of its own.
OF_ACCURACY = 250_000


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


def judged(number, seed, points, accuracy=None):
    """Return errors and stated errors of both outputs, shape (2, cases, 2), of cases that touch at times.

    Where an accuracy chooses the points, errors are over the value; of rare contact over that of contact in 10 %.
    """
    random, rows = np.random.default_rng(seed), []
    names = MODEL.with_companions(OUTPUTS)
    while len(rows) < number:
        case = rollers(points, random)
        if accuracy:
            case = case.model_copy(update={"points": "auto", "shortest_wavelength": 20 * PERIMETER / points})
            finest = 2 * FINER * with_first_points(operation_of(case, accuracy), accuracy).source.points
        else:
            finest = FINER * points
        realisation = len(rows)
        found = alone(MODEL, case, realisation, names, seed, accuracy)
        truth = alone(
            MODEL, case.model_copy(update={"points": min(finest, declaration.MOST_POINTS)}), realisation, OUTPUTS, seed
        )
        if found and truth and 0 < truth[OUTPUTS[0]] < 1:
            rare = max(1.0, 0.1 / max(found[OUTPUTS[0]], 1e-9))
            over = [max(found[name], 1e-12) * rare if accuracy else 1.0 for name in OUTPUTS]
            errors = [abs(found[name] - truth[name]) / by for name, by in zip(OUTPUTS, over, strict=True)]
            rows.append((errors, [found[f"{name}_error"] / by for name, by in zip(OUTPUTS, over, strict=True)]))
    return np.array(rows).swapaxes(0, 1)


def main():
    number, seed = (int(argument) for argument in (*sys.argv[1:3], *("40", "3")[len(sys.argv[1:3]) :]))
    rows = []
    for asked in [float(argument) for argument in sys.argv[3:]] or [5e4, 2e5, 1e6]:
        accuracy = asked if asked < 1 else None
        errors, stated = judged(number, seed, OF_ACCURACY if accuracy else int(asked), accuracy)
        for name, error, told in zip(OUTPUTS, errors.T, stated.T, strict=True):
            held, worst = np.mean(error <= told), np.max(error / np.maximum(told, 1e-12))
            over = np.median(told / np.maximum(error, 1e-12))
            met = f"{100 * np.mean(told <= accuracy):.0f}" if accuracy else ""
            unsaid = str(np.sum((error > accuracy) & (told <= accuracy))) if accuracy else ""
            rows.append((f"{asked:g}", name, f"{100 * held:.0f}", f"{worst:.2f}", f"{over:.1f}", met, unsaid))
    heads = "points or accuracy", "output", "held [%]", "largest error over stated", "median stated over error"
    print_table((*heads, "accuracy met [%]", "missed unsaid"), rows)


if __name__ == "__main__":
    main()
