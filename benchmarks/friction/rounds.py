"""What rounds of realisations cost: ``python -m benchmarks friction rounds``.

Sixteen planted cases whose lines are alike by a third stop by their own scatter. For every growth that a round may
have: rounds, lines over those that all cases need if their scatter is known, and the coverage of 95 % intervals.
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


def main():
    columns = ("growth", *(f"{needed} lines needed" for needed in NEEDED))
    print_table(columns, [row(*growth) for growth in GROWTHS])


if __name__ == "__main__":
    main()
