"""Progress: nothing is silent, compiling is no pace, and the time left does not lie."""

import re
import sys
import time
from dataclasses import replace

import pytest

from mdr_dask import bars as shown
from mdr_dask import compile_clock as clocks
from mdr_dask import execute
from mdr_dask.bars import at_work, describe, reporter
from mdr_dask.execute import Progress
from mdr_dask.models.base import Status
from mdr_dask.task import Outcome

BLOCK, BLOCKS, THREADS, COMPILING = 0.5, 100, 2, 20.0


def after_blocks(count: int) -> Progress:
    """Return the state after some blocks of half a second on two threads, which compiled for 20 s before the first."""
    progress = Progress(total=10 * BLOCKS, estimated=2 * BLOCK * BLOCKS)  # estimated twice too long
    counts = tuple(10 if state == Status.DONE else 0 for state in Status)
    for done in range(1, count + 1):
        compiling = COMPILING if done <= THREADS else 0.0
        wall = COMPILING + BLOCK * -(-done // THREADS)
        progress = progress.after(Outcome(counts, 10, 2 * BLOCK, compiling + BLOCK, 0.0, compiling), wall)
    return progress


@pytest.mark.parametrize("count", [2, 4, 20, 99])
def test_compiling_is_no_pace(count):
    left = (BLOCKS - count) * BLOCK / THREADS
    assert after_blocks(count).seconds_left == pytest.approx(left, rel=0.1)


def test_time_left_is_told_from_the_first_block_on_however_short():
    counts = tuple(int(state == Status.DONE) for state in Status)
    progress = Progress(total=10, estimated=1e-3).after(Outcome(counts, 1, 1e-4, 2e-4, 0.0, 0.0), 2e-4)
    assert progress.seconds_left == pytest.approx(9 * 2e-4)
    assert Progress(total=10, estimated=1e-3).seconds_left is None


def test_a_slow_block_contradicts_the_time_left():
    assert "about 20 s left" in describe(after_blocks(20), 25.0)
    assert "about 5 s left" in describe(after_blocks(20), 40.0, unchanged=15.0)
    assert "left" not in describe(after_blocks(20), 50.0, unchanged=25.0)


def test_the_clock_hears_numba():
    import numba

    clock = clocks.compile_clock()
    before = clock.seconds
    assert numba.njit(lambda number: number + 1)(1) == 2
    assert clock.seconds > before
    assert not clock.is_running


def test_lines_come_though_nothing_ends(monkeypatch, capsys):
    monkeypatch.setattr(shown, "PAUSE", 0.02)
    with reporter(quiet=False) as report:
        assert printed_in_time(capsys, r"preparing, \d+ s")
        report(Progress(total=50))
        assert printed_in_time(capsys, r"0 %, \d+ s, 0 of 50 results, 0 failed")


def test_a_terminal_is_told_what_takes_long_and_a_pipe_is_not(monkeypatch, capsys):
    monkeypatch.setattr(shown, "PAUSE", 0.02)
    with at_work("drawing"):
        time.sleep(0.2)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with at_work("drawing"):
        assert printed_in_time(capsys, r"drawing, \d+ s")


def printed_in_time(capsys, line):
    """Say whether a line is printed within a minute."""
    end = time.monotonic() + 60
    while time.monotonic() < end:
        if any(re.fullmatch(line, said) for said in capsys.readouterr().err.splitlines()):
            return True
        time.sleep(0.01)
    return False


def test_what_is_left_at_the_end_of_a_round_is_nothing(toy, url):
    """What a run is to take grows by every round, by as much as its blocks then are."""
    reported = []
    more = toy.Replication(10, 20, {"height": toy.Tolerance(absolute=1.0)})
    study = toy.campaign(toy.axis("position", [1.0, 100.0]), realisations=more)
    study = replace(study, blocks={"realisation": 10})
    progress = execute.run(study, url, execute.Resources(), reported.append)
    rounds = list(dict.fromkeys(each.estimated for each in reported))
    assert len(rounds) > 1
    assert rounds == sorted(rounds)
    assert progress.finished == pytest.approx(progress.estimated)
