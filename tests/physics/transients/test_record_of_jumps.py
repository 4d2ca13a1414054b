"""Jumps of the velocity as they were found: levels, transients, their stated errors, and who touches at a moment."""

import numpy as np
import pytest
import record

from mdr_dask.physics.sliding.kelvin import SUMS
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import Waves
from mdr_dask.physics.transients import accuracy
from mdr_dask.physics.transients.accuracy import JumpAim, JumpProblem, solve_jumps
from mdr_dask.physics.transients.clearance import clearance_from
from mdr_dask.physics.transients.contact_loss import motion_at
from mdr_dask.physics.transients.contact_search import Reachable, touch, workspace_for
from mdr_dask.physics.transients.curve import curve_through
from mdr_dask.physics.transients.ends import PreparedLine, ends_on
from mdr_dask.physics.transients.free_flight import Instant
from mdr_dask.physics.transients.patches import History
from mdr_dask.physics.transients.recent import WINDOWS, Recent, write_recent
from mdr_dask.physics.transients.velocity_jump import (
    Transient,
    pace_after,
    retraced,
    velocity_jumps,
)

TIMES = np.append(0.0, np.geomspace(7e-4, 17.0, 11))
LOADS = np.array([0.003, 0.11, 0.9, 3.7, 60.0, np.nan, 0.2])
DEBORAH = np.array([0.02, 0.4, 0.0011, 0.9, 0.07, 0.1, np.inf])
RATIOS = {"up": 1.31, "far up": 9.0, "down": 0.77, "far down": 0.06}


def rough(modes, hurst, realisation=1):
    amplitude = roughness.amplitudes(modes, hurst)
    return RoughLine(Waves(0.5 * amplitude * roughness.phase_factors(8, realisation, modes), 2 * modes))


def sizes(values):
    with np.errstate(all="ignore"):
        return np.log10(np.abs(values))


def keyed(**scenes):
    return {f"{scene}: {name}": value for scene, found in scenes.items() for name, value in found.items()}


def transient(line, per_decade=9.0, accuracy_asked=0.0, times=TIMES):
    return Transient(times, np.pi * line.points, per_decade, accuracy_asked)


@pytest.mark.parametrize(("modes", "hurst"), [(23, 0.71), (61, 0.1)])
def test_jumps_with_their_errors(modes, hurst, dataframe_regression):
    line, found = rough(modes, hurst), {}
    every = accuracy.Levels._fields
    for name, ratio in RATIOS.items():
        problem = JumpProblem(line, LOADS, np.stack([DEBORAH, ratio * DEBORAH], axis=1))
        for asked, oversampling, levels in ((0.03, 4, every), (4e-4, 2, ("jump",)), (None, 6, every)):
            if asked == 4e-4 and name in ("far up", "down"):
                continue
            aim = JumpAim(levels, asked, oversampling, transient(line, accuracy_asked=asked or 0.0), asked is not None)
            jumps = solve_jumps(problem, aim)
            scale = np.where(np.isfinite(LOADS), LOADS, 1.0)
            with np.errstate(all="ignore"):
                found[f"{name} {asked}"] = {
                    "levels": np.array([np.arcsinh(1e3 * each / scale) for each in jumps.levels[:3]]),
                    "depth": np.arcsinh(np.append(jumps.levels.depth, jumps.depth)),
                    "errors": sizes(np.array(jumps.errors) / np.array(jumps.levels)),
                    "trace": sizes(jumps.trace / scale[:, None]),
                    "trace beside its end": np.arcsinh(1e5 * (jumps.trace / jumps.levels.after[:, None] - 1)),
                    "trace errors": sizes(jumps.trace_error / jumps.trace),
                    "depth errors": sizes(jumps.depth_error),
                    "outcome": jumps.outcome,
                }
    record.check(dataframe_regression, keyed(**found))


