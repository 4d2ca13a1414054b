"""Steady sliding without units: a solid, a line and cases of speed and load; the solver is picked by the solid.

A Kelvin solid goes to the sweep of `kelvin`, by the ladder of grids of `accuracy`; a smooth indenter of it to its
closed form; any other solid to `viscoelastic`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.accuracy import COLUMNS, Errors, Ladder, in_full_contact, relative
from mdr_dask.physics.sliding.cases import Scheme, Steady, unsolved, valid
from mdr_dask.physics.sliding.full_contact import SEEN
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.shapes import COLUMNS as CLOSED_COLUMNS
from mdr_dask.physics.surfaces.shapes import PowerLaw, smooth

COARSEST, FINEST = 4, 256  # points for every Nyquist point that `auto` begins and ends with for a general solid
ROUGHLY = 0.05  # accuracy that the coarsest mostly meets; stated errors fall with the third power of the points
CELLS = 4  # the general solver compares grids of every, every second and every fourth node
CLOSED_FORM = 1e-12  # relative error of a smooth indenter: rounding


@dataclass(frozen=True)
class Arms:
    """The relaxing arms of a solid as a line passes: G_m / G_inf and tau_m v / L."""

    moduli: tuple[float, ...] = ()
    deborah: tuple[float, ...] = ()


@dataclass(frozen=True)
class Aim:
    """What is wanted of a solution.

    Parameters
    ----------
    columns : collection of str
        Columns of a `Steady`: what an accuracy is asked of.
    accuracy : float
        Relative error allowed for each of them.
    oversampling : int or "auto"
        Nodes for every Nyquist point; "auto" for the fewest that meet the accuracy.
    scheme : {"hermite", "piecewise_linear", "backward_euler"}
        Of a Kelvin solid.
    with_errors : bool
        Whether errors are wanted on a grid that is given.
    """

    columns: Collection[str] = COLUMNS
    accuracy: float = 0.01
    oversampling: int | Literal["auto"] = "auto"
    scheme: Scheme = "hermite"
    with_errors: bool = True


def solve(
    line: RoughLine, arms: Arms | None, deborah: FloatArray, loads: FloatArray, aim: Aim
) -> tuple[Steady, Errors]:
    """Return the steady states of a solid that slides over a line, and their absolute discretisation errors.

    Parameters
    ----------
    line : RoughLine
        What it slides over.
    arms : Arms or None
        Of the solid; None for a Kelvin solid.
    deborah : array, shape (cases,)
        eta v / (G_inf L) of the dashpot: the Deborah number v tau / L of a Kelvin solid.
    loads : array, shape (cases,)
        F_N / (4 G_inf L), in the unit of height.
    aim : Aim
        What is wanted.
    """
    if arms is not None:
        return _general(line, arms, deborah, loads, aim)
    is_smooth = not np.any(line.roughness.coefficients)
    if is_smooth and (line.body is None or isinstance(line.body, PowerLaw)):
        return _closed_form(line.body, deborah, loads)
    ladder = Ladder(line, aim.scheme, deborah, loads, aim.columns)
    if aim.oversampling == "auto":
        return ladder.to_accuracy(aim.accuracy)
    if aim.with_errors:
        return ladder.with_errors(aim.oversampling)
    return ladder.on_grid(aim.oversampling), Errors.unknown(loads.size)


def _general(line: RoughLine, arms: Arms, deborah: FloatArray, loads: FloatArray, aim: Aim) -> tuple[Steady, Errors]:
    """Solve cases of any linear solid one by one, each on the coarsest grid that meets the accuracy."""
    from mdr_dask.physics.sliding.viscoelastic import ViscoelasticLadder  # kernels that few studies need
    from mdr_dask.physics.solids import prony

    steady, errors = unsolved(loads.size), Errors.unknown(loads.size)
    if line.body is None and aim.oversampling == "auto":
        nodes = line.points * SEEN
        pairs = tuple(zip(arms.moduli, arms.deborah, strict=True))
        on_nodes = line.heights(nodes), line.slopes(nodes)
        steady, errors = in_full_contact(line, pairs, on_nodes, deborah, loads) or (steady, errors)
    left = (
        (steady.status != Outcome.CONVERGED) & np.isfinite(deborah) & (deborah >= 0) & np.isfinite(loads) & (loads > 0)
    )
    finer = max(0, int(np.ceil(np.log2(ROUGHLY / aim.accuracy) / 3)))
    first = min(COARSEST * 2**finer, FINEST) if aim.oversampling == "auto" else aim.oversampling
    turned = line.from_summit()
    straight = cache(lambda oversampling: turned.straight(-(-line.points * oversampling // CELLS) * CELLS))
    for k in np.flatnonzero(left):
        ladder = ViscoelasticLadder(prony(1.0, arms.moduli, arms.deborah, deborah[k]), float(loads[k]))
        oversampling = first
        while True:
            found = ladder.on(straight(oversampling))
            one = _columns(found.values[:, None], np.array([found.status], np.int8))
            known = Errors(*found.errors[:, None])
            met = np.all(relative(one, known, aim.columns) <= aim.accuracy)
            if aim.oversampling != "auto" or met or found.status.is_impossible or oversampling >= FINEST:
                break
            oversampling *= 2
        steady, errors = steady.replaced(np.array([k]), one), errors.replaced(np.array([k]), known)
    return steady, errors


def _columns(values: FloatArray, status: NDArray[np.int8]) -> Steady:
    """Return steady states from the rows of their columns."""
    drag, depth, fraction, slope = values
    return Steady(drag, depth, fraction, slope, status)


def _closed_form(body: PowerLaw | None, deborah: FloatArray, loads: FloatArray) -> tuple[Steady, Errors]:
    """Solve a Kelvin solid without roughness: a plane has no friction, an indenter is known in closed form."""
    steady = unsolved(loads.size)
    good = valid(deborah, loads)
    steady.status[good] = Outcome.CONVERGED
    if body is None:
        nothing, whole = np.where(good, 0.0, np.nan), np.where(good, 1.0, np.nan)
        steady = Steady(nothing, np.where(good, loads, np.nan), whole, nothing, steady.status)
    elif np.any(good):
        found = np.empty((int(good.sum()), CLOSED_COLUMNS))
        coefficient, exponent = (np.full(len(found), number) for number in (body.coefficient, body.exponent))
        smooth(loads[good], deborah[good], coefficient, exponent, found)
        depth, drag, lead, trail, stretch = found.T
        status = np.where(np.isnan(depth), Outcome.DEPTH_NOT_FOUND, Outcome.CONVERGED)
        status = np.where(np.maximum(lead, trail) > 0.5, Outcome.OUTSIDE_LINE, status).astype(np.int8)
        columns = np.stack([drag, depth, lead + trail, np.sqrt(stretch / (lead + trail))])
        columns[:, status != Outcome.CONVERGED] = np.nan
        steady = steady.replaced(good, _columns(columns, status))
    return steady, Errors(*(CLOSED_FORM * np.abs(getattr(steady, name)) for name in COLUMNS))
