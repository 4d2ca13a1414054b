"""Every kind of benchmark in a short form, and the pages made by benchmarks."""

import importlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from benchmarks import __main__ as command
from benchmarks import accuracy, campaigns, peers
from benchmarks.solvers import SOLVERS
from benchmarks.surfaces import validity

#: Random cases of each family; more where a case takes milliseconds.
CASES = {"wear": 2, "velocity jump": 2, "breakthrough of one revolution": 1, "levels of a jump": 20}


def test_every_command_that_is_named_exists():
    root = Path(__file__).parents[1]
    for path in [*root.glob("*.md"), *root.glob("docs/**/*.md"), *root.glob("mdr_dask/**/*.py")]:
        for kind, argument in re.findall(r"python -m benchmarks (\w+)(?: (\w+))?", path.read_text()):
            assert kind in command.KINDS, f"{path}: no benchmark {kind}"
            if kind == "accuracy" and argument:
                assert argument in SOLVERS, f"{path}: no solver {argument}"


@pytest.mark.parametrize("made", [accuracy, peers, validity])
def test_the_tables_of_a_page_follow_from_the_evidence(made):
    page = made.PAGE.read_text()
    assert made.text(page) == page


@pytest.mark.slow
@pytest.mark.parametrize("name", SOLVERS)
def test_stated_errors_hold_and_accuracies_are_met(name):
    """95 % of the errors hold, less 3 sigma of as many draws as there are cases, whose values are correlated."""
    rows = list(SOLVERS[name].measure(CASES.get(name, 6), 77))
    assert {row.case for row in rows} == set(SOLVERS[name].families)
    for row in rows:
        assert row.seconds >= 0
        assert not row.held < 0.95 - 3 * np.sqrt(0.95 * 0.05 / row.cases), row
        if row.method == "accuracy":
            assert row.error <= float(row.setting), row
    assert min(row.error for row in rows) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("name", campaigns.STUDIES)
def test_a_campaign_meets_its_accuracy(name):
    study = campaigns.STUDIES[name]
    ((accuracy, error, inside, _),) = study.measure(1, [max(study.asked)])
    assert error < accuracy
    assert inside > 0.9


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the peers
@pytest.mark.parametrize("subject", peers.SUBJECTS)
def test_solvers_are_compared_with_the_peers_that_are_installed(subject):
    rows = list(importlib.import_module(f"benchmarks.peers.{subject}").compared())
    assert all(f"<!-- {row.solver} -->" in peers.PAGE.read_text() for row in rows)
    assert all(row.error < 0.1 for row in rows if row.method == peers.OURS)
