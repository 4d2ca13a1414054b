"""Who touches what: under a depth that has long been constant, the contact is that of the steady sweep."""

import numpy as np
import pytest

from mdr_dask.physics.sliding.kelvin import DISPLACEMENT, DRAG, SUMS, barriers_for, patches_at
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients import patches
from mdr_dask.physics.transients.clearance import clearance_from
from mdr_dask.physics.transients.contact_loss import motion_at
from mdr_dask.physics.transients.contact_search import Reachable, touch, workspace_for
from mdr_dask.physics.transients.ends import PreparedLine
from mdr_dask.physics.transients.free_flight import Instant
from mdr_dask.physics.transients.patches import History

POINTS = 200
LONG = 100.0  # relaxation times after which nothing is left of the state before


@pytest.mark.parametrize("oversampling", [1, 2, 4])
@pytest.mark.parametrize("hurst", [0.0, 0.4, 0.8])
@pytest.mark.parametrize("deborah", [1e-3, 0.3, 10.0, 1e3])
def test_contact_is_that_of_the_sweep(hurst: float, oversampling: int, deborah: float) -> None:
    """On coarse grids contact comes and goes inside of single cells, which both must see."""
    amplitude, phase = roughness.amplitudes(POINTS // 2, hurst), roughness.phases(7, 1, POINTS // 2)
    nodes = POINTS * oversampling
    line = PreparedLine.of(periodic_line(*(roughness.line(amplitude, phase, nodes, order) for order in (0, 1))))
    for depth in (0.01, 0.1, 0.5, 2.0, 6.0):
        first, barriers = line.patches(0.5 * depth, 2 * deborah, np.empty(SUMS)), line.barriers(deborah)
        history = History(np.array([0.0, LONG]), np.array([depth, depth]), np.zeros(2), 2, 1.0)
        everywhere = Reachable(np.array([[0, nodes + 1]]), np.full(nodes + 2, -np.inf), 0.0)
        work = workspace_for(nodes, barriers, clearance_from(everywhere.from_depth - depth))
        found = touch(Instant(line.track, first, history, LONG, deborah, 0.0), everywhere, work)
        sums = np.empty(SUMS)
        start, end = patches_at(line.cells, line.blocks, barriers_for(int(line.track.cells)), deborah, depth, sums)
        assert found == start.size
        assert np.allclose(work.start[:found], start, rtol=0, atol=1e-6)
        assert np.allclose(work.end[:found], end, rtol=0, atol=1e-6)
        # the place of touching is found to 1e-7 of a cell; in fast, light contact the force there is large
        assert work.sums[patches.LOAD] == pytest.approx(sums[DISPLACEMENT], rel=2e-5)
        # the sweep adds up what is lost, the march forces: the same in a steady state
        assert work.sums[patches.DRAG] == pytest.approx(sums[DRAG], rel=2e-5)


@pytest.mark.parametrize(("lowest", "overflown"), [(1.0, True), (1.2, False)])
def test_the_motion_knows_how_fast_the_lift_fell_and_what_flew_over_the_highest_point(
    lowest: float, overflown: bool
) -> None:
    """From depth 3 at time 0 elements are at 3 / e, 1.1, at time 1: over a lower depth there, not over a larger one."""
    amplitude, phase = roughness.amplitudes(10, 0.7), roughness.phases(7, 1, 10)
    line = PreparedLine.of(periodic_line(*(roughness.line(amplitude, phase, 20, order) for order in (0, 1))))
    first = line.patches(0.5, 1.0, np.empty(SUMS))
    history = History(np.arange(4.0), np.array([3.0, lowest, 2.0, 1.5]), np.zeros(4), 4, 1.0)
    motion = motion_at(Instant(line.track, first, history, 3.0, 1.0, 0.0), 0.0)
    assert (motion.fall, motion.deepest, motion.highest) == (3.0 - lowest, 3.0, 3.0)
    assert motion.overflown == overflown
