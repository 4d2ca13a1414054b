"""Direct steady sliding of a viscoelastic Kelvin foundation over a profile, at prescribed load."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mdr_dask.physics import backward_euler
from mdr_dask.physics.sweep import (
    BLOCK,
    DISPLACEMENT,
    DRAG,
    DRAG_RATE,
    LENGTH,
    OUTSIDE,
    STIFFNESS,
    STRETCH,
    SUMS,
    Cells,
    barrier,
    summit,
    sweep,
)

FloatArray = NDArray[np.float64]
Scheme = Literal["hermite", "piecewise_linear", "backward_euler"]

CONVERGED, NOT_CONVERGED, OUTSIDE_LINE, INVALID = 0, 1, 2, 3
MESSAGES = {
    NOT_CONVERGED: "the depth for the load was not found in {iterations} sweeps",
    OUTSIDE_LINE: "the contact leaves the line: a longer line or a smaller load is needed",
    INVALID: "load, velocity and profile must be finite, the load and v tau positive",
}
ITERATIONS = 200
LATTICE_BITS = 20  # depths are tried on a lattice of 2**-LATTICE_BITS relative spacing: see `_solve`


@dataclass(frozen=True)
class Steady:
    """Steady states, one entry for every case.

    Parameters
    ----------
    drag : array
        F_x / (4 G), in the unit of height squared: mu = F_x / F_N.
    depth : array
        Penetration d of the mean line, in the unit of height.
    contact_fraction : array
        Length in contact over the length of the line.
    contact_slope : array
        rms slope of the profile over the contact.
    status : int8 array
        `CONVERGED` or a key of `MESSAGES`.
    """

    drag: FloatArray
    depth: FloatArray
    contact_fraction: FloatArray
    contact_slope: FloatArray
    status: NDArray[np.int8]

    def only(self, cases: NDArray[Any]) -> Steady:
        """Return some of the cases."""
        return Steady(**{name: column[cases] for name, column in vars(self).items()})

    def replaced(self, cases: NDArray[Any], other: Steady) -> Steady:
        """Return all cases, some of them from another solution."""
        columns = {name: column.copy() for name, column in vars(self).items()}
        for name, column in columns.items():
            column[cases] = vars(other)[name]
        return Steady(**columns)


@njit(nogil=True, cache=True)
def _peaks(height: FloatArray, enter: FloatArray, leave: FloatArray) -> tuple[FloatArray, int, float]:
    """Return the highest point of every cell, and the cell and place of the highest of all."""
    peaks = np.empty(enter.size)
    best, place = 0, 0.0
    for i in range(enter.size):
        rise = height[i + 1] - height[i]
        b, c = 3 * rise - 2 * enter[i] - leave[i], enter[i] + leave[i] - 2 * rise
        x = summit(enter[i], b, c)
        if x > 1:
            x = 0.0 if height[i] >= height[i + 1] else 1.0
            peaks[i] = max(height[i], height[i + 1])
        else:
            peaks[i] = height[i] + x * (enter[i] + x * (b + x * c))
        if i == 0 or peaks[i] > peaks[best]:
            best, place = i, x
    return peaks, best, place


def cut(height: FloatArray, enter: FloatArray, leave: FloatArray, periodic: bool, smooth: bool) -> tuple[Cells, float]:
    """Cut a profile into the cells of a sweep.

    Parameters
    ----------
    height : array, shape (n,) if periodic, else (n + 1,)
        Heights at the nodes, into the elastomer.
    enter, leave : array, shape (n,)
        Rise over one cell at the slope of its start and of its end.
    periodic : bool
        Whether the last cell ends at the first node.
    smooth : bool
        Whether slopes are continuous and periodic, so that the integral of their square is summed by Euler and
        Maclaurin: exact over the whole line if that is resolved.

    Returns
    -------
    cells : Cells
    top : float
        Height of the highest point.
    """
    nodes = np.append(height, height[0]) if periodic else height
    peaks, best, place = _peaks(nodes, enter, leave)
    top = float(peaks[best])
    rise = np.diff(nodes)
    mean = 0.5 * (nodes[1:] + nodes[:-1]) + (enter - leave) / 12 - top
    stretch = (36 * rise**2 - 6 * rise * (enter + leave) + 4 * (enter**2 + leave**2) - 2 * enter * leave) / 30
    if smooth:
        whole, square = stretch, enter**2
        correction = (np.roll(square, -1) - np.roll(square, 1)) / 24
        stretch = 0.5 * (square + np.roll(square, -1)) + correction - np.roll(correction, -1)
        # the first cell is cut in two and integrated as a polynomial: the others take the difference
        stretch += (stretch[best] - whole[best]) / max(enter.size - 1, 1)
        stretch[best] = whole[best]
    roll = best if periodic else 0
    height, enter, leave, peaks, mean, stretch = (
        np.roll(array, -roll) for array in (nodes[: enter.size] - top, enter, leave, peaks - top, mean, stretch)
    )
    after = height[:2] if periodic else np.array([nodes[-1] - top, nodes[-1] - top])
    blocks = enter.size // BLOCK
    return Cells(
        np.append(height, after),
        np.append(enter, enter[0]),
        np.append(leave, leave[0]),
        np.append(peaks, peaks[0]),
        np.append(mean, mean[0]),
        np.append(stretch, stretch[0]),
        peaks[: blocks * BLOCK].reshape(blocks, BLOCK).max(axis=1),
        mean[: blocks * BLOCK].reshape(blocks, BLOCK).sum(axis=1),
        stretch[: blocks * BLOCK].reshape(blocks, BLOCK).sum(axis=1),
        place if periodic else 0.0,
        periodic,
    ), top


@njit(nogil=True, cache=True)
def _floor(depth: float) -> float:
    """Return the lattice depth at or below a positive depth."""
    mantissa, exponent = math.frexp(depth)
    return math.ldexp(math.floor(math.ldexp(mantissa, LATTICE_BITS)), exponent - LATTICE_BITS)


@njit(nogil=True, cache=True)
def _next(depth: float) -> float:
    """Return the lattice depth above one."""
    mantissa, exponent = math.frexp(depth)
    return math.ldexp(math.ldexp(mantissa, LATTICE_BITS) + 1, exponent - LATTICE_BITS)


@njit(nogil=True, cache=True)
def _solve(
    cells: Cells,
    barriers: FloatArray,
    block_barriers: FloatArray,
    reach: float,
    load: float,
    guess: float,
    sums: FloatArray,
) -> tuple[float, bool]:
    """Find the last lattice depth that carries less than the load, and leave its sums.

    The load is a convex, increasing function of the depth, so that its tangent bounds the root from above: a lattice
    depth below the root whose tangent reaches the load before the next lattice depth is the one wanted. It is unique,
    and so the answer does not depend on the guess.
    """
    low, high = 0.0, np.inf
    depth = _floor(guess)
    best = np.zeros(SUMS)
    for _ in range(ITERATIONS):
        sweep(cells, barriers, block_barriers, reach, depth, sums)
        carried, stiffness = sums[DISPLACEMENT], sums[STIFFNESS]
        tangent = depth + (load - carried) / stiffness
        if carried <= load:
            low = depth
            best[:] = sums
            if tangent < _next(depth):
                return depth, True
        else:
            high = depth
        if low > 0 and _next(low) >= high:
            sums[:] = best
            return low, True
        power = min(max(stiffness * depth / carried, 0.5), 1e3) if carried > 0 else 1e3
        proposal = depth * (load / carried) ** (1 / power) if carried > 0 else 2 * depth
        proposal = min(proposal, tangent) if carried <= load else proposal
        if not low < proposal < high:
            proposal = 0.5 * (low + high) if high < np.inf else 2 * low
        depth = _floor(proposal)
        if depth <= low:
            depth = _next(low)
        elif depth >= high:
            depth = _floor(0.5 * (low + high))
    return depth, False


@njit(nogil=True, cache=True)
def _states(
    cells: Cells, reaches: FloatArray, loads: FloatArray, results: FloatArray, status: NDArray[np.int8]
) -> None:
    """Solve the cases of one profile in the order given, each from the one before; see `Steady` for the columns."""
    n = cells.mean.size - 1
    barriers, block_barriers = np.empty(n), np.empty(n // BLOCK)
    sums = np.empty(SUMS)
    depth, carried, power, reach = 1.0, 0.0, 1.0, -1.0
    for k in range(loads.size):
        load = loads[k] * n
        if not (0 < load < np.inf and 0 < reaches[k] < np.inf):
            status[k] = INVALID
            continue
        if reaches[k] != reach:
            reach = reaches[k]
            barrier(cells, reach, barriers, block_barriers)
        guess = depth * (load / carried) ** (1 / power) if carried > 0 else loads[k]
        depth, converged = _solve(cells, barriers, block_barriers, reach, load, guess, sums)
        carried = sums[DISPLACEMENT]
        if not (converged and carried > 0):
            status[k] = NOT_CONVERGED
            carried, depth = 0.0, 1.0
            continue
        power = sums[STIFFNESS] * depth / carried
        shift = (load - carried) / sums[STIFFNESS]
        status[k] = OUTSIDE_LINE if sums[OUTSIDE] > 0 else CONVERGED
        results[k, 0] = sums[DRAG] + shift * sums[DRAG_RATE]
        results[k, 1] = depth + shift
        results[k, 2] = sums[LENGTH] / n
        results[k, 3] = n * np.sqrt(sums[STRETCH] / sums[LENGTH]) if sums[LENGTH] > 0 else 0.0


def steady_sliding(
    height: FloatArray, slope: FloatArray | None, reaches: FloatArray, loads: FloatArray, scheme: Scheme = "hermite"
) -> Steady:
    """Return the steady states of a Kelvin foundation sliding over a periodic line.

    Parameters
    ----------
    height : array, shape (n,)
        Heights at equidistant nodes, positive into the elastomer, which moves along the line in the order of the nodes.
    slope : array, shape (n,), or None
        Derivative of the height by position over the length of the line at the nodes; needed by ``"hermite"`` only.
    reaches : array, shape (cases,)
        v tau / L.
    loads : array, shape (cases,)
        F_N / (4 G L), the mean displacement, in the unit of height.
    scheme : {"hermite", "piecewise_linear", "backward_euler"}
        Exact sweep over cubic cells or over straight ones, or the papers' time steps.

    Returns
    -------
    Steady
        With ``mu = drag / (load L)``, height and length L in the same unit.

    Raises
    ------
    ValueError
        If the scheme needs slopes that are not given.
    """
    if scheme == "hermite" and slope is None:
        raise ValueError("expected slopes at the nodes for the scheme 'hermite', got None")
    good = np.isfinite(reaches) & np.isfinite(loads) & (reaches > 0) & (loads > 0)
    if not np.all(np.isfinite(height)) or (slope is not None and not np.all(np.isfinite(slope))):
        good[:] = False
    results = np.full((4, loads.size), np.nan)
    status = np.full(loads.size, INVALID, np.int8)
    if np.any(good):
        solve = _backward_euler if scheme == "backward_euler" else _exact
        results[:, good], status[good] = solve(height, slope, reaches[good] * height.size, loads[good], scheme)
    results[:, status != CONVERGED] = np.nan
    return Steady(results[0], results[1], results[2], results[3], status)


def _exact(
    height: FloatArray, slope: FloatArray | None, reaches: FloatArray, loads: FloatArray, scheme: Scheme
) -> tuple[FloatArray, NDArray[np.int8]]:
    """Solve by sweeps over cells; reaches in cells."""
    if scheme == "hermite" and slope is not None:
        rise = slope / height.size
        cells, top = cut(height, rise, np.roll(rise, -1), True, True)
    else:
        rise = np.roll(height, -1) - height
        cells, top = cut(height, rise, rise, True, False)
    order = np.lexsort((loads, reaches))
    results, status = np.full((loads.size, 4), np.nan), np.zeros(loads.size, np.int8)
    ordered, ordered_status = results.copy(), status.copy()
    _states(cells, reaches[order], loads[order], ordered, ordered_status)
    results[order], status[order] = ordered, ordered_status
    results[:, 1] -= top
    return results.T, status


def _backward_euler(
    height: FloatArray, slope: FloatArray | None, reaches: FloatArray, loads: FloatArray, scheme: Scheme
) -> tuple[FloatArray, NDArray[np.int8]]:
    """Solve by time steps of one cell; reaches in cells."""
    start = int(np.argmax(height))
    top = height[start]
    depths, sums = backward_euler.solve(np.roll(height, -start) - top, reaches, loads)
    touched = sums[backward_euler.TOUCHED]
    contact_slope = np.sqrt(sums[backward_euler.STRETCH] / np.maximum(touched, 1)) * height.size
    status = np.where(np.isnan(sums[0]), NOT_CONVERGED, CONVERGED).astype(np.int8)
    return np.stack([sums[backward_euler.DRAG], depths - top, touched / height.size, contact_slope]), status
