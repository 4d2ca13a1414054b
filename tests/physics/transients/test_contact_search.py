"""The contact at an instant, compared with an exhaustive search and with every element."""

import numpy as np
import pytest
from references.largest_displacement import judged, searched_afresh
from schemes import rough_line

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients import velocity_jump
from mdr_dask.physics.transients.limits import PreparedLine, steady_limits
from mdr_dask.physics.transients.patches import LOAD
from mdr_dask.physics.transients.velocity_jump import MarchRequest, jump_between, march

TIMES = np.geomspace(1e-3, 5, 25)
EVERY_MOMENT = 1000


def rough(points: int, hurst: float, oversampling: int = 4, seed: int = 7) -> PreparedLine:
    return PreparedLine.of(periodic_line(*rough_line(points, oversampling, hurst, seed)))


@pytest.mark.parametrize("ratio", [0.2, 10.0])
def test_every_moment_carries_the_load(ratio: float) -> None:
    """A new search at the depths of a march finds the load, in single asperities after large jumps too."""
    line, (loads, before) = (
        rough(400, 0.7, 8, 31),
        (axis.ravel() for axis in np.meshgrid([0.02, 0.2], [3e-4, 5e-3, 0.08, 1.5])),
    )
    numbers, missing = np.column_stack([before, ratio * before]), []
    limits, request = steady_limits(line, loads, numbers), MarchRequest(TIMES, np.pi * 400, 6)
    for k in range(loads.size):
        marching, found, work, outcome = march(line, loads[k], numbers[k], limits[k], request)
        assert outcome == Outcome.CONVERGED
        for now in range(1, found.time.size):
            searched_afresh(marching, found, now, work)
            missing.append(abs(work.sums[LOAD] / marching.load - 1))
    assert len(missing) > 100
    assert np.mean(np.array(missing) > 1e-3) < 0.02  # the load is discontinuous where a patch appears or vanishes


@pytest.mark.parametrize(
    ("hurst", "load", "deborah", "ratio"),
    [(0.7, 1.16, 1.0, 0.4), (0.7, 25.0, 1.0, 5.0), (0.3, 5.4, 1.0, 5.0), (0, 0.0539, 0.147, 5.0)],
)
def test_skipped_cells_change_nothing(hurst, load, deborah, ratio, monkeypatch) -> None:
    line, both = rough(1000, hurst, 4, 2014), np.array([[deborah, ratio * deborah]])
    limits, request = steady_limits(line, np.array([load]), both)[0], MarchRequest(TIMES, 1000 * np.pi, 6)
    near = jump_between(line, load, both[0], limits, request)
    nodes = line.track.height.size
    monkeypatch.setattr(velocity_jump, "_runs", lambda *_: (np.array([[0, nodes - 1]]), np.full(nodes, -np.inf)))
    whole = jump_between(line, load, both[0], limits, request)
    assert near.outcome == whole.outcome == Outcome.CONVERGED
    assert np.max(np.abs(near.trace - whole.trace)) <= 0.01 * np.max(np.abs(whole.trace - limits.after))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "number", "what"),
    [
        (11, 572, "elements that separated in the patch itself come under a positive force again"),
        (11, 600, "elements of the period before pass over the highest point"),
        (11, 1144, "elements that separated where there is no contact any more"),
        (2602, 135, "elements pass over the highest point between two moments only"),
        (11, 724, "the line is above free elements inside a cell only"),
    ],
)
def test_load_of_large_jumps_at_every_moment(seed: int, number: int, what: str) -> None:
    worst, case = judged(seed, number, EVERY_MOMENT)
    assert case["ratio"] >= 5
    assert worst < 1e-3, what


@pytest.mark.slow
def test_load_of_random_jumps_is_that_of_every_element() -> None:
    worst = np.array([judged(4100, number, 6)[0] for number in range(80)])
    assert np.count_nonzero(np.isfinite(worst)) > 30
    assert np.nanmean(worst > 1e-3) < 0.02
