"""Contact after a jump from the largest displacement of every element over all past times, finely sampled."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import Waves
from mdr_dask.physics.transients.contact_search import Workspace, find_contact
from mdr_dask.physics.transients.free_recovery import Instant
from mdr_dask.physics.transients.limits import PreparedLine, steady_limits
from mdr_dask.physics.transients.march import Marching, Trajectory
from mdr_dask.physics.transients.patches import LOAD, History
from mdr_dask.physics.transients.velocity_jump import MarchRequest, march

SAMPLES = 12  # of a cell
SHORT = 3.0  # samples; shorter patches cannot be judged
RATIOS = (0.1, 0.2, 0.5, 0.8, 1.2, 2.0, 5.0, 10.0)


class Sampled(NamedTuple):
    """Heights and slopes of a track between its nodes, and displacements before the jump."""

    height: np.ndarray
    slope: np.ndarray
    before: np.ndarray


def sampled(marching: Marching) -> Sampled:
    track, first, n = marching.track, marching.first, int(marching.track.cells)
    y = np.arange(SAMPLES) / SAMPLES
    h0, h1 = track.height[:n, None], track.height[1 : n + 1, None]
    s0, s1 = track.enter[:n, None], track.leave[:n, None]
    c2, c3 = 3 * (h1 - h0) - 2 * s0 - s1, s0 + s1 - 2 * (h1 - h0)
    height, slope = (h0 + y * (s0 + y * (c2 + y * c3))).ravel(), (s0 + y * (2 * c2 + y * 3 * c3)).ravel()
    before, step, fade = first.depth + height, 1, np.exp(-1 / SAMPLES / first.deborah)
    while step < before.size:  # each has seen twice as far back as the one before
        before = np.maximum(before, np.roll(before, step) * fade)
        step, fade = 2 * step, fade**2
    return Sampled(height, slope, np.maximum(before, 0.0))


def load_by_largest(marching: Marching, found: Trajectory, now: int, line: Sampled) -> tuple[float, float]:
    """Return the load at a moment of a trajectory, and its uncertainty from the sampling at the edges of patches.

    The displacement of an element is the largest to which the line can have pressed it, faded since: the depth then and
    the height then above it, without a search for contact patches.
    """
    cells, deborah, time = marching.track.cells, marching.deborah, found.time[now]
    places, travel = np.arange(line.height.size) / SAMPLES, deborah * time
    around = np.append(places, cells), np.append(line.before, line.before[0])
    free = np.interp((places - travel) % cells, *around) * np.exp(-time)
    path = CubicHermiteSpline(found.time[: now + 1], found.depth[: now + 1], found.rate[: now + 1])
    for back in range(1, int(travel * SAMPLES) + 1):
        ago = back / SAMPLES / deborah
        np.maximum(free, (path(time - ago) + np.roll(line.height, back)) * np.exp(-ago), out=free)
    force = found.depth[now] + line.height + found.rate[now] + deborah * line.slope
    touches = (found.depth[now] + line.height >= free) & (force > 0)
    edges = np.flatnonzero(touches != np.roll(touches, -1))
    doubt = np.maximum(np.abs(force[edges]), np.abs(np.roll(force, -1)[edges])).sum() / SAMPLES
    return float((force * touches).sum() / SAMPLES), float(doubt)


def searched_afresh(marching: Marching, found: Trajectory, now: int, work: Workspace) -> int:
    """Search the contact at a moment of a march in all cells; return the number of patches."""
    time = found.time[now]
    history = History(found.time, found.depth, found.rate, now + 1, 0.0)
    work.free_until.fill(-np.inf)
    instant = Instant(marching.track, marching.first, history, time, marching.deborah, np.exp(-time))
    return find_contact(instant, marching.reachable, work)


def worst_moment(marched: tuple, moments: int, generator: np.random.Generator) -> float:
    """Return for a march of `velocity_jump` the largest relative error of the load at random moments.

    The uncertainty of the sampling is subtracted; NaN if no moment could be judged.
    """
    marching, found, work, outcome = marched
    if outcome != Outcome.CONVERGED:
        return np.nan
    line, worst = sampled(marching), np.nan
    for now in generator.permutation(np.arange(1, found.time.size))[:moments]:
        travel, patches = marching.deborah * found.time[now], searched_afresh(marching, found, now, work)
        if patches == 0 or travel > 1.2 * marching.track.cells:
            continue
        whole = slice(1, patches - 1)  # the first and the last are one
        if np.min(work.end[whole] - work.start[whole], initial=travel) < SHORT / SAMPLES:
            continue
        load, doubt = load_by_largest(marching, found, int(now), line)
        worst = np.fmax(worst, (abs(load - work.sums[LOAD]) - doubt) / work.sums[LOAD])
    return float(worst)


def judged(seed: int, number: int, moments: int) -> tuple[float, dict[str, float]]:
    """Return the largest error of the load of a random case, NaN without a transient, and the numbers of the case."""
    random = np.random.default_rng([seed, number])
    points, grid = int(random.choice([40, 80, 160])), int(random.choice([2, 4, 8, 16]))
    hurst = float(random.uniform(0, 1))
    amplitude = roughness.amplitudes(points // 2, hurst)
    line = RoughLine(Waves(0.5 * amplitude * roughness.phase_factors(seed, number, points // 2), points))
    load, ratio = 10 ** random.uniform(-3, 0.7), float(random.choice(RATIOS))
    deborah = 10 ** random.uniform(-2.5, 1.5) / roughness.spectral_slope(amplitude)
    prepared = PreparedLine.of(line.cubic(points * grid))
    loads, numbers = np.array([load]), np.array([[deborah, deborah * ratio]])
    limits = steady_limits(prepared, loads, numbers)[0]
    case = {"points": points, "grid": grid, "hurst": hurst, "load": load, "deborah": deborah, "ratio": ratio}
    if limits.outcome != Outcome.CONVERGED:
        return np.nan, case
    request = MarchRequest(np.geomspace(0.01, 3, 20), np.pi * points, float(random.choice([6, 8, 24])))
    if limits.is_full:
        return np.nan, case
    return worst_moment(march(prepared, load, numbers[0], limits, request), moments, random), case
