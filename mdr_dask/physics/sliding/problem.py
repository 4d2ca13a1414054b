"""Steady sliding of a solid over a line, in dimensionless quantities. A case is a pair of speed and load.

A Kelvin solid has no friction on a smooth plane. Full contact of any solid with a rough plane has a closed form, which
is used if `oversampling` is "auto" and, for a Kelvin solid, the scheme is "hermite". All other cases are solved by one
of three modules:

* `node_to_node`, the fastest solver, for a Kelvin solid on a rough plane, if `oversampling` is "auto", the scheme is
  "hermite", and the requested accuracy is above `node_to_node.ARITHMETIC`;
* `steady` (sweeps over cubic cells, or backward Euler) for all other cases of a Kelvin solid, and for cases in which
  `node_to_node` misses the accuracy;
* `viscoelastic` (sweeps over straight cells) for any other solid.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import Refined, Solution, refine
from mdr_dask.physics.sliding import node_to_node, steady
from mdr_dask.physics.sliding.cases import Cases, Scheme, Steady, valid
from mdr_dask.physics.sliding.full_contact import steady_full_contact
from mdr_dask.physics.surfaces.rough_line import RoughLine

FLOORS = (0.0, 1.0, 0.0, 0.0)
"""The relative error of a result is the error divided by the magnitude of the result, or by a floor if this is larger.

