import numpy as np
import pytest

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients import velocity_jump
from mdr_dask.physics.transients.contact_search import Reachable
from mdr_dask.physics.transients.ends import PreparedLine, ends_on
from mdr_dask.physics.transients.velocity_jump import Transient, velocity_jumps

POINTS = 500
TIMES = np.geomspace(1e-3, 20, 30)
LOADS = np.array([0.0025, 0.075, 0.75, 7.5, 25.0])  # 0.01 to 100 N of the campaign
DEBORAHS = np.geomspace(1e-5, 1, 9)  # 0.1 mm/s to 10 m/s
CHANGES = np.array([-0.2, 0.2, 0.3])


@pytest.mark.parametrize("hurst", [0, 0.15, 0.3, 0.5, 0.7, 0.85, 1])
def test_extremes_come_to_rest(hurst: float) -> None:
    """Between the extremes of thesis chapter 4, near full contact at v tau > L too, nothing runs away."""
    amplitude, phase = roughness.amplitudes(POINTS // 2, hurst), roughness.phases(2014, 0, POINTS // 2)
    line = periodic_line(*(roughness.line(amplitude, phase, 4 * POINTS, order) for order in (0, 1)))
    load, deborah, change = (axis.ravel() for axis in np.meshgrid(LOADS, DEBORAHS, CHANGES))
    both = np.column_stack([deborah, deborah * (1 + change)])
    line = PreparedLine.of(line)
    jumps = velocity_jumps(line, load, both, ends_on(line, load, both), Transient(TIMES, np.pi * POINTS, 8))
    failed = sum(jump.outcome != Outcome.CONVERGED for jump in jumps)
    assert failed <= 0.02 * load.size  # single asperities that come and go at the lowest velocity
    for jump in jumps:
        if jump.outcome == Outcome.CONVERGED:
            span = abs(jump.at - jump.after) + abs(jump.after - jump.before)
            away = np.max(np.abs(jump.trace - jump.after))
            # a single line may overshoot, by as much as it jumps
            assert away < 2 * span
            assert abs(jump.trace[-1] - jump.after) <= 0.02 * max(away, span)


@pytest.mark.parametrize(
    ("hurst", "load", "deborah", "ratio"),
    [
        # with few places of leaving remembered
        (0.7, 1.16, 1.0, 0.4),
        (0.7, 25.0, 1.0, 5.0),
        (0.7, 1.16, 0.147, 5.0),
        (0.3, 5.4, 1.0, 5.0),
        # with stretches from a state at the least depth
        (0.7, 0.0116, 0.0215, 5.0),
        (0, 0.0539, 0.147, 5.0),
        # with cells passed by where elements left earlier
        (0.3, 5.4, 1.0, 3.0),
        (0.7, 0.0025, 0.00316, 3.0),
        (1.0, 5.4, 1.0, 1.2),
    ],
)
def test_jump_does_not_depend_on_where_contact_is_looked_for(
    hurst: float, load: float, deborah: float, ratio: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stretches that elements can touch save work only: the whole line gives the same, after large jumps too."""
    amplitude, phase = roughness.amplitudes(POINTS, hurst), roughness.phases(2014, 0, POINTS)
    line = PreparedLine.of(periodic_line(*(roughness.line(amplitude, phase, 8 * POINTS, order) for order in (0, 1))))
    loads, both = np.array([load]), np.array([[deborah, ratio * deborah]])
    ends, asked = ends_on(line, loads, both), Transient(TIMES, 2 * np.pi * POINTS, 6)
    (near,) = velocity_jumps(line, loads, both, ends, asked)
    last = line.track.height.size - 1
    everywhere = Reachable(np.array([[0, last]]), np.full(last + 1, -np.inf), 0.0)
    monkeypatch.setattr(velocity_jump, "_reachable", lambda *_: everywhere)
    (whole,) = velocity_jumps(line, loads, both, ends, asked)
    assert near.outcome == whole.outcome == Outcome.CONVERGED
    assert np.max(np.abs(near.trace - whole.trace)) <= 0.01 * np.max(np.abs(whole.trace - whole.after))
