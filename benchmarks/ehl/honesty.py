"""Whether the stated errors of films hold: ``python -m benchmarks ehl honesty [cases] [seed]``.

Random contacts of the whole box and heavy ones (M > 200), with Barus' and Roelands' law, with and without density,
flooded and starved, solved to four accuracies and compared with solutions to 1e-6.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.measures import print_table, timed
from mdr_dask.physics.lubrication.line_contact import line_contact, solve_film

E_STAR = 115.385e9
BOXES = {
    "whole box": ((2e-6, 5e-4), (1e-13, 1e-9), (500.0, 8000.0)),
    "heavy": ((2e-5, 8e-4), (5e-14, 1e-10), (500.0, 8000.0)),
}
OPTIONS = (
    {},
    {"compressible": False},
    {"viscosity_law": "roelands", "viscosity": 0.08},
    {"viscosity_law": "roelands", "viscosity": 0.5},
    {"inlet": -1.2},
)
ACCURACIES = (1e-2, 1e-3, 3e-4, 1e-4)
LEAST_LOAD = 200.0
#: Accuracy of the reference.
REFERENCE = 1e-6


def cases(box, number, seed):
    """Return random contacts of a box; the heavy ones have M above 200."""
    random = np.random.default_rng(seed)
    found = []
    while len(found) < number:
        numbers = (float(np.exp(random.uniform(np.log(low), np.log(high)))) for low, high in BOXES[box])
        case = line_contact(numbers, E_STAR, **OPTIONS[len(found) % len(OPTIONS)])
        if box == "whole box" or case.M > LEAST_LOAD:
            found.append(case)
    return found


def films(solution):
    """Return values and errors of both films, shape (2, 2)."""
    return np.array([(float(film.value), float(film.error)) for film in (solution.central_film, solution.minimum_film)])


def main():
    number, seed = (int(argument) for argument in (*sys.argv[1:], "40", "3")[:2])
    rows = []
    for box in BOXES:
        contacts = cases(box, number, seed)
        exact = [films(solve_film(case, REFERENCE)) for case in contacts]
        for accuracy in ACCURACIES:
            found, seconds = zip(*(timed(solve_film, case, accuracy) for case in contacts), strict=True)
            errors = np.array([abs(films(one)[:, 0] / true[:, 0] - 1) for one, true in zip(found, exact, strict=True)])
            stated = np.array(
                [(films(one)[:, 1] + true[:, 1]) / true[:, 0] for one, true in zip(found, exact, strict=True)]
            )
            covered = 100 * np.mean(errors <= stated, axis=0)
            nodes = [one.finest.nodes.size for one in found]
            rows.append(
                (box, f"{accuracy:g}", *(f"{share:.0f}" for share in covered), f"{np.median(errors):.1e}",
                 f"{errors.max():.1e}", int(np.median(nodes)), max(nodes), f"{1e3 * np.median(seconds):.1f}")
            )  # fmt: skip
    print_table(
        (
            "box",
            "accuracy",
            "h_c held [%]",
            "h_min held [%]",
            "median error",
            "largest",
            "nodes",
            "most",
            "median [ms]",
        ),
        rows,
    )


if __name__ == "__main__":
    main()