The four floors belong to the rows of `Steady.columns`. The floor of the depth is the unit of height, which is the rms
height.
"""
NODE_LEVELS = tuple(
    2**k for k in range(12)
)  # nodes per Nyquist point; more than 2 are used only in blocks in which contact begins or ends
CELL_LEVELS = tuple(2**k for k in range(1, 7))
GENERAL_LEVELS = tuple(2**k for k in range(1, 9))
ORDER_OF_CELLS = 2.0  # order of convergence of sweeps over cubic cells if contact patches are shorter than a cell
ORDER_OF_STEPS = 1.0  # order of convergence of backward Euler
ROUNDING = 1e-12  # relative rounding error of a sum over several thousand nodes


@dataclass(frozen=True)
class PronyTerms:
    """Prony terms of a solid in dimensionless form: G_m / G_inf and tau_m v / L."""

    moduli: tuple[float, ...] = ()
    deborah: tuple[float, ...] = ()


@dataclass(frozen=True)
class Request:
    """The requested results, and either the requested accuracy or a given grid.

    `accuracy` is the allowed relative error (for small results see `FLOORS`). `oversampling` is the number of nodes per
    Nyquist point, or "auto" for the smallest number that meets the accuracy. `scheme`, for a Kelvin solid only, is
    "hermite" (cubic cells) or "backward_euler" (the time steps of the thesis). If `with_errors` is False, the errors of
    a Kelvin solid on a given grid are not estimated. `contact` requests contact fraction and contact slope, which need
    finer grids than drag and depth.
    """

    accuracy: float = 0.01
    oversampling: int | Literal["auto"] = "auto"
    scheme: Scheme = "hermite"
    with_errors: bool = True
    contact: bool = True

    @property
    def columns(self) -> int:
        """Number of requested results: all four of `Steady.columns`, or only the first two (drag and depth)."""
        return 4 if self.contact else 2


def solve(
    line: RoughLine, terms: PronyTerms | None, deborah: FloatArray, loads: FloatArray, request: Request
) -> tuple[Steady, FloatArray]:
    """Return the steady states of a solid that slides over a line, and the errors of the results, shape (4, cases).

    Positions on the line are divided by the length of the line. For a Kelvin solid, `terms` is None. The Deborah number
    is eta v / (G_inf L), where eta is the viscosity of the dashpot. For a Kelvin solid, the Deborah number is equal to
    v tau / L. The load is F_N / (4 G_inf L), in the unit of height.

    The errors are the absolute discretisation errors of `Steady.columns`, or infinite where there is no estimate. If
    `oversampling` is "auto" and no solver meets the accuracy in a case, the results of the solver with the smallest
    error of the drag are returned, on the finest grid on which this solver found a solution.
    """
    cases = Cases(deborah, loads)
    if terms is not None:
        return _general(line, terms, cases, request)
    if line.body is None and not np.any(line.roughness.coefficients):
        return _smooth_plane(cases)
    grid = request.oversampling
    if grid == "auto":
        return _to_accuracy(line, cases, request)
    if request.with_errors and request.scheme == "hermite" and grid > 1:
        refined = _swept(line, cases, request, (grid // 2, grid), np.inf)
        return Steady.of(np.array(refined.values), refined.outcome), refined.errors
    found = _on_grid(line, cases, request, grid, None)
    errors = np.full((4, loads.size), np.inf)
    if request.with_errors:
        # an estimate from two grids is impossible: either backward Euler is too far from convergence on this grid, or
        # there is no coarser grid, because this grid has only one node per Nyquist point; the error is therefore the
        # difference from an accurate solution, plus the error of the accurate solution
        exact, errors = solve(line, None, *cases, Request(request.accuracy, contact=request.contact))
        errors = np.abs(found.columns - exact.columns) + errors
        errors[np.isnan(errors)] = np.inf
    return found, errors


def _to_accuracy(line: RoughLine, cases: Cases, request: Request) -> tuple[Steady, FloatArray]:
    """Solve every case of a Kelvin solid in closed form, or on the coarsest grid whose results meet the accuracy."""
    on_plane = request.scheme == "hermite" and line.body is None
    columns, errors, status = _in_full_contact(line, PronyTerms(), cases) if on_plane else _unsolved(cases)
    left = np.flatnonzero(valid(*cases) & (status != Outcome.CONVERGED))
    if on_plane and left.size and request.accuracy > node_to_node.ARITHMETIC:
        search = node_to_node.NodeToNode(line, cases.only(left), request.accuracy)
        found = refine(
            search.solve,
            left.size,
            NODE_LEVELS,
            request.accuracy,
            node_to_node.ORDER,
            floors=FLOORS,
            requested=request.columns,
        )
        _write((columns, errors, status), left, found)
        left = left[~found.met]
    if left.size:
        levels = CELL_LEVELS if request.scheme == "hermite" else (1, *CELL_LEVELS)
        _write((columns, errors, status), left, _swept(line, cases.only(left), request, levels, request.accuracy))
    return Steady.of(columns, status), errors


def _swept(line: RoughLine, cases: Cases, request: Request, levels: tuple[int, ...], accuracy: float) -> Refined:
    """Solve cases on finer and finer grids, by sweeps over cubic cells or by backward Euler.

    With cubic cells, each search for the depth starts from the depth on the previous grid.
    """
    depths = np.full(cases.loads.size, np.nan)
    # with cubic cells, contact fraction and slope are computed at a rounded depth, and the effect of rounding may be
    # equal on two grids
    unseen = np.array([[0.0], [0.0], [1.0], [1.0]]) * 2.0 ** (1 - steady.LATTICE_BITS)

    def solve(level: int, some: IntArray) -> Solution:
        found = _on_grid(line, cases.only(some), request, level, depths[some])
        depths[some] = found.depth
        return Solution(found.columns, found.status, unseen)

    # sweeps over cubic cells have the order ORDER_OF_CELLS only with at least two nodes per Nyquist point
    order = ORDER_OF_CELLS if request.scheme == "hermite" and levels[0] > 1 else ORDER_OF_STEPS
    return refine(solve, cases.loads.size, levels, accuracy, order, floors=FLOORS, requested=request.columns)


def _on_grid(line: RoughLine, cases: Cases, request: Request, oversampling: int, depths: FloatArray | None) -> Steady:
    """Solve cases on a grid without an estimate of the errors.

    With cubic cells, the search for the depth starts from `depths`, if given.
    """
    nodes = line.points * oversampling
    if request.scheme == "hermite":
        return steady.steady_sliding(line.cubic(nodes), *cases, depths)
    return steady.stepped_sliding(line.straight(nodes), *cases, request.contact)


def _write(results: tuple[FloatArray, FloatArray, NDArray[np.int8]], cases: IntArray, found: Refined) -> None:
    """Write the new results of `cases` to `results`.

    A converged old solution is kept unless the new solution meets the accuracy or has a smaller error of the drag.
    """
    columns, errors, status = results
    better = (status[cases] != Outcome.CONVERGED) | found.met | (found.errors[0] < errors[0, cases])
    some = cases[better]
    columns[:, some] = np.array(found.values)[:, better]
    errors[:, some], status[some] = found.errors[:, better], found.outcome[better]


def _in_full_contact(
    line: RoughLine, terms: PronyTerms, cases: Cases
) -> tuple[FloatArray, FloatArray, NDArray[np.int8]]:
    """Return results, errors and status of cases on a plane. The status is INVALID unless contact is certainly full."""
    pairs = tuple(zip(terms.moduli, terms.deborah, strict=True))
    full = steady_full_contact(line, pairs, cases)
    errors = ROUNDING * np.abs(full.columns)
    return full.columns, np.where(np.isnan(errors), np.inf, errors), full.status


def _unsolved(cases: Cases) -> tuple[FloatArray, FloatArray, NDArray[np.int8]]:
    """Return arrays for results (NaN), errors (infinite) and status (invalid) of cases that are not solved yet."""
    columns = np.full((4, cases.loads.size), np.nan)
    return columns, np.full_like(columns, np.inf), np.full(cases.loads.size, Outcome.INVALID, np.int8)


def _general(line: RoughLine, terms: PronyTerms, cases: Cases, request: Request) -> tuple[Steady, FloatArray]:
    """Solve cases of any linear solid."""
    from mdr_dask.physics.sliding import viscoelastic  # imported here, because few studies need this module
    from mdr_dask.physics.solids import prony

    (deborah, loads), is_auto = cases, request.oversampling == "auto"
    results = _in_full_contact(line, terms, cases) if is_auto and line.body is None else _unsolved(cases)
    columns, errors, status = results
    good = np.isfinite(deborah) & (deborah >= 0) & np.isfinite(loads) & (loads > 0)
    left = np.flatnonzero(good & (status != Outcome.CONVERGED))
    solids = [prony(1.0, terms.moduli, terms.deborah, deborah[k]) for k in left]
    searches = [viscoelastic.ViscoelasticCase(solid, load) for solid, load in zip(solids, loads[left], strict=True)]
    line = line.from_summit()
    # number of cells of the coarsest grid; results on every finer grid are extrapolated from the last two grids
    coarsest = line.points if request.oversampling == "auto" else -(-line.points * request.oversampling // 4)

    def solve(level: int, some: IntArray) -> Solution:
        height = line.straight(coarsest * level).height
        found = [searches[k].on(height, line.body is None) for k in some]
        values = np.concatenate([np.array(one.values) for one in found], axis=1)
        return Solution(values, np.concatenate([one.outcome for one in found]), np.array([one.unseen for one in found]))

    if left.size:
        solve(1, np.arange(left.size))
        levels, accuracy = (GENERAL_LEVELS, request.accuracy) if is_auto else (GENERAL_LEVELS[:2], np.inf)
        found = refine(solve, left.size, levels, accuracy, viscoelastic.ORDER, floors=FLOORS, requested=request.columns)
        _write(results, left, found)
    # In very fast or very slow sliding, the drag is a small difference of large stresses.
    rounding = ROUNDING * loads[left] * columns[3, left]
    errors[0, left] += np.where(np.isnan(rounding), 0.0, rounding)
    return Steady.of(columns, status), errors


def _smooth_plane(cases: Cases) -> tuple[Steady, FloatArray]:
    """Return the steady states on a smooth plane, where friction is zero, and errors of zero."""
    zero = np.zeros(cases.loads.size)
    status = np.where(valid(*cases), np.int8(Outcome.CONVERGED), np.int8(Outcome.INVALID))
    return Steady.of(np.array([zero, cases.loads, zero + 1, zero]), status), np.zeros((4, zero.size))
