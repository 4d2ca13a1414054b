"""Who touches after jumps to several times the velocity, beside the largest displacement of every element."""

import numpy as np
import pytest
from references.largest_displacement import judged

from mdr_dask.physics.sliding.kelvin import SUMS
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients.clearance import clearance_from
from mdr_dask.physics.transients.contact_search import Reachable, touch, workspace_for
from mdr_dask.physics.transients.ends import PreparedLine
from mdr_dask.physics.transients.free_flight import Instant
from mdr_dask.physics.transients.patches import History
from mdr_dask.physics.transients.recent import WINDOW, WINDOWS, Recent, write_recent

EVERY_MOMENT = 1000


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "number", "what"),
    [
        (11, 572, "elements that left the patch itself come under a positive force again"),
        (11, 538, "the same, and a hundred moments"),
        (11, 600, "elements of the turn before fly over the highest point"),
        (11, 1144, "elements that left where contact is no more"),
        (2601, 429, "elements that left the highest point come round to it"),
        (2602, 135, "elements fly over the highest point between two moments only"),
        (11, 724, "the line rises above the wake inside of a cell only"),
    ],
)
def test_load_of_large_jumps_at_every_moment(seed: int, number: int, what: str) -> None:
    worst, case = judged(seed, number, EVERY_MOMENT)
    assert case["ratio"] >= 5
    assert worst < 1e-3, what


def test_more_places_of_leaving_than_fit_are_told() -> None:
    points = 200
    amplitude, phase = roughness.amplitudes(points // 2, 0.0), roughness.phases(7, 1, points // 2)
    line = PreparedLine.of(periodic_line(*(roughness.line(amplitude, phase, 4 * points, order) for order in (0, 1))))
    first = line.patches(1.0, 3.0, np.empty(SUMS))
    history = History(np.array([0.0, 1e-3]), np.array([1.0, 1.0]), np.zeros(2), 2, 1.0)
    instant = Instant(line.track, first, history, 1e-3, 3.0, np.exp(-1e-3))
    everywhere = Reachable(np.array([[0, 4 * points + 1]]), np.full(4 * points + 2, -np.inf), 0.0)
    work = workspace_for(points, line.barriers(3.0), clearance_from(everywhere.from_depth - 1.0))
    assert touch(instant, everywhere, work) > 0
    few = work._replace(places=np.empty(6))
    assert touch(instant, everywhere, few) == -1


@pytest.mark.parametrize("ratio", [0.2, 5.0])
@pytest.mark.parametrize(("size", "growth"), [(1.0, -9.0), (-0.05, 3.0), (0.05, 3.0)], ids=["slows", "falls", "rises"])
def test_wakes_are_within_their_bounds(ratio: float, size: float, growth: float) -> None:
    """D u' + u of what left at any time is what the rate of the depth took, and that of what was free follows D."""
    time = np.append(0.0, np.geomspace(1e-3, 1, 30))
    depth, rate = 2 + size * np.exp(growth * time), size * growth * np.exp(growth * time)
    deborah = 100.0
    line = PreparedLine.of(periodic_line(np.cos(2 * np.pi * np.arange(64) / 64), None))
    first = line.patches(2.0, deborah / ratio, np.empty(SUMS))._replace(depth=2.0)
    recent = Recent(*np.empty((5, WINDOWS)))
    write_recent(History(time, depth, rate, time.size, 0.0), first, deborah, recent)
    for k in range(WINDOWS):
        within = time[-1] - time <= WINDOW * 2**k / deborah
        gained = -rate[within] * np.exp(time[within] - time[-1])
        assert recent.push[k] >= gained.max()
        assert recent.pull[k] <= min(gained.min(), 0)
        assert recent.lowest[k] <= (depth + rate)[within].min()
        assert recent.spread[k] >= np.ptp(depth[within])
        free = min(depth[-1], 2.0 * np.exp(-1.0)) * (1 - ratio)
        assert recent.push[k] >= free
