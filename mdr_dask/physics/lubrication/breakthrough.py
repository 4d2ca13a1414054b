"""Breakthrough of a boundary layer between two rough lines that roll on a film (thesis section 5.2.2).

The two lines are held apart by the film ``h0``; where the sum of their heights ``z`` exceeds it, they overlap. A run
of overlapping points is a cluster, of length ``D = n dx`` and force ``F = E* dx sum(z - h0)`` (eq. 5.5). It breaks the
layer if ``pi tau0 D^3/(12 F) < h_c`` (eq. 5.6), that is if ``sum(z - h0) > s n^3 dx^2`` with the layer strength
``s = pi tau0/(12 E* h_c)``, the only place where tau0, E* and h_c appear. Lines are closed (periodic); the contact is
a window of ``window`` points that starts at each position in turn.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.compiling import compiled, kernel
from mdr_dask.physics.lubrication.clusters import Clusters

#: What becomes of a cluster that the window's edge cuts: judged and counted by its part inside (``part``, what comes of
#: testing every window by itself), judged whole and counted with its part inside (``clip``), judged and counted whole
#: (``whole``), or left out (``inside``).
EDGE_RULES: tuple[str, ...] = ("part", "clip", "whole", "inside")
_PART, _CLIP, _WHOLE, _INSIDE = range(4)


def layer_strength(shear_strength: ArrayLike, E_star: ArrayLike, thickness: ArrayLike) -> FloatArray:
    """Return ``s = pi tau0/(12 E* h_c)`` in 1/m; a parabolic asperity breaks the layer if its curvature exceeds 12 s.

    Parameters
    ----------
    shear_strength : array_like
        Limiting shear stress of the layer, tau0, in Pa.
    E_star : array_like
        Contact modulus in Pa.
    thickness : array_like
        Critical thickness h_c of the layer in m.
    """
    return np.asarray(np.pi * np.asarray(shear_strength) / (12 * np.asarray(E_star) * np.asarray(thickness)))


def window_points(half_width: float, spacing: float, points: int) -> int:
    """Return the number of points in the contact window ``[-a, a]``, at least one.

    Raises
    ------
    ValueError
        If the window is wider than the line.
    """
    window = max(1, round(2 * half_width / spacing))
    if window > points:
        raise ValueError(
            f"the contact is wider than the line: expected 2a of at most {points * spacing:.4g} m, "
            f"got {2 * half_width:.4g} m"
        )
    return window


@compiled
def _block(jumps: NDArray[np.int32], begin: int, count: int, value: int) -> None:
    """Add `value` to `count` positions of the circle from `begin` on, as jumps."""
    points = jumps.size - 1
    begin %= points
    end = begin + count
    jumps[begin] += value
    if end > points:
        jumps[0] += value
        end -= points
    jumps[end] -= value


@kernel
def _add_parts(
    overlap: FloatArray, limit: float, window: int, start: int, always: bool, judged: bool, jumps: NDArray[np.int32]
) -> None:
    """Add what the window's edges leave of a cluster: heads, middles (where it is longer than the window), tails.

    A part counts if it breaks by itself where parts are `judged`, else if the cluster does (`always`).
    """
    n = overlap.size
    whole_line = n == jumps.size - 1
    part = 0 if whole_line else min(n - 1, window)
    total = 0.0
    for j in range(1, part + 1):
        total += overlap[j - 1]
        if total > limit * float(j) ** 3 if judged else always:
            _block(jumps, start - window + j, 1, j)
    total = overlap[:window].sum()
    for j in range(n if whole_line else n - window - 1):
        total += overlap[(j + window) % n] - overlap[j]
        if total > limit * float(window) ** 3 if judged else always:
            _block(jumps, start + j + 1, 1, window)
    total = 0.0
    for j in range(1, part + 1):
        total += overlap[n - j]
        if total > limit * float(j) ** 3 if judged else always:
            _block(jumps, start + n - j, 1, j)


@kernel
def _collect(clusters: Clusters, window: int, rule: int, jumps: NDArray[np.int32]) -> None:
    """Gather the jumps of the trace cluster by cluster, then sum them up in place."""
    limit, overlap = clusters.limit, clusters.overlap
    points = jumps.size - 1
    offset = 0
    for c in range(clusters.start.size):
        s, n = clusters.start[c], clusters.length[c]
        broken = clusters.total[c] > limit * float(n) ** 3
        if rule == _WHOLE and broken:
            _block(jumps, s - window + 1, min(n + window - 1, points), n)
        elif rule != _WHOLE and broken and n <= window and n < points:
            _block(jumps, s + n - window, window - n + 1, n)
        if rule == _PART or (rule == _CLIP and broken):
            _add_parts(overlap[offset : offset + n], limit, window, s, broken, rule == _PART, jumps)
        offset += n
    height = 0
    for p in range(points):
        height += jumps[p]
        jumps[p] = height


def contact_points(clusters: Clusters, window: int, rule: str = "part") -> NDArray[np.int32]:
    """Return the number of points in intimate contact for the window at every position, in O(points).

    Parameters
    ----------
    clusters : Clusters
        Classified once for the whole line.
    window : int
        Points in the window.
    rule : str
        One of `EDGE_RULES`.

    Returns
    -------
    int array, shape (points,)
        Entry p belongs to the window over points p to p + window - 1. The share of entries above zero is the
        breakthrough probability; their mean times dx is the mean contact length.
    """
    trace = np.zeros(clusters.points + 1, dtype=np.int32)
    if clusters.start.size:
        _collect(clusters, window, EDGE_RULES.index(rule), trace)
    return trace[:-1]


class Pair(NamedTuple):
    """Two rough lines at a distance.

    Parameters
    ----------
    line_1, line_2 : array, shape (points,)
        Heights of the two closed lines in m.
    level : float
        Film thickness h0 in m.
    spacing : float
        Distance dx of the points in m.
    strength : float
        From `layer_strength`, in 1/m.
    """

    line_1: FloatArray
    line_2: FloatArray
    level: float
    spacing: float
    strength: float


@compiled
def _beyond(pair: Pair, p: int, q: int, step: int, most: int) -> tuple[int, float]:
    """Follow a run of overlapping points beyond the window, from (p, q) on; return number and sum of overlaps."""
    points = pair.line_1.size
    n = 0
    total = 0.0
    while n < most:
        overlap = pair.line_1[(p + n * step) % points] + pair.line_2[(q + n * step) % points] - pair.level
        if overlap <= 0.0:
            break
        total += overlap
        n += 1
    return n, total


@compiled
def _fill(pair: Pair, p: int, q: int, overlap: FloatArray) -> None:
    """Fill the overlaps of the window that stands at (p, q)."""
    points = pair.line_1.size
    for k in range(overlap.size):
        overlap[k] = pair.line_1[p] + pair.line_2[q] - pair.level
        p = p + 1 if p + 1 < points else 0
        q = q + 1 if q + 1 < points else 0


@compiled
def _windows(
    pair: Pair, positions: tuple[IntArray, IntArray], rule: int, overlap: FloatArray, contact: IntArray
) -> None:
    """Judge each window by itself; ``rule`` is the index in EDGE_RULES, ``overlap`` the workspace of a window."""
    points, window = pair.line_1.size, overlap.size
    limit = pair.strength * pair.spacing**2
    for w in range(contact.size):
        p, q = positions[0][w], positions[1][w]
        _fill(pair, p, q, overlap)
        k = 0
        while k < window:
            if overlap[k] <= 0.0:
                k += 1
                continue
            begin = k
            total = 0.0
            while k < window and overlap[k] > 0.0:
                total += overlap[k]
                k += 1
            n = inside = k - begin
            if begin == 0 and rule != _PART:
                more, extra = _beyond(pair, p - 1, q - 1, -1, points - n)
                n, total = n + more, total + extra
            if k == window and rule != _PART:
                more, extra = _beyond(pair, p + k, q + k, 1, points - n)
                n, total = n + more, total + extra
            if total > limit * float(n) ** 3 and (rule != _INSIDE or n == inside):
                contact[w] += inside if rule == _CLIP else n


def judge_windows(
    pair: Pair, window: int, positions: tuple[IntArray, IntArray], rule: str = "part"
) -> NDArray[np.int64]:
    """Judge windows one by one: the reference for pure rolling, and the way of rolling with creep.

    Parameters
    ----------
    pair : Pair
    window : int
        Points in the window.
    positions : tuple of two int arrays, shape (n,)
        Point of each line at the window's first place; see `creep_positions`.
    rule : str
        One of `EDGE_RULES`.

    Returns
    -------
    int array, shape (n,)
        Points in intimate contact of each window.
    """
    contact = np.zeros(positions[0].size, dtype=np.int64)
    if pair.line_1.max() + pair.line_2.max() > pair.level:
        _windows(pair, positions, EDGE_RULES.index(rule), np.empty(window), contact)
    return contact


def creep_positions(way: ArrayLike, points: int, slide_roll_ratio: float) -> tuple[IntArray, IntArray]:
    """Return where the window stands on each line after some way of the mean surface.

    Parameters
    ----------
    way : array_like, shape (n,)
        In points. For mean values, ways an eighth of the window apart lose nothing: closer windows tell the same.
    points : int
        Points of each line.
    slide_roll_ratio : float
        ``S = (v1 - v2)/u`` with the mean velocity u: the lines move by ``1 + S/2`` and ``1 - S/2`` of the way.

    Returns
    -------
    two int arrays, shape (n,)
        First point of the window on each line.
    """
    ways = np.asarray(way, dtype=np.float64)
    first, second = (np.round(ways * (1 + sign * slide_roll_ratio / 2)).astype(np.int64) % points for sign in (1, -1))
    return first, second


@compiled
def _occupied(contact_points: NDArray[np.int32] | IntArray, windows: IntArray, points: IntArray) -> None:
    """Count windows in contact and their points in contact, part by part."""
    parts = windows.size
    for part in range(parts):
        for k in range(part * contact_points.size // parts, (part + 1) * contact_points.size // parts):
            windows[part] += contact_points[k] > 0
            points[part] += contact_points[k]


def occupied(contact_points: NDArray[np.int32] | IntArray, parts: int = 1) -> tuple[IntArray, IntArray]:
    """Return the number of windows in contact, and the sum of their points in contact, of equal parts of a turn.

    Parameters
    ----------
    contact_points : int array, shape (positions,)
        Of the windows, in the order of time.
    parts : int
        Part k begins at position ``k positions // parts``.

    Returns
    -------
    two int arrays, shape (parts,)
    """
    windows, points = np.zeros(parts, dtype=np.int64), np.zeros(parts, dtype=np.int64)
    _occupied(contact_points, windows, points)
    return windows, points


def contact_resistance(resistivity: ArrayLike, contact_length: ArrayLike) -> FloatArray:
    """Return ``R_c = rho/L_cont`` in ohm (thesis eq. 5.1: spots of one material in parallel); infinite without contact.

    Parameters
    ----------
    resistivity : array_like
        Of the contacting materials in ohm m.
    contact_length : array_like
        Sum of the diameters of the spots in m.
    """
    length = np.asarray(contact_length, dtype=np.float64)
    safe = np.where(length > 0, length, 1.0)
    return np.where(length > 0, np.asarray(resistivity) / safe, np.inf)
