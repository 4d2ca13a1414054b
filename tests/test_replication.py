"""Rounds of realisations, and the coverage of the intervals at the end."""

import numpy as np
import pytest

from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.models.base import Status
from mdr_dask.replication import growth_needed, mean_and_error, next_round


@pytest.mark.parametrize(
    ("at_least", "at_most", "count", "growth", "expected"),
    [
        (10, 500, 40, [1.0, 0.2], 40),  # nobody needs more
        (10, 500, 40, [1.01, 0.2], 50),  # a quarter more at least
        (10, 500, 40, [3.0, 2.0, 1.5, 0.5], 80),  # enough for half of those that need more
        (10, 500, 40, [1.5] * 25 + [3.0] * 24, 60),  # and for no more than half
        (10, 500, 40, [1.5] * 24 + [3.0] * 25, 120),
        (10, 500, 40, [2.01, 2.01], 81),  # no more than needed
        (10, 500, 7, [12 / 7], 12),  # and not one more for rounding
        (10, 500, 40, [np.inf, 9.0], 160),  # four times at most: what few results say of themselves is uncertain
        (10, 90, 40, [np.inf, 9.0], 90),
        (1, 4, 1, [np.inf], 4),
    ],
)
def test_the_next_round_goes_where_half_of_the_cases_have_enough(at_least, at_most, count, growth, expected):
    plan = Replication(at_least, at_most, {"y": Tolerance(0.01)})
    assert next_round(plan, count, np.array(growth)) == expected


def test_what_is_needed_follows_from_the_standard_error():
    """With a scatter of 0.3 a mean to 0.1 needs nine results, but twelve to know the scatter; to 0.05 it needs 36."""
    values = {"y": 1.0 + 0.3 * np.resize([1.0, -1.0], 20)[None] * np.sqrt(19 / 20)}
    status = np.full((1, 20), Status.DONE, dtype=np.int8)
    for asked, needed in ((0.1, 12), (0.05, 36), (1e-200, np.inf), (0.0, np.inf)):
        growth = growth_needed(values, status, {"y": Tolerance(absolute=asked)})
        assert growth * 20 == pytest.approx(needed)


def needs_more(*given):
    return growth_needed(*given) > 1


def test_a_case_that_never_succeeds_is_given_up_and_a_single_success_is_not_enough():
    status = np.array([[Status.FAILED, Status.FAILED], [Status.DONE, Status.FAILED]], dtype=np.int8)
    values = {"y": np.array([[np.nan, np.nan], [1.0, np.nan]])}
    assert needs_more(values, status, {"y": Tolerance(relative=0.5)}).tolist() == [False, True]


CAMPAIGNS = 4000


def coverage(at_least, tolerance, values):
    """Return the share of campaigns whose 95 % interval holds the truth 1, having stopped by their standard error."""
    from scipy.stats import t

    most = values.shape[1]
    plan = Replication(at_least, most, {"y": Tolerance(relative=tolerance)})
    used = np.full(len(values), at_least)
    while True:
        further = used.copy()
        for count in np.unique(used[used < most]):
            some = np.flatnonzero(used == count)
            status = np.full((some.size, count), Status.DONE, dtype=np.int8)
            growth = growth_needed({"y": values[some, :count]}, status, plan.until)
            further[some] = [next_round(plan, int(count), each) for each in growth[:, None]]
        if (further == used).all():
            break
        used = further
    mean, error = mean_and_error(values, np.arange(most) < used[:, None])
    assert (error[used < most] <= tolerance * mean[used < most]).all()
    return np.mean(np.abs(mean - 1.0) <= t.ppf(0.975, used - 1) * error)


@pytest.mark.parametrize("tolerance", [0.04, 0.1])
@pytest.mark.parametrize("at_least", [2, 5, 10, 20])
def test_the_interval_of_an_adaptive_ensemble_covers_the_truth(at_least, tolerance):
    """Stopping early favours ensembles that happen to look narrow, mostly where 4 to 40 are needed, as here."""
    values = 1.0 + 0.2 * np.random.Generator(np.random.Philox(11)).standard_normal((CAMPAIGNS, 160))
    covered = coverage(at_least, tolerance, values)
    scatter = np.sqrt(0.94 * 0.06 / CAMPAIGNS)
    assert 0.94 - 3 * scatter <= covered <= 0.95 + 4 * scatter


def test_few_results_are_enough_if_each_states_its_scatter():
    """Four revolutions that differ by 1 %, and state that scatter: their mean is known to 0.5 %."""
    four = np.array([0.99, 1.01, 1.0, 1.0])
    values = {"y": np.array([four, four, 1 + 30 * (four - 1), four])}
    status = np.full((4, 4), Status.DONE, dtype=np.int8)
    until = {"y": Tolerance(relative=0.006)}
    scatter = {"y": np.array([[0.01] * 4, [0.02] * 4, [0.01] * 4, [np.nan] * 4])}
    assert needs_more(values, status, until, scatter).tolist() == [False, True, True, True]
    assert needs_more(values, status, until).tolist() == [True] * 4
    status[1] = [Status.DONE, Status.FAILED, Status.FAILED, Status.FAILED]
    assert needs_more(values, status, until, scatter).tolist() == [False, True, True, True]


def test_the_scatter_within_realisations_is_of_the_mean():
    """The standard error of n realisations is that of one over the root of n."""
    status = np.full((2, 4), Status.DONE, dtype=np.int8)
    values = {"y": np.ones((2, 4))}
    values["y"][:, 0] += 0.004  # scatters, so that it does not count as all the same
    for asked, more in ((0.0151, [False, False]), (0.0149, [True, False])):
        scatter = {"y": np.array([[0.03] * 4, [0.029] * 4])}
        assert needs_more(values, status, {"y": Tolerance(relative=asked)}, scatter).tolist() == more
