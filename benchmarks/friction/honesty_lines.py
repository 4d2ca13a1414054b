"""How honest errors are on adversarial measured lines: ``python -m benchmarks friction honesty_lines [cases [seed]]``.

So many lines of thirteen families, loads over seven and speeds over ten decades, against 512 nodes a sample: the
Kelvin body to three accuracies, and solids of one to four arms on grids and to 1 %, on rough planes and indenters too.
"""

import sys

import numpy as np

from benchmarks.friction.lines import FAMILIES, rough, samples
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.problem import PronyTerms, Request, solve
from mdr_dask.physics.sliding.steady import steady_sliding
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.shapes import PowerLaw
from mdr_dask.physics.surfaces.waves import waves_of

COLUMNS = {
    "drag": "friction",
    "depth": "depth",
    "contact_fraction": "contact fraction",
    "contact_slope": "contact slope",
}
FINEST, ROUNDING = 512, 1e-9
POINTS = 100  # of generated lines under solids with arms


def kelvin_cases(family, cases, seed):
    """Yield samples, a line, a Deborah number and a load."""
    random = np.random.default_rng([seed, FAMILIES.index(family)])
    for _ in range(cases):
        height = samples(family, random)
        waves = waves_of(height)
        fast = 10 ** random.uniform(-4, 1.5) / waves.rms_slope()
        deborah = fast if random.uniform() < 0.7 else 10 ** random.uniform(-8, 1)
        yield height, RoughLine(waves), np.array([deborah]), np.array([10 ** random.uniform(-6, 0.5)])


def truth_of(line, deborah, load):
    nodes = FINEST * line.points
    state = steady_sliding(line.cubic(nodes), deborah, load)
    assert state.status[0] == Outcome.CONVERGED
    return state


def general_cases(family, cases, seed):
    """Yield a line, arms, a dashpot and a load; the families `plane` and `indenter` are generated."""
    names = (*FAMILIES, "plane", "indenter")
    random = np.random.default_rng([seed, names.index(family)])
    for _ in range(cases):
        height = rough(random, POINTS) if family in ("plane", "indenter") else samples(family, random)
        waves, body, load = waves_of(height / height.std()), None, 10 ** random.uniform(-5, 0.7)
        if family == "indenter":
            exponent, half = float(random.choice([1, 2, random.uniform(1, 6)])), 10 ** random.uniform(-1.7, -0.6)
            steepness = 10 ** random.uniform(-1, 1.5) * waves.rms_slope() / (exponent * half ** (exponent - 1))
            body, load = (
                PowerLaw(steepness, exponent),
                2 * exponent * steepness * half ** (exponent + 1) / (exponent + 1),
            )
        number = random.integers(1, 5)
        times = np.sort(10 ** random.uniform(-6, 3, number))
        arms = PronyTerms(tuple(10 ** random.uniform(-2, 2, number)), tuple(times))
        dashpot = 10 ** random.uniform(-6, 0) if random.uniform() < 0.3 else 0.0
        yield RoughLine(waves, body), arms, np.array([dashpot]), np.array([load])


def ratios(found, exact):
    """Return errors over their estimates, and estimates over the numbers, for every column."""
    (state, errors), rows = found, []
    for column, error in zip(COLUMNS, errors[:, 0], strict=True):
        value, true = (float(getattr(each, column)[0]) for each in (state, exact))
        rows.append((abs(value - true) / (error + ROUNDING * abs(true)), error / abs(value), abs(value / true - 1)))
    return np.array(rows)


def kelvin(cases, seed, accuracy):
    """Return the ratios of all lines of a Kelvin body."""
    rows = []
    for family in FAMILIES:
        for _, line, deborah, load in kelvin_cases(family, cases, seed):
            found = solve(line, None, deborah, load, Request(accuracy=accuracy))
            rows.append(ratios(found, truth_of(line, deborah, load)))
    return np.array(rows)


def general(cases, seed, oversampling):
    """Return the ratios of all lines of solids with arms."""
    rows = []
    for family in (*FAMILIES, "plane", "indenter"):
        for line, *numbers in general_cases(family, cases, seed):
            (exact, _), found = (solve(line, *numbers, Request(oversampling=grid)) for grid in (FINEST, oversampling))
            if exact.status[0] == Outcome.CONVERGED == found[0].status[0]:
                rows.append(ratios(found, exact))
    return np.array(rows)


def table(name, rows, accuracy):
    for column, row in zip(COLUMNS.values(), np.moveaxis(rows, 1, 0), strict=True):
        covered, stated, met = np.mean(row[:, 0] <= 1), np.mean(row[:, 1] <= accuracy), np.mean(row[:, 2] <= accuracy)
        print(f"| {name} | {column} | {covered:.1%} | {stated:.1%} | {met:.1%} | {row[:, 0].max():.3g} | {len(row)} |")


def main(cases=20, seed=41):
    print("| | | below its estimate | stated within accuracy | within accuracy | largest ratio | cases |")
    print("|---|---|---|---|---|---|---|")
    for accuracy in (0.05, 0.01, 0.002):
        table(f"Kelvin, {accuracy:g}", kelvin(int(cases), int(seed), accuracy), accuracy)
    for grid in (4, 8, 16, "auto"):
        table(f"arms, {grid}", general(int(cases), int(seed), grid), 0.01)


if __name__ == "__main__":
    main(*sys.argv[1:])
