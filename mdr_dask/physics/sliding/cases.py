"""Cases of steady sliding on one line (the input of the solvers), and steady states (the output)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome

Scheme = Literal["hermite", "backward_euler"]

COARSENING = 8
"""Ratio of the numbers of nodes of successive grids in `strides`, chosen by trial."""

COLUMNS = ("drag", "depth", "contact_fraction", "contact_slope")
"""Names of the results of a case, in the order of the rows of `Steady.columns`."""


class Cases(NamedTuple):
    """Deborah numbers and loads of cases on one line. Entry k of each array belongs to case k."""

    deborah: FloatArray
    loads: FloatArray

    def only(self, cases: NDArray[Any]) -> Cases:
        """Return the selected cases."""
        return Cases(self.deborah[cases], self.loads[cases])


def first_depths(loads: FloatArray) -> FloatArray:
    """Return first guesses of the penetration of the highest point, from loads F_N / (4 G L)."""
    return np.maximum(loads, loads ** (2 / 3))


def strides(nodes: int) -> list[int]:
    """Return the strides of the grids on which the depth is searched, from coarse to fine (stride 1: every node)."""
    found = [1]
    while nodes > COARSENING**2 * found[-1]:
        found.append(found[-1] * COARSENING)
    return found[::-1]


@dataclass(frozen=True)
class Steady:
    """Steady states of several cases. Entry k of each array belongs to case k.

    Parameters
    ----------
    drag : array
        F_x / (4 G), in the unit of height squared. The coefficient of friction is mu = F_x / F_N.
    depth : array
        Penetration d of the mean line, in the unit of height.
    contact_fraction : array
        Fraction of the length of the line that is in contact.
    contact_slope : array
        rms slope of the part of the line that is in contact, in the unit of height over the length of the line.
    status : int8 array
        Values of `Outcome`.
    """

    drag: FloatArray
    depth: FloatArray
    contact_fraction: FloatArray
    contact_slope: FloatArray
    status: NDArray[np.int8]

    @property
    def columns(self) -> FloatArray:
        """The results as the rows of one array, shape (4, cases)."""
        return np.array([self.drag, self.depth, self.contact_fraction, self.contact_slope])

    @classmethod
    def of(cls, columns: FloatArray, status: NDArray[np.int8]) -> Steady:
        """Return steady states from an array with one row per result. The results of failed cases become NaN."""
        drag, depth, fraction, slope = np.where(status == Outcome.CONVERGED, columns, np.nan)
        return cls(drag, depth, fraction, slope, status)


def valid(deborah: FloatArray, loads: FloatArray) -> NDArray[np.bool_]:
    """Return for each case whether the Deborah number and the load are positive and finite."""
    good: NDArray[np.bool_] = np.isfinite(deborah) & np.isfinite(loads) & (deborah > 0) & (loads > 0)
    return good
