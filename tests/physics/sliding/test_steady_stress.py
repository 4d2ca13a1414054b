"""Steady sliding over fifteen decades of all numbers: a solution that satisfies its bounds, or a status."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from schemes import on_line

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces import roughness

SCHEMES = ("hermite", "backward_euler")
exponents = st.floats(-15, 15)


def solve(height, slope, deborah, load, scheme):
    return on_line(height, slope, np.array([deborah]), np.array([load]), scheme)


def is_lost_in_rounding(load, deborah):
    """Say whether the dashpot alone holds the load on a length, or at a depth, that is lost in that of the line.

    The fastest element loses less in a period than a displacement is known by.
    """
    return min(load, 0) - deborah <= -12


@settings(max_examples=60, deadline=None)
@example(0.0, 16, 2, 15.0, 0.0, 0.0, "hermite", 0)  # the sign of the force at the highest point is lost in rounding
@example(0.0, 50, 1, 11.5, -13.0, 0.0, "hermite", 1)  # the rise in which the dashpots carry the load is
@example(0.0, 16, 1, 14.9375, 0.0, 1.0, "backward_euler", 0)
@given(
    hurst=st.floats(0, 1),
    points=st.sampled_from([16, 50, 300]),
    oversampling=st.sampled_from([2, 3, 5]),  # the coarsest grid has two nodes a point: four in the shortest wave
    deborah=exponents,
    load=exponents,
    height=st.floats(-9, 6),
    scheme=st.sampled_from(SCHEMES),
    realisation=st.integers(0, 1000),
)
def test_any_case_is_solved(hurst, points, oversampling, deborah, load, height, scheme, realisation):
    amplitude = roughness.amplitudes(points // 2, hurst)
    phase = roughness.phases(0, realisation, points // 2)
    h, slope = (10**height * roughness.line(amplitude, phase, points * oversampling, order) for order in (0, 1))
    carried = 10 ** (load + height)
    steady = solve(h, slope, 10**deborah, carried, scheme)
    if steady.status[0] == Outcome.DEPTH_NOT_FOUND:
        assert is_lost_in_rounding(load, deborah)
        return
    assert steady.status[0] == Outcome.CONVERGED
    # the highest point, which lies above the nodes by part of the range, is pressed in; at most all of the line is
    slack = 1e-9 * (np.ptp(h) + carried)
    assert -np.max(h) - np.ptp(h) <= steady.depth[0] <= carried + np.ptp(h) + slack
    assert steady.drag[0] >= 0
    # F_x / F_N lies below the steepest slope in contact, that of the cubic between the nodes included
    steepest = 1.5 * max(np.max(np.abs(slope)), np.max(np.abs(np.diff(h))) * h.size)
    assert steady.drag[0] / carried <= steepest * (1 + 1e-9)
    assert 0 <= steady.contact_fraction[0] <= 1 + 1e-9


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_flat_line_has_no_friction(scheme):
    flat = np.zeros(64)
    steady = on_line(flat, flat, np.geomspace(1e-15, 1e15, 7), np.geomspace(1e-15, 1e15, 7), scheme)
    assert np.all(steady.status == Outcome.CONVERGED)
    assert np.all(steady.drag == 0)
    assert steady.depth == pytest.approx(np.geomspace(1e-15, 1e15, 7), rel=1e-12)
    # by time steps the fastest one loses less than rounding in a step, and cannot tell contact from flight
    assert steady.contact_fraction[:6] == pytest.approx(np.ones(6))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_spikes_and_steps_are_solved(scheme):
    height = np.where(np.arange(200) > 120, 1.0, 0.0)
    height[40] = 1e6
    deborah, load = (grid.ravel() for grid in np.meshgrid(np.geomspace(1e-8, 1e8, 9), np.geomspace(1e-6, 1e8, 8)))
    steady = on_line(height, np.zeros(200), deborah, load, scheme)
    rounding = load / 1e6 / np.maximum(deborah, 1) < 1e-12  # of the spike, over which the dashpot alone holds the load
    found = steady.status == Outcome.CONVERGED
    assert np.all(found | rounding)
    assert np.all(steady.drag[found] >= 0)
