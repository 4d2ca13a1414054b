"""Cases of one line, and their steady states: what every solver of a Kelvin solid takes and gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome

Scheme = Literal["hermite", "piecewise_linear", "backward_euler"]


class Cases(NamedTuple):
    """Deborah numbers and loads of cases on a line, one entry for each."""

    deborah: FloatArray
    loads: FloatArray


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
        Values of `Outcome`.
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
    return Steady(nothing, nothing, nothing, nothing, np.full(cases, Outcome.INVALID, np.int8))


def valid(deborah: FloatArray, loads: FloatArray) -> NDArray[np.bool_]:
    """Return which cases are numbers above zero."""
    good: NDArray[np.bool_] = np.isfinite(deborah) & np.isfinite(loads) & (deborah > 0) & (loads > 0)
    return good
