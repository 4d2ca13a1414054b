"""Steady sliding in dimensionless quantities: a solid, a line, and cases of speed and load.

A smooth indenter or a smooth plane on a Kelvin solid is solved in closed form, other lines on a Kelvin solid by
`kelvin_refinement`, and any other solid by `viscoelastic`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import Solution, refine
from mdr_dask.physics.sliding import full_contact
from mdr_dask.physics.sliding.cases import Scheme, Steady, valid
from mdr_dask.physics.sliding.kelvin_refinement import FLOORS, KelvinCases, nodes_of
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.shapes import COLUMNS as CLOSED_COLUMNS
from mdr_dask.physics.surfaces.shapes import PowerLaw, smooth

GENERAL_LEVELS = tuple(2**k for k in range(1, 9))  # numbers of nodes per Nyquist point for a general solid
CLOSED_FORM = 1e-12  # relative error of the closed form of a smooth indenter, due to rounding


@dataclass(frozen=True)
class PronyTerms:
    """Prony terms of a solid in units of the line: G_m / G_inf and tau_m v / L."""

    moduli: tuple[float, ...] = ()
    deborah: tuple[float, ...] = ()


@dataclass(frozen=True)
class Request:
    """The requested accuracy, or the grid.

    Parameters
    ----------
    accuracy : float
        Allowed relative error of drag, contact fraction, contact slope and depth. The error of a depth that is smaller
        than the rms height is relative to the rms height.
    oversampling : int or "auto"
        Nodes per Nyquist point; "auto" selects the smallest number that meets the accuracy.
    scheme : {"hermite", "piecewise_linear", "backward_euler"}
        Scheme for a Kelvin solid.
    with_errors : bool
        Whether errors are requested on a given grid.
    contact : bool
        Whether contact fraction and contact slope are requested.
    """

    accuracy: float = 0.01
    oversampling: int | Literal["auto"] = "auto"
    scheme: Scheme = "hermite"
    with_errors: bool = True
    contact: bool = True


def solve(
    line: RoughLine, terms: PronyTerms | None, deborah: FloatArray, loads: FloatArray, request: Request
) -> tuple[Steady, FloatArray]:
    """Return the steady states of a solid that slides over a line, and their errors.

    Parameters
    ----------
    line : RoughLine
        The line; positions are in units of its length, heights in any unit.
    terms : PronyTerms or None
        Prony terms of the solid; None for a Kelvin solid.
    deborah : array, shape (cases,)
        eta v / (G_inf L) of the dashpot. For a Kelvin solid this is the Deborah number v tau / L.
    loads : array, shape (cases,)
        F_N / (4 G_inf L), in the unit of height.
    request : Request
        Accuracy or grid.

    Returns
    -------
    Steady
    array, shape (4, cases)
        Estimated absolute discretisation errors of `Steady.columns`.
    """
    if terms is not None:
        return _general(line, terms, deborah, loads, request)
    is_smooth = not np.any(line.roughness.coefficients)
    if is_smooth and (line.body is None or isinstance(line.body, PowerLaw)):
        return _closed_form(line.body, deborah, loads)
    cases = KelvinCases(line, request.scheme, deborah, loads, request.contact)
    if request.oversampling == "auto":
        return cases.to_accuracy(request.accuracy)
    if request.with_errors:
        return cases.with_errors(request.oversampling)
    return cases.on_grid(request.oversampling), np.full((4, loads.size), np.inf)


def _general(
    line: RoughLine, terms: PronyTerms, deborah: FloatArray, loads: FloatArray, request: Request
) -> tuple[Steady, FloatArray]:
    """Solve cases of any linear solid."""
    from mdr_dask.physics.sliding import viscoelastic  # imported here, because few studies need its kernels
    from mdr_dask.physics.solids import prony

    columns, errors = np.full((4, loads.size), np.nan), np.full((4, loads.size), np.inf)
    status = np.full(loads.size, Outcome.INVALID, np.int8)
    if line.body is None and request.oversampling == "auto":
        pairs = tuple(zip(terms.moduli, terms.deborah, strict=True))
        steady = full_contact.steady_full_contact(line.roughness, pairs, nodes_of(line), deborah, loads)
        if steady is not None:
            columns, status = steady.columns, steady.status
            errors = full_contact.ROUNDING * np.abs(columns)
    good = np.isfinite(deborah) & (deborah >= 0) & np.isfinite(loads) & (loads > 0)
    left = np.flatnonzero((status != Outcome.CONVERGED) & good)
    if not left.size:
        return Steady.of(columns, status), errors
    turned = line.from_summit()
    # number of cells of the coarsest grid; from the second grid on, results are extrapolated from two successive grids
    coarsest = line.points if request.oversampling == "auto" else -(-line.points * request.oversampling // 4)
    levels = GENERAL_LEVELS if request.oversampling == "auto" else GENERAL_LEVELS[:2]
    accuracy = request.accuracy if request.oversampling == "auto" else np.inf
    lines: dict[int, FloatArray] = {}
    for k in left:
        solid = prony(1.0, terms.moduli, terms.deborah, deborah[k])
        case = viscoelastic.ViscoelasticCase(solid, float(loads[k]))

        def on_grid(level: int, _: IntArray | None, case: viscoelastic.ViscoelasticCase = case) -> Solution:
            if level not in lines:
                lines[level] = turned.straight(coarsest * level).height
            return case.on(lines[level], line.body is None)

        on_grid(1, None)
        found = refine(on_grid, 1, levels, accuracy, viscoelastic.ORDER, floors=FLOORS)
        status[k], columns[:, k], errors[:, k] = found.outcome[0], np.concatenate(found.values), found.errors[:, 0]
    # the relative error of stresses equals the tolerance of the depth; in very fast or very slow sliding the drag is a
    # small difference of large stresses
    rounding = viscoelastic.TOLERANCE * loads[left] * columns[3, left]
    errors[0, left] += np.where(np.isnan(rounding), 0.0, rounding)
    return Steady.of(columns, status), errors


def _closed_form(body: PowerLaw | None, deborah: FloatArray, loads: FloatArray) -> tuple[Steady, FloatArray]:
    """Return steady states on a smooth body: friction is zero on a plane, and has a closed form for an indenter."""
    good = valid(deborah, loads)
    status = np.where(good, np.int8(Outcome.CONVERGED), np.int8(Outcome.INVALID))
    columns = np.full((4, loads.size), np.nan)
    if body is None:
        columns[:, good] = np.array([np.zeros(loads.size), loads, np.ones(loads.size), np.zeros(loads.size)])[:, good]
    elif np.any(good):
        found = np.empty((int(good.sum()), CLOSED_COLUMNS))
        coefficient, exponent = (np.full(len(found), number) for number in (body.coefficient, body.exponent))
        smooth(loads[good], deborah[good], coefficient, exponent, found)
        depth, drag, lead, trail, stretch = found.T
        columns[:, good] = np.stack([drag, depth, lead + trail, np.sqrt(stretch / (lead + trail))])
        outcome = np.where(np.isnan(depth), Outcome.DEPTH_NOT_FOUND, Outcome.CONVERGED)
        status[good] = np.where(np.maximum(lead, trail) > 0.5, Outcome.OUTSIDE_LINE, outcome)
    steady = Steady.of(columns, status)
    return steady, CLOSED_FORM * np.abs(steady.columns)
