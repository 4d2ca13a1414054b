"""What rounds of realisations cost: ``python -m benchmarks friction rounds``.

Sixteen planted cases whose lines are alike by a third stop by their own scatter. For every growth that a round may
have: rounds, lines over those that all cases need if their scatter is known, and the coverage of 95 % intervals.
Then a single case: for every rule that says how many lines know their scatter, lines and coverage.
"""

import numpy as np
from scipy.stats import t

from benchmarks.measures import print_table
from mdr_dask import replication
from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.models.base import Status
from mdr_dask.replication import growth_needed, mean_and_error, next_round

CASES, COMMON, MOST, CAMPAIGNS = 16, 0.3, 1500, 300
NEEDED = (2, 8, 12, 25, 60, 250)  # lines of the middle case; the others need 1/e to e times as many
GROWTHS = ((1.1, 4.0), (1.25, 2.0), (1.25, 4.0), (1.25, 16.0), (1.5, 1.5), (1.5, 4.0))  # least and most
#: Lines taken at their word, fewer that count, and how many times as large their variance may be.
RULES = ((10, 10, 1.0), (6, 6, 1.0), (10, 6, 2.0), (10, 7, 2.0), (12, 7, 2.0), (12, 7, 2.5), (14, 8, 2.0), (20, 7, 2.0))
STARTS, SINGLE = (2, 7, 10, 20), {"y": Tolerance(absolute=1.0)}
SCATTERS = (2, 4, 8, 12, 17, 25)  # lines that a single case needs
REPEATED, LONGEST = 40_000, 90


def campaign(draw, scatter, tolerance, at_least=10):
    """Return rounds, lines of each case, and whether its 95 % interval holds the truth, 1."""
    common = np.sqrt(COMMON) * draw.standard_normal(MOST)
    values = 1 + scatter[:, None] * (common + np.sqrt(1 - COMMON) * draw.standard_normal((CASES, MOST)))
    plan = Replication(at_least, MOST, {"y": Tolerance(absolute=tolerance)})
    used, running, count, rounds = np.zeros(CASES, dtype=int), np.ones(CASES, dtype=bool), at_least, 1
    while True:
        used[running] = count
        status = np.full((CASES, count), Status.DONE, dtype=np.int8)
        growth = np.where(running, growth_needed({"y": values[:, :count]}, status, plan.until), 0.0)
        running = growth > 1
        further = next_round(plan, count, growth)
        if further == count:
            break
        count, rounds = further, rounds + 1
    mean, error = mean_and_error(values, np.arange(MOST) < used[:, None])
    return rounds, used, np.abs(mean - 1) <= t.ppf(0.975, used - 1) * error


def row(least, most):
    replication.LEAST_GROWTH, replication.MOST_GROWTH = least, most
    cells = []
    for needed in NEEDED:
        draw, scatter = np.random.default_rng(needed), np.exp(np.linspace(-0.5, 0.5, CASES))
        found = [campaign(draw, scatter, needed**-0.5) for _ in range(CAMPAIGNS)]
        rounds, lines, covered = (np.mean(column) for column in zip(*found, strict=True))
        cells.append(f"{rounds:.1f}, {lines / np.mean(np.maximum(needed * scatter**2, 10)):.2f}, {covered:.1%}")
    return f"{least:g} to {most:g}", *cells


def single(values, at_least, needed):
    """Return for cases of one at a time how many lines each ends with."""
    plan, used = Replication(at_least, LONGEST, SINGLE), np.full(len(values), at_least)
    going = np.arange(len(values))
    while going.size:
        further = []
        for count in np.unique(used[going]):
            some = going[used[going] == count]
            status = np.full((some.size, count), Status.DONE, dtype=np.int8)
            growth = growth_needed({"y": np.sqrt(needed) * values[some, :count]}, status, plan.until)
            told, which = np.unique(np.ceil(1000 * np.minimum(growth, 5.0)), return_inverse=True)
            after = np.array([next_round(plan, int(count), each[None] / 1000) for each in told])[which]
            used[some] = after
            further.append(some[(after > count) & (after < LONGEST)])
        going = np.concatenate(further)
    return used


def rule(values, fewest, few, doubt):
    replication.FEWEST, replication.FEW, replication.DOUBT = fewest, few, doubt
    mean, square = np.cumsum(values, axis=1), np.cumsum(values**2, axis=1)
    cells = []
    for at_least in STARTS:
        found = []
        for needed in SCATTERS:
            used = single(values, at_least, needed)
            total, squares = (sums[np.arange(len(used)), used - 1] for sums in (mean, square))
            error = np.sqrt((squares - total**2 / used) / (used - 1) / used)
            found.append((np.mean(np.abs(total / used) <= t.ppf(0.975, used - 1) * error), used.mean()))
        covered, lines = zip(*found, strict=True)
        cells.append(f"{min(covered):.1%}, {', '.join(f'{number:.1f}' for number in lines)}")
    return f"{fewest}, or {few} at {doubt:g}", *cells


def main():
    columns = ("growth", *(f"{needed} lines needed" for needed in NEEDED))
    print_table(columns, [row(*growth) for growth in GROWTHS])
    replication.LEAST_GROWTH, replication.MOST_GROWTH = GROWTHS[2]
    columns = ("results", *(f"from {at_least} on: least coverage, lines" for at_least in STARTS))
    for draws in (np.random.default_rng(5).standard_normal, np.random.default_rng(6).standard_exponential):
        values = draws((REPEATED, LONGEST))
        values -= 1.0 if values.min() >= 0 else 0.0
        print_table(columns, [rule(values, *each) for each in RULES])


if __name__ == "__main__":
    main()
