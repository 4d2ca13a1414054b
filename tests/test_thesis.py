"""The ledger of the thesis: every figure made again on a reduced study, and no verdict changes."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))
from benchmarks.thesis import CHAPTERS, Studies  # noqa: E402

CLAIMS = [claim for _, claims in CHAPTERS for claim in claims]
PAGE = (ROOT / "docs/thesis.md").read_text()
#: Realisations and points of the reduced study.
LINES, POINTS = 12, 1000


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    return Studies(LINES, POINTS, str(tmp_path_factory.mktemp("thesis")))


def row(claim):
    """Return the cells of a claim on the page."""
    rows = [line for line in PAGE.splitlines() if line.startswith(f"| {claim.item} | {claim.claim} |")]
    assert len(rows) == 1, f"docs/thesis.md has {len(rows)} rows for {claim.item}: make it again"
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", rows[0])[1:-1]]


@pytest.mark.slow
@pytest.mark.parametrize("claim", CLAIMS, ids=[f"{claim.item}: {claim.claim[:30]}" for claim in CLAIMS])
def test_no_verdict_changes_on_a_reduced_study(studies, claim):
    found = claim.judge(studies)
    assert f"**{found.verdict}**" == row(claim)[3], found.figure


def test_every_claim_has_a_row_and_every_row_a_claim():
    rows = [line for line in PAGE.splitlines() if line.startswith("| ") and not line.startswith("| item")]
    assert len(rows) == len(CLAIMS)
    assert len({(claim.item, claim.claim) for claim in CLAIMS}) == len(CLAIMS)
