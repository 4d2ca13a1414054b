"""Direct steady sliding of a viscoelastic Kelvin foundation over a profile, at prescribed load."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.sliding import backward_euler
from mdr_dask.physics.sliding.kelvin import (
    DISPLACEMENT,
    DRAG,
    DRAG_RATE,
    LENGTH,
    OUTSIDE,
    STIFFNESS,
    STRETCH,
    SUMS,
    sweep,
)
from mdr_dask.physics.surfaces.cubic_line import BLOCK, Cells, Profile, cut, indented_line, periodic_line

Scheme = Literal["hermite", "piecewise_linear", "backward_euler"]

CONVERGED, NOT_CONVERGED, OUTSIDE_LINE, INVALID = 0, 1, 2, 3
MESSAGES = {
    NOT_CONVERGED: "the depth for the load was not found in {iterations} sweeps",
    OUTSIDE_LINE: "the contact leaves the line: a longer line or a smaller load is needed",
    INVALID: "load, velocity and profile must be finite, the load and v tau positive",
}
ITERATIONS = 200
PATIENCE = 20  # sweeps before the bracket is halved
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


def unsolved(cases: int) -> Steady:
    """Return what is known of cases before they are solved."""
    nothing = np.full(cases, np.nan)
    return Steady(nothing, nothing, nothing, nothing, np.full(cases, INVALID, np.int8))


def valid(reaches: FloatArray, loads: FloatArray) -> NDArray[np.bool_]:
    """Return which cases are numbers above zero."""
    good: NDArray[np.bool_] = np.isfinite(reaches) & np.isfinite(loads) & (reaches > 0) & (loads > 0)
    return good


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
def _follow(sums: FloatArray, depth: float, trail: FloatArray) -> None:
    """Note log depth, log load, their slope and its change in `trail`, from the last sweep and the one before."""
    carried = sums[DISPLACEMENT]
    load, slope = np.log(carried), carried / (sums[STIFFNESS] * depth)
    change = load - trail[1]
    bend = (slope - trail[2]) / change if abs(change) > 1e-12 and trail[2] > 0 else 0.0
    trail[0], trail[1], trail[2], trail[3] = np.log(depth), load, slope, bend


@njit(nogil=True, cache=True)
def _guess(trail: FloatArray, load: float) -> float:
    """Extrapolate log depth over log load to a load."""
    ahead = np.log(load) - trail[1]
    bend = 0.5 * trail[3] * ahead
    limit = 0.5 * trail[2]
    return math.exp(trail[0] + ahead * (trail[2] + min(max(bend, -limit), limit)))


@njit(nogil=True, cache=True)
def _solve(
    cells: Cells,
    barriers: FloatArray,
    block_barriers: FloatArray,
    reach: float,
    load: float,
    trail: FloatArray,
    sums: FloatArray,
) -> tuple[float, bool]:
    """Find the last lattice depth that carries less than the load, and leave its sums.

    The load is a convex, increasing function of the depth, so that its tangent bounds the root from above: a lattice
    depth below the root whose tangent reaches the load before the next lattice depth is the one wanted. It is unique,
    and so the answer does not depend on the `trail` that the search follows.
    """
    low, high = 0.0, np.inf
    depth = _floor(_guess(trail, load))
    best = np.zeros(SUMS)
    for iteration in range(ITERATIONS):
        sweep(cells, barriers, block_barriers, reach, depth, sums)
        carried = sums[DISPLACEMENT]
        if not (carried > 0 and sums[STIFFNESS] > 0):
            return depth, False
        tangent = depth + (load - carried) / sums[STIFFNESS]
        _follow(sums, depth, trail)
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
        proposal = min(_guess(trail, load), tangent) if carried <= load else _guess(trail, load)
        if iteration > PATIENCE and high < np.inf:
            proposal = 0.5 * (low + high)
        depth = _floor(proposal)
        if depth <= low:
            depth = _next(low)
        elif depth >= high:
            depth = _floor(0.5 * (low + high)) if high - low > 2 * (_next(low) - low) else low
            depth = max(depth, _next(low)) if low > 0 else _floor(0.5 * high)
    return depth, False


@njit(nogil=True, cache=True)
def _states(
    cells: Cells,
    reaches: FloatArray,
    loads: FloatArray,
    guesses: FloatArray,
    close: float,
    results: FloatArray,
    status: NDArray[np.int8],
) -> None:
    """Solve the cases of one profile, ordered by reach and load; see `Steady` for the columns of the results.

    The search for a depth follows that of the case before, or starts from its guess where that is a number. Where the
    tangent at a guess moves it by less than ``close``, relatively, that is taken for the answer.
    """
    n = cells.mean.size - 1
    barriers, block_barriers = np.empty(n), np.empty(n // BLOCK + 1)
    sums, trail, first = np.empty(SUMS), np.zeros(4), np.zeros(4)
    reach = -1.0
    first[:] = math.log(loads[0] / n), math.log(loads[0]), 0.7, 0.0
    for k in range(loads.size):
        starts = reaches[k] != reach
        if starts:
            reach = reaches[k]
            block_barriers[:] = np.nan
            trail[:] = first
        depth, converged = guesses[k], False
        if guesses[k] > 0:
            trail[:] = math.log(guesses[k]), math.log(loads[k]), 0.7, 0.0
            if close > 0:
                sweep(cells, barriers, block_barriers, reach, depth, sums)
                converged = abs(loads[k] - sums[DISPLACEMENT]) < close * depth * sums[STIFFNESS]
        if not converged:
            depth, converged = _solve(cells, barriers, block_barriers, reach, loads[k], trail, sums)
        if not converged:
            status[k] = NOT_CONVERGED
            trail[:] = first
            continue
        if starts:
            first[:] = trail
        shift = (loads[k] - sums[DISPLACEMENT]) / sums[STIFFNESS]
        status[k] = OUTSIDE_LINE if sums[OUTSIDE] > 0 else CONVERGED
        results[k, 0] = sums[DRAG] + shift * sums[DRAG_RATE]
        results[k, 1] = depth + shift
        results[k, 2] = sums[LENGTH] / n
        results[k, 3] = n * np.sqrt(sums[STRETCH] / sums[LENGTH]) if sums[LENGTH] > 0 else 0.0


def steady_sliding(
    height: FloatArray,
    slope: FloatArray | None,
    reaches: FloatArray,
    loads: FloatArray,
    scheme: Scheme = "hermite",
    contact: bool = True,
    guesses: FloatArray | None = None,
    close: float = 0.0,
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
    contact : bool
        Whether fraction and slope of the contact are wanted where they cost extra.
    guesses : array, shape (cases,), optional
        Depths to start the exact sweeps from; the answer does not depend on them while `close` is 0.
    close : float
        Relative change of a guess that its tangent is trusted with instead of a search: for comparisons only.

    Returns
    -------
    Steady
        With ``mu = drag / (load L)``, height and length L in the same unit.

    Raises
    ------
    ValueError
        If the scheme needs slopes that are not given.
    """
    profile = periodic_line(height, _needed(slope, scheme))
    return _steady(profile, reaches, loads, scheme, contact, guesses, close)


