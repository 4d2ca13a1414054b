import numpy as np
import pytest

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
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
