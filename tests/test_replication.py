"""Rounds of realisations and the coverage of what they end with."""

import numpy as np
import pytest

from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.models.base import Status
from mdr_dask.replication import mean_and_error, needs_more, rounds


@pytest.mark.parametrize(
    ("replication", "expected"),
    [
        (Replication(20, 20, {}), [20]),
        (Replication(20, 100, {}), [20]),
        (Replication(20, 100, {"y": Tolerance(0.01)}), [20, 40, 60, 100]),
        (Replication(1, 4, {"y": Tolerance(0.01)}), [1, 2, 3, 4]),
    ],
)
def test_rounds(replication, expected):
    found = list(rounds(replication))
    assert found == expected


def test_only_results_that_are_done_count():
    values = np.array([[1.0, 2.0, np.nan, 3.0]])
    mean, error = mean_and_error(values, np.array([[True, True, False, True]]))
    assert mean == pytest.approx(2.0)
    assert error == pytest.approx(1 / np.sqrt(3))


def test_a_case_that_never_succeeds_is_given_up_and_a_single_success_is_not_enough():
    status = np.array([[Status.FAILED, Status.FAILED], [Status.DONE, Status.FAILED]], dtype=np.int8)
    values = {"y": np.array([[np.nan, np.nan], [1.0, np.nan]])}
    assert needs_more(values, status, {"y": Tolerance(relative=0.5)}).tolist() == [False, True]


@pytest.mark.parametrize(("at_least", "promised"), [(20, 0.94), (10, 0.94), (5, 0.93), (2, 0.89)])
def test_the_interval_of_an_adaptive_ensemble_covers_the_truth(at_least, promised):
    """4000 campaigns stopped by their own standard error: 95 % intervals cover as often as promised, within 4 sigma.

    Stopping early favours ensembles that happen to look narrow, which costs coverage, and more of it the smaller the
    first round is.
    """
    from scipy.stats import t

    campaigns = 4000
    plan = Replication(at_least, 640, {"y": Tolerance(relative=0.03)})
    generator = np.random.Generator(np.random.Philox(11))
    values = 1.0 + 0.2 * generator.standard_normal((campaigns, 640))
    used = np.full(campaigns, plan.at_most)
    open_cases = np.ones(campaigns, dtype=bool)
    for count in rounds(plan):
        status = np.full((campaigns, count), Status.DONE, dtype=np.int8)
        wide = needs_more({"y": values[:, :count]}, status, plan.until)
        used[open_cases & ~wide] = count
        open_cases &= wide
    valid = np.arange(640) < used[:, None]
    mean, error = mean_and_error(values, valid)
    covered = np.mean(np.abs(mean - 1.0) <= t.ppf(0.975, used - 1) * error)
    assert (error[used < 640] <= 0.03 * mean[used < 640]).all()
    scatter = np.sqrt(promised * (1 - promised) / campaigns)
    assert promised - 4 * scatter <= covered <= 0.95 + 4 * scatter
