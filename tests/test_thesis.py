"""Claims of the thesis: a reduced study contradicts no answer in docs/thesis.md."""

import re
import sys
from functools import cache
from pathlib import Path

import pytest

from mdr_dask import fits, plots
from mdr_dask.campaign import load

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))
from benchmarks.thesis import CHAPTERS, WORDS, FromFit, Studies, word  # noqa: E402

CLAIMS = [claim for _, claims in CHAPTERS for claim in claims]
NAMES = [f"{claim.item}: {claim.claim[:30]}" for claim in CLAIMS]
PAGE = (ROOT / "docs/thesis.md").read_text().partition("## Equations")[0]
#: Realisations and points of the reduced study.
LINES, POINTS = 12, 1000


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    return Studies(LINES, POINTS, str(tmp_path_factory.mktemp("thesis")))


def answer(claim):
    """Return the answer to a claim on the page."""
    rows = [line for line in PAGE.splitlines() if line.startswith(f"| {claim.item} | {claim.claim} |")]
    assert len(rows) == 1, f"docs/thesis.md has {len(rows)} rows for {claim.item}: make it again"
    return re.split(r"(?<!\\)\|", rows[0])[3].strip().replace("**", "")


@pytest.mark.slow
@pytest.mark.parametrize("claim", CLAIMS, ids=NAMES)
def test_no_answer_is_contradicted_by_a_reduced_study(studies, claim):
    found, printed = claim.verdict(studies), answer(claim)
    assert {word(found), word(printed)} != {"yes", "no"}, found


@cache
def model_of(campaign):
    """Return the model of a shipped campaign."""
    return load(ROOT / f"campaigns/{campaign}.yaml").model


def test_every_row_has_a_word_of_the_scale_and_a_command_that_exists():
    for claim in CLAIMS:
        assert word(answer(claim)) in WORDS
        for name in re.findall(r"campaigns/(\w+)\.yaml", claim.command):
            assert model_of(name)
        for script in re.findall(r"python (\S+\.py)", claim.command):
            assert (ROOT / script).is_file()
        for campaign, name in re.findall(r"mdr-dask plot results/(\w+)\.zarr (\w+)", claim.command):
            assert name in plots.available(model_of(campaign))
        of_fit = re.match(r"mdr-dask fit results/(\w+)\.zarr (\w+)", claim.command)
        if of_fit:
            campaign, law = of_fit.groups()
            assert law in fits.available(model_of(campaign))
            assert not isinstance(claim.judge, FromFit) or (claim.judge.campaign, claim.judge.law) == (campaign, law)


def test_every_claim_has_a_row_and_every_row_a_claim():
    rows = [line for line in PAGE.splitlines() if line.startswith("| ") and not line.startswith("| item")]
    assert len(rows) == len(CLAIMS)
    assert len({(claim.item, claim.claim) for claim in CLAIMS}) == len(CLAIMS)