def steady_indenter(
    height: FloatArray,
    slope: FloatArray | None,
    coefficient: float,
    exponent: float,
    reaches: FloatArray,
    loads: FloatArray,
    scheme: Scheme = "hermite",
    contact: bool = True,
    guesses: FloatArray | None = None,
    close: float = 0.0,
) -> Steady:
    """Return the steady states of a Kelvin foundation under a rough line -c |x|^n + h(x) that it enters undeformed.

    Parameters
    ----------
    height, slope : array, shape (n + 1,)
        The roughness h, both ends included, and its derivative as in :func:`steady_sliding`.
    coefficient, exponent : float
        c > 0 and n >= 1 of the line, x in units of its length from its middle node n // 2.
    reaches, loads, scheme, contact, guesses, close
        As in :func:`steady_sliding`.

    Returns
    -------
    Steady
        With status `OUTSIDE_LINE` where an end of the line is in contact.
    """
    profile = indented_line(height, _needed(slope, scheme), coefficient, exponent)
    return _steady(profile, reaches, loads, scheme, contact, guesses, close)


def _needed(slope: FloatArray | None, scheme: Scheme) -> FloatArray | None:
    """Return the slopes for a scheme that uses them."""
    if scheme != "hermite":
        return None
    if slope is None:
        raise ValueError("expected slopes at the nodes for the scheme 'hermite', got None")
    return slope


def _steady(
    profile: Profile,
    reaches: FloatArray,
    loads: FloatArray,
    scheme: Scheme,
    contact: bool,
    guesses: FloatArray | None,
    close: float,
) -> Steady:
    """Solve the cases that are numbers."""
    good = valid(reaches, loads)
    good &= bool(np.all(np.isfinite(profile.height)) and np.all(np.isfinite(profile.enter)))
    results = np.full((4, loads.size), np.nan)
    status = np.full(loads.size, INVALID, np.int8)
    n = profile.enter.size
    if np.any(good) and scheme == "backward_euler":
        results[:, good], status[good] = _stepped(profile, reaches[good] * n, loads[good] * n, contact)
    elif np.any(good):
        start = np.full(int(good.sum()), np.nan) if guesses is None else guesses[good]
        results[:, good], status[good] = _swept(profile, reaches[good] * n, loads[good] * n, start, close)
    results[:, status != CONVERGED] = np.nan
    return Steady(results[0], results[1], results[2], results[3], status)


def _swept(
    profile: Profile, reaches: FloatArray, loads: FloatArray, guesses: FloatArray, close: float
) -> tuple[FloatArray, NDArray[np.int8]]:
    """Solve by sweeps over cells; reaches in cells, loads over 4 G dx."""
    cells, top = cut(profile)
    order = np.lexsort((loads, reaches))
    ordered, ordered_status = np.full((loads.size, 4), np.nan), np.zeros(loads.size, np.int8)
    _states(cells, reaches[order], loads[order], guesses[order] + top, close, ordered, ordered_status)
    results, status = np.empty_like(ordered), np.empty_like(ordered_status)
    results[order], status[order] = ordered, ordered_status
    results[:, 1] -= top
    return results.T, status


def _stepped(
    profile: Profile, reaches: FloatArray, loads: FloatArray, contact: bool
) -> tuple[FloatArray, NDArray[np.int8]]:
    """Solve by time steps of one cell; reaches in cells, loads over 4 G dx."""
    highest, n = int(np.argmax(profile.height)), profile.enter.size
    top = profile.height[highest]
    below = (np.roll(profile.height, -1 - highest) if profile.periodic else profile.height) - top
    results = np.full((4, loads.size), np.nan)
    depths, results[0], outside = backward_euler.solve(below, profile.periodic, reaches, loads)
    results[1] = depths - top
    if contact:
        backward_euler.contact(below, profile.periodic, reaches, depths, results[2], results[3])
        results[2] /= n
        results[3] *= n
    status = np.where(np.isnan(results[0]), NOT_CONVERGED, np.where(outside, OUTSIDE_LINE, CONVERGED))
    return results, status.astype(np.int8)
