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
from benchmarks.thesis.claims import JUDGES  # noqa: E402
from benchmarks.thesis.ledger import FromFit, Studies, word  # noqa: E402
from benchmarks.thesis.page import PAGE, cells  # noqa: E402

ROWS = [cells(line) for line in PAGE.read_text().splitlines() if line.startswith("| ") and len(cells(line)) == 5][1:]
WORDS = ("yes", "approximately", "no", "not tested", "no data", "not modelled", "holds?")
#: Realisations and points of the reduced study.
LINES, POINTS = 12, 1000


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    return Studies(LINES, POINTS, str(tmp_path_factory.mktemp("thesis")))


def answer(row):
    return word(row[2].replace("**", ""))


@pytest.mark.slow
@pytest.mark.parametrize("claim", JUDGES)
def test_no_answer_is_contradicted_by_a_reduced_study(studies, claim):
    (printed,) = [answer(row) for row in ROWS if row[1] == claim]
    found = JUDGES[claim](studies)
    assert {word(found), printed} != {"yes", "no"}, found


@cache
def model_of(campaign):
    """Return the model of a shipped campaign."""
    return load(ROOT / f"campaigns/{campaign}.yaml").model


def test_every_row_has_a_word_of_the_scale_and_a_command_that_exists():
    for row in ROWS:
        _, claim, _, _, command = row
        assert answer(row) in WORDS
        for name in re.findall(r"campaigns/(\w+)\.yaml", command):
            assert model_of(name)
        for script in re.findall(r"python (\S+\.py)", command):
            assert (ROOT / script).is_file()
        for campaign, name in re.findall(r"mdr-dask plot results/(\w+)\.zarr (\w+)", command):
            assert name in plots.available(model_of(campaign))
        judge = JUDGES.get(claim)
        for campaign, law in re.findall(r"mdr-dask fit results/(\w+)\.zarr (\w+)", command):
            assert law in fits.available(model_of(campaign))
            if isinstance(judge, FromFit):
                assert (judge.campaign, judge.law) == (campaign, law)


def test_every_claim_that_is_tested_has_one_row():
    claims = [row[1] for row in ROWS]
    assert all(claims.count(claim) == 1 for claim in JUDGES)
