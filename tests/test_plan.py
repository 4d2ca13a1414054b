"""Templates and blocks: each result once, sensible block sizes, estimates, limits."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mdr_dask import plan
from mdr_dask.campaign import Replication, load
from mdr_dask.errors import CampaignError
from mdr_dask.execute import Resources, run


@pytest.fixture
def costs(toy, monkeypatch):
    """Give every result of the toy model a cost, and whole axes if asked."""

    def set_costs(seconds: float, /, **changes: object) -> None:
        import sys

        each = {"operations": lambda block: 1e9 * seconds * block.cases * len(block.realisations)}
        model = replace(toy.MODEL, **(each | changes))
        monkeypatch.setattr(sys.modules["mdr_dask.models.toy"], "MODEL", model)

    return set_costs


def study(toy, sizes, realisations, **changes):
    positions, slopes = sizes
    axes = toy.axis("position", np.arange(1.0, positions + 1)), toy.axis("slope", np.arange(1.0, slopes + 1))
    return replace(toy.campaign(*axes, realisations=Replication(realisations, realisations, {})), **changes)


lengths = st.integers(1, 12)


@settings(deadline=None, suppress_health_check=list(HealthCheck), max_examples=60)
@given(
    sizes=st.tuples(lengths, lengths),
    realisations=lengths,
    asked=st.dictionaries(st.sampled_from(["position", "slope", "realisation"]), st.integers(1, 20)),
    cost=st.floats(-6, 1),
)
def test_blocks_cover_every_result_exactly_once(toy, costs, sizes, realisations, asked, cost):
    costs(10.0**cost)
    (template,) = plan.templates(study(toy, sizes, realisations, blocks=asked), realisations)
    seen = np.zeros(template.shape, dtype=int)
    for index in template.block_indices():
        region, block = template.region(index), template.block(index)
        seen[region] += 1
        inside = seen[region].shape
        assert (block.cases, len(block.realisations)) == (math.prod(inside[:-1]), inside[-1])
        positions, slopes = np.meshgrid(*(np.arange(part.start, part.stop) + 1.0 for part in region[:2]), indexing="ij")
        np.testing.assert_array_equal(block.columns["position"], positions.ravel())
        np.testing.assert_array_equal(block.columns["slope"], slopes.ravel())
        assert block.realisations == tuple(range(region[2].start, region[2].stop))
    assert (seen == 1).all()
    assert all(template.chunks[dim] == min(length, template.sizes[dim]) for dim, length in asked.items())


@settings(deadline=None, suppress_health_check=list(HealthCheck), max_examples=40)
@given(sizes=st.tuples(lengths, lengths), realisations=st.integers(1, 200), cost=st.floats(-5, 1))
def test_blocks_hold_no_more_than_the_work_aimed_at_unless_one_result_does(toy, costs, sizes, realisations, cost):
    costs(10.0**cost)
    (template,) = plan.templates(study(toy, sizes, realisations), realisations)
    block = 10.0**cost * math.prod(template.chunks.values())
    assert block <= max(1.0, 10.0**cost) * (1 + 1e-9)


@settings(deadline=None, suppress_health_check=list(HealthCheck), max_examples=20)
@given(positions=st.integers(1, 300), realisations=st.integers(1, 300))
def test_without_costs_there_are_as_many_blocks_as_results_in_a_block(toy, costs, positions, realisations):
    costs(1.0, operations=None)
    campaign = study(toy, (positions, 1), realisations)
    (template,) = plan.templates(campaign, realisations)
    most = math.sqrt(positions * realisations)
    assert math.prod(template.chunks.values()) <= max(most, 1)
    assert math.prod(template.grid) <= 16 + 4 * most
    assert plan.estimate(campaign).seconds is None


def test_whole_axes_stay_whole_until_a_block_is_far_too_long(toy, costs):
    costs(1e-3, whole=("slope",))
    (template,) = plan.templates(study(toy, (30, 50), 20), 20)
    assert template.chunks["slope"] == 50
    costs(1.0, whole=("slope",))
    (template,) = plan.templates(study(toy, (30, 50), 20), 20)
    assert template.chunks["slope"] <= 4


@settings(deadline=None, suppress_health_check=list(HealthCheck), max_examples=25)
@given(sizes=st.tuples(lengths, lengths), realisations=lengths, cost=st.floats(-5, 1))
def test_estimates_add_up(toy, costs, sizes, realisations, cost):
    """A constant cost a result: edge blocks along realisations are the only thing that is extrapolated."""
    costs(10.0**cost)
    estimate = plan.estimate(study(toy, sizes, realisations))
    results = math.prod(sizes) * realisations
    assert (estimate.cases, estimate.results) == (math.prod(sizes), results)
    assert estimate.bytes == 9 * results
    assert estimate.seconds == pytest.approx(10.0**cost * results, rel=1e-9)


@pytest.mark.parametrize("blocks", [{}, {"position": 2, "realisation": 3}])
@pytest.mark.parametrize("names", [("",), ("near", "far")])
def test_the_estimated_number_of_files_is_that_of_a_run(toy, tmp_path, blocks, names):
    campaign = study(toy, (6, 2), 6, blocks=blocks)
    series = tuple(replace(campaign.series[0], name=name) for name in names)
    campaign = replace(campaign, series=series, outputs=("height", "trace"))
    url = tmp_path / "study.zarr"
    run(campaign, str(url), Resources(threads=1), lambda _: None)
    assert plan.estimate(campaign).files == sum(path.is_file() for path in url.rglob("*"))


def test_huge_studies_are_refused_series_by_series(toy, monkeypatch):
    monkeypatch.setattr(plan, "available_memory", lambda: 2.0**30)
    campaign = study(toy, (100, 100), 10**6)
    near, far = (replace(campaign.series[0], name=name) for name in ("near", "far"))
    with pytest.raises(CampaignError, match=r"series\.near: .* results need about 55.88 GiB") as e:
        plan.templates(replace(campaign, series=(near, far)), 10**6)
    assert len(e.value.args) == 2


TOO_LARGE = sorted((Path(__file__).parent / "campaign/invalid_plans").glob("*.yaml"))


@pytest.mark.parametrize("path", TOO_LARGE, ids=lambda path: path.stem)
def test_campaigns_too_large_to_run_are_refused_with_their_message(path, monkeypatch):
    monkeypatch.setattr(plan, "available_memory", lambda: 8 * 2.0**30)
    with pytest.raises(CampaignError, match=r"but this machine has") as caught:
        plan.estimate(load(path))
    assert str(caught.value).replace(str(path), path.name) == path.with_suffix(".txt").read_text().strip()
