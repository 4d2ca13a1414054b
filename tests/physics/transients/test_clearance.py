"""Cells that rest save looks only: a march in which none rests finds the same, and loads are those asked for."""

import numpy as np
import pytest
from references.largest_displacement import marched, searched_afresh

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.kelvin import SUMS
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients import velocity_jump
from mdr_dask.physics.transients.clearance import APPROACH, LARGEST, TIME, Clearance, approached, clearance_from, rests
from mdr_dask.physics.transients.ends import PreparedLine, ends_on
from mdr_dask.physics.transients.free_flight import Instant
from mdr_dask.physics.transients.patches import LOAD, History
from mdr_dask.physics.transients.recent import WINDOWS, Recent
from mdr_dask.physics.transients.velocity_jump import Transient, velocity_jumps

POINTS = 400
TIMES = np.geomspace(1e-3, 5, 25)
LOADS, DEBORAHS = np.array([0.003, 0.05, 0.8]), np.array([3e-4, 5e-3, 0.08, 1.5])


def rough(hurst: float, oversampling: int = 4) -> PreparedLine:
    amplitude, phase = roughness.amplitudes(POINTS // 2, hurst), roughness.phases(31, 0, POINTS // 2)
    nodes = POINTS * oversampling
    return PreparedLine.of(periodic_line(*(roughness.line(amplitude, phase, nodes, order) for order in (0, 1))))


def never_resting(until: np.ndarray) -> Clearance:
    clearance = clearance_from(np.full(until.size, -np.inf))
    clearance.state[LARGEST] = np.inf
    return clearance


@pytest.mark.parametrize("ratio", [0.1, 0.5, 0.83, 1.2, 2.0, 10.0])
@pytest.mark.parametrize("hurst", [0.0, 0.5, 1.0])
def test_cells_that_rest_change_nothing(hurst: float, ratio: float, monkeypatch: pytest.MonkeyPatch) -> None:
    line, (loads, before) = rough(hurst), (axis.ravel() for axis in np.meshgrid(LOADS, DEBORAHS))
    numbers = np.column_stack([before, ratio * before])
    ends, asked = ends_on(line, loads, numbers), Transient(TIMES, np.pi * POINTS, 4)
    some = velocity_jumps(line, loads, numbers, ends, asked)
    monkeypatch.setattr(velocity_jump, "clearance_from", never_resting)
    every = velocity_jumps(line, loads, numbers, ends, asked)
    assert [jump.outcome for jump in some] == [jump.outcome for jump in every]
    for few, all_ in zip(some, every, strict=True):
        if all_.outcome == Outcome.CONVERGED and all_.moments:
            # where a line is looked at decides the last digits of where it meets a wake
            assert few.path[1] == pytest.approx(all_.path[1], abs=1e-7 * np.ptp(all_.path[1]) + 1e-12 * all_.after)


@pytest.mark.parametrize("ratio", [0.2, 1.2, 5.0, 10.0])
def test_every_moment_carries_the_load(ratio: float) -> None:
    """A fresh search at the depths of a march finds the load, of single asperities after large jumps too."""
    line, (loads, before) = rough(0.7, 8), (axis.ravel() for axis in np.meshgrid([0.02, 0.2], DEBORAHS))
    numbers, missing = np.column_stack([before, ratio * before]), []
    ends, asked = ends_on(line, loads, numbers), Transient(TIMES, np.pi * POINTS, 6)
    for k in range(loads.size):
        marching, found, work, count = marched(velocity_jump._Relaxation.of(line, loads[k], numbers[k], ends, k, asked))
        for now in range(1, count):
            searched_afresh(marching, found, now, work)
            missing.append(abs(work.sums[LOAD] / marching.load - 1))
    assert len(missing) > 100
    assert np.mean(np.array(missing) > 1e-3) < 0.01  # the load leaps where a patch comes or goes


def test_the_approach_adds_up_and_any_other_moment_wakes_all() -> None:
    line = rough(0.7)
    first, recent = line.patches(1.0, 50.0, np.empty(SUMS)), Recent(*np.zeros((5, WINDOWS)))
    clearance = clearance_from(np.full(int(line.track.cells) + 2, -np.inf))

    def seen(times: list[float], depths: list[float], push: float) -> float:
        recent.push[WINDOWS - 1] = push
        history = History(np.array(times), np.array(depths), np.zeros(len(times)), len(times), 1.0)
        now = Instant(line.track, first, history, times[-1], 50.0, 0.5)
        return approached(now, recent, clearance.state)

    assert seen([0.0, 0.1], [1.0, 1.5], 0.0) == pytest.approx(0.5)  # beyond the first depth, at which cells were judged
    assert seen([0.0, 0.1], [1.0, 1.4], 0.0) == pytest.approx(0.5 + 4 * 0.1)  # another guess
    # the depth taken differs from the guess by 0.05; then it rises by 0.1 and elements fade by 0.3 in a time of 0.2
    assert seen([0.0, 0.1, 0.3], [1.0, 1.45, 1.55], 1.5) == pytest.approx(0.9 + 4 * 0.05 + 0.1 + 0.3)
    # the line goes away: nothing has come nearer
    assert seen([0.0, 0.1, 0.3, 0.4], [1.0, 1.45, 1.55, 0.5], 0.0) == pytest.approx(1.5)
    rests(clearance, 7, 0.25)
    assert clearance.until[7] == clearance.state[LARGEST] == pytest.approx(1.75)
    # a step is given up: what was seen beyond it does not count
    assert seen([0.0, 0.1, 0.3, 0.35], [1.0, 1.45, 1.55, 1.5], 0.0) >= clearance.until[7]
    assert clearance.state[TIME] == 0.35
    assert clearance.state[APPROACH] >= clearance.state[LARGEST]
