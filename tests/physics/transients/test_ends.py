"""The ends of a jump: what touches at their depths is what a sweep at these depths finds."""

import numpy as np
import pytest

from mdr_dask.physics.sliding.kelvin import DRAG, SUMS
from mdr_dask.physics.sliding.steady import Kept, steady_on_cells, touching_for
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients import ends
from mdr_dask.physics.transients.ends import PreparedLine, ends_on

DEBORAH = np.array([[2e-4, 2.4e-4], [0.01, 0.012], [0.3, 0.1]])
LOADS = np.array([0.02, 0.3, 1.5])


def rough(points=200, hurst=0.5, oversampling=4):
    amplitude, phase = roughness.amplitudes(points // 2, hurst), roughness.phases(11, 0, points // 2)
    return PreparedLine.of(
        periodic_line(*(roughness.line(amplitude, phase, points * oversampling, order) for order in (0, 1)))
    )


def test_ends_are_those_of_sweeps_at_their_depths():
    """The depths of the search are near to those of the ends, and a step of Newton takes every edge there."""
    line = rough()
    found, cells = ends_on(line, LOADS, DEBORAH), line.track.cells
    for k in range(LOADS.size):
        for end, (depth, drag) in enumerate(zip(found.depth[k], (found.before[k], found.after[k]), strict=True)):
            sums = np.empty(SUMS)
            swept = line.patches(depth + line.cells.top, DEBORAH[k, end] * cells, sums)
            assert drag == pytest.approx(sums[DRAG], rel=1e-9)
            if end == np.argmin(DEBORAH[k]):
                for name in ("start", "end", "pressed"):
                    np.testing.assert_allclose(getattr(found.slower[k], name), getattr(swept, name), atol=1e-6)
        assert (found.first[k] is found.slower[k]) == (DEBORAH[k, 0] <= DEBORAH[k, 1])


def test_what_touched_close_to_a_depth_is_moved_to_it_unless_a_cell_changes():
    line, loads, numbers = rough(), np.array([0.3]), np.array([0.01])
    touching = touching_for(1, 1000)
    state = steady_on_cells(line.cells, line.blocks, numbers, loads, kept=Kept(line.barriers, touching))
    depth, deborah = state.depth[0] + line.cells.top, 0.01 * line.track.cells
    near, swept = line.patches_near(touching, 0, depth, deborah), line.patches(depth, deborah, np.empty(SUMS))
    assert near is not None
    for name in ("start", "end", "pressed"):
        np.testing.assert_allclose(getattr(near, name), getattr(swept, name), atol=1e-7)
    assert line.patches_near(touching, 0, 1.01 * depth, deborah) is None  # that is too far


def test_patches_that_find_no_room_are_swept_anew():
    line, loads = rough(), np.array([0.3, 0.31])
    numbers, touching = np.full(2, 0.01), touching_for(2, 1)
    state = steady_on_cells(line.cells, line.blocks, numbers, loads, kept=Kept(line.barriers, touching))
    assert np.all(touching.patches > 1)
    assert line.patches_near(touching, 0, state.depth[0] + line.cells.top, 0.01 * line.track.cells) is None


def bits(found):
    patches = [np.concatenate([each.start, each.end, each.pressed]) for each in (*found.first, *found.slower)]
    return [*(column for column in found[:7]), *patches]


@pytest.mark.parametrize("room", [1 / 8, 1 / 40, 0.0])
def test_ends_of_a_case_are_the_same_bits_whatever_is_solved_beside_it_and_wherever_a_search_begins(room, monkeypatch):
    """With room for the patches of all cases, of some, and of none."""
    monkeypatch.setattr(ends, "PER_CELL", room)
    monkeypatch.setattr(ends, "KEPT", 10_000)
    line, random = rough(), np.random.default_rng(3)
    loads, deborah = np.exp(random.uniform(-5, 1.5, 40)), np.exp(random.uniform(-9, 0, (40, 2)))
    together = ends_on(line, loads, deborah)
    for k in range(loads.size):
        alone = ends_on(line, loads[k : k + 1], deborah[k : k + 1])
        near = alone._replace(depth=alone.depth * random.uniform(0.7, 1.4, (1, 2)))
        again = ends_on(line, loads[k : k + 1], deborah[k : k + 1], near)
        for one, other in zip(bits(together.only(np.array([k]))), bits(alone), strict=True):
            np.testing.assert_array_equal(one, other)
        for one, other in zip(bits(again), bits(alone), strict=True):
            np.testing.assert_array_equal(one, other)


def moved(line, deborah, depth, start, end):
    """Return whether edges could be moved to a depth, and where they are then."""
    start, end, pressed = start.copy(), end.copy(), np.empty(start.size)
    return ends._moved(line.track, deborah, depth, start, end, pressed), start, end


def test_edges_that_are_off_by_little_are_moved_within_their_cells():
    line, deborah = rough(points=500), 4.0
    to_a_node = kept = 0
    for depth in np.linspace(0.5, 1.5, 200):
        swept = line.patches(depth, deborah, np.empty(SUMS))
        inner = np.sort(np.append(swept.start[1:], swept.end[:-1]))
        alone = np.abs(inner - np.round(inner)).min() > 2e-4 and np.diff(inner).min() > 2e-4
        for off in (1e-4, -1e-4):
            start, end = swept.start.copy(), swept.end.copy()
            start[1:] += off
            end[:-1] -= off
            found, start, end = moved(line, deborah, depth, start, end)
            assert found or not alone
            kept += found
            if found:
                np.testing.assert_allclose(start, swept.start, atol=1e-6)
                np.testing.assert_allclose(end, swept.end, atol=1e-6)
        assert not moved(line, deborah, depth, swept.start, swept.end - 2e-3)[0]
        for k in np.flatnonzero(swept.end[:-1] % 1 < 9e-4):  # from the cell before
            end = swept.end.copy()
            end[k] = np.floor(end[k]) - 1e-6
            to_a_node += not moved(line, deborah, depth, swept.start, end)[0]
    assert to_a_node > 0
    assert kept > 100