def test_marches_on_one_grid(dataframe_regression):
    """Paths, rates, and the same on a coarser grid; with many and few steps, and transients that are left out."""
    line, found = rough(31, 0.4), {}
    loads, deborah = np.array([0.02, 0.4, 2.5, 300.0]), np.array([0.3, 0.013, 0.4, 0.1])
    for ratio in (1.2, 7.0, 0.8, 0.02):
        numbers = np.stack([deborah, ratio * deborah], axis=1)
        fine, coarse = (PreparedLine.of(line.cubic(line.points * k)) for k in (6, 3))
        ends, other = ends_on(fine, loads, numbers), ends_on(coarse, loads, numbers)
        scene = found[f"{ratio}: ends"] = {
            name: np.arcsinh(10 * getattr(ends, name)) for name in ("before", "at", "after", "rate", "tilt", "depth")
        }
        scene["contact"] = ends.contact
        scene["first"] = np.concatenate([np.append(each.start, each.end) for each in ends.first])
        scene["slower"] = np.concatenate([np.append(each.pressed, each.end) for each in ends.slower])
        for per_decade, asked in ((5.0, 0.0), (24.0, 1e-4), (9.0, 0.3), (9.0, 0.02)):
            wanted = transient(line, per_decade, asked)
            marched = velocity_jumps(fine, loads, numbers, ends, wanted)
            paths = retraced(coarse, loads, numbers, other, marched, wanted)
            pace = [
                pace_after(wanted, each, change, load)
                for each, change, load in zip(numbers, (0.3, -0.1, 0.0, 2.0), loads, strict=True)
            ]
            found[f"{ratio}: {per_decade} {asked}"] = {
                "paths": np.arcsinh(np.concatenate([each.path.ravel() for each in marched])),
                "traces": np.arcsinh([each.trace for each in marched]),
                "depths": np.arcsinh([each.depth for each in marched]),
                "left out": sizes(np.array([each.left_out for each in marched])),
                "moments and outcomes": np.array([(each.moments, each.outcome) for each in marched]),
                "retraced": np.arcsinh(np.concatenate([each[1:].ravel() for each in paths])),
                "pace": sizes(np.array(pace)),
            }
    record.check(dataframe_regression, keyed(**found))


def course(kind, time):
    rng = np.random.default_rng(7)
    depth = {
        "sinks": 2.0 - 1.1 * np.exp(-3 * time),
        "rises": 0.4 + 2.2 * np.exp(-5 * time),
        "leaps": 1.0 + 0.6 * np.sin(9 * time) * np.exp(-time),
        "wild": 1.4 + 0.3 * rng.standard_normal(time.size),
    }[kind]
    return depth, np.gradient(depth, time)


@pytest.mark.parametrize("kind", ["sinks", "rises", "leaps", "wild"])
def test_contact_at_moments_of_given_histories(kind, dataframe_regression):
    """Whatever the depth has done: patches, sums with their derivatives, bounds of what flies, and the motion."""
    time = np.append(0.0, np.geomspace(2e-4, 2.0, 23))
    depth, rate = course(kind, time)
    found = {}
    for modes, hurst, oversampling in ((17, 0.6, 3), (45, 0.0, 2)):
        line = PreparedLine.of(rough(modes, hurst).cubic(2 * modes * oversampling))
        n = int(line.track.cells)
        everywhere = Reachable(np.array([[0, n + 1]]), np.full(n + 2, -np.inf), -0.31)
        for deborah in (0.05, 1.7, 40.0, 700.0):
            for ratio in (0.1, 0.83, 1.2, 12.0):
                first = line.patches(depth[0], deborah / ratio, np.empty(SUMS))
                work = workspace_for(n, line.barriers(deborah), clearance_from(everywhere.from_depth.copy()))
                sums, edges, bounds, motions, counts = [], [], [], [], []
                for count in (1, 2, 9, 17, 24):
                    history = History(time, depth, rate, count, 1.3 / time[max(count - 1, 1)])
                    now = Instant(line.track, first, history, time[count - 1], deborah, np.exp(-time[count - 1]))
                    number = touch(now, everywhere, work)
                    recent = Recent(*np.empty((5, WINDOWS)))
                    write_recent(history, first, deborah, recent)
                    sums.append(work.sums.copy())
                    edges.append(np.append(work.start[: max(number, 0)], work.end[: max(number, 0)]))
                    bounds.append(np.ravel(recent))
                    motions.append(motion_at(now, everywhere.second))
                    counts.append(number)
                found[f"{modes} {deborah} {ratio}"] = {
                    "sums": np.arcsinh(sums),
                    "edges": np.concatenate(edges),
                    "bounds": np.arcsinh(np.append(bounds, motions)),
                    "counts": np.array(counts),
                }
    joined = {}
    for scene, each in found.items():
        for name, value in each.items():
            joined.setdefault(f"{scene.rpartition(' ')[0]}: {name}", []).append(np.ravel(value))
    record.check(dataframe_regression, {name: np.concatenate(each) for name, each in joined.items()})


def test_curves_and_what_their_ends_do(dataframe_regression):
    x = np.array([0.0, 0.3, 1.1, 1.2, 2.9])
    y = np.array([1.0, 1.4, 0.7, 0.9, 0.9])
    places, found = np.array([-0.2, 0.0, 0.11, 0.3, 0.9, 1.1, 1.17, 2.0, 2.9, 3.3]), {}
    for name, slope in {
        "mild": np.array([1.0, 0.2, -0.4, 0.1, 0.0]),
        "steep": np.array([50.0, -9.0, 9.0, 70.0, 5.0]),
        "unknown first": np.array([np.nan, 0.2, -0.4, 0.1, 0.3]),
    }.items():
        found[name] = np.empty(places.size)
        curve_through(x, y, slope, places, found[name])
    found["two points"] = np.empty(places.size)
    curve_through(x[:2], y[:2], np.array([0.4, 2.0]), places, found["two points"])
    record.check(dataframe_regression, found)
