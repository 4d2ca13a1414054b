"""The data classes of a campaign: checked, in SI units and frozen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.models.base import Parameters
from mdr_dask.models.data_file import DataFile

_DIGITS = 14
#: Number of significant digits to which the values of an axis are compared. Values that agree are computed only once.
SAME_DIGITS = 12
#: Largest number of values that `Axis.some` returns, for checks that would take too long with all values.
SOME = 64


@dataclass(frozen=True)
class Spread:
    """An interval from which values are taken, evenly spread either in the value or in its logarithm."""

    low: float
    high: float
    geometric: bool
    whole: bool

    def at(self, shares: Any) -> list[float]:
        """Return the values at fractions (0 to 1) of the interval, rounded to 14 digits to make powers of ten exact."""
        if self.geometric:
            values = self.low * (self.high / self.low) ** shares
        else:
            values = self.low + (self.high - self.low) * shares
        values = np.clip(values, min(self.low, self.high), max(self.low, self.high))
        return [tidy(value, self.whole) for value in values]

    def shares(self, values: Any) -> FloatArray:
        """Return the fractions of the interval at which values lie: the inverse of `at`."""
        numbers = np.asarray(values, dtype=np.float64)
        if self.geometric:
            found: FloatArray = np.log(numbers / self.low) / np.log(self.high / self.low)
        else:
            found = (numbers - self.low) / (self.high - self.low)
        return found


def tidy(value: float, whole: bool, exact: bool = False) -> float:
    """Return a number of a range, rounded.

    It is rounded to a whole number if `whole` is true. Otherwise it is rounded to 14 digits, or not at all if `exact`
    is true.
    """
    if whole:
        return round(value)
    return float(value) if exact else float(f"{value:.{_DIGITS}g}")


@dataclass(frozen=True)
class Axis:
    """One varied parameter.

    Parameters
    ----------
    path : str
        Dotted path in the model's parameters (``velocity``, ``indenter.angle``).
    name : str
        Name of its coordinate in the store: the path with ``_`` for ``.``.
    dim : str
        Its dimension in the store: `name` in a grid, or ``case`` in a study whose parameters vary together.
    values : tuple
        Checked values in SI, in the order of the file: numbers, names, or whole parameter sets.
    labels : tuple of str or None
        Names of the values in the store if the values are not numbers. None for numbers.
    unit : str or None
        SI unit, ``"1"`` for pure numbers. None if the values are names.
    long_name : str
        The parameter's meaning.
    refinement : Refinement or None
        Rule by which an adaptive axis gets further values; None for any other axis.
    """

    path: str
    name: str
    dim: str
    values: tuple[Any, ...]
    labels: tuple[str, ...] | None
    unit: str | None
    long_name: str
    refinement: Refinement | None = None

    @property
    def some(self) -> list[Any]:
        """At most `SOME` values of the axis, evenly spread, including the first and the last."""
        places = np.linspace(0, len(self.values) - 1, min(len(self.values), SOME)).round().astype(int)
        return [self.values[place] for place in places]


@dataclass(frozen=True)
class Series:
    """One series of a campaign, which is one group of the store: its parameters, and its axes.

    Parameters
    ----------
    name : str
        Name of the Zarr group. It is empty in a campaign without series, whose arrays are at the root of the store.
    parameters : Parameters
        All parameters. A varied parameter has the first value of its axis.
    axes : tuple of Axis
        The axes, in the order of the file.
    """

    name: str
    parameters: Parameters
    axes: tuple[Axis, ...]

    @property
    def sizes(self) -> dict[str, int]:
        """Length of each dimension, in order."""
        return {axis.dim: len(axis.values) for axis in self.axes}


@dataclass(frozen=True)
class Tolerance:
    """The largest accepted relative and absolute error. An error is accepted if it is within either of them.

    `place` is the position of the tolerance in the campaign file.
    """

    relative: float = 0.0
    absolute: float = 0.0
    place: str = field(default="", compare=False)


@dataclass(frozen=True)
class Refinement:
    """The rule by which a study chooses the values of an adaptive axis.

    Parameters
    ----------
    spread : Spread
        The interval of the axis, with the scale on which outputs are interpolated.
    until : mapping of str to Tolerance
        Largest accepted interpolation error of each output. A relative error refers to the largest value of the output
        along the axis.
    at_most : int
        Largest number of values.
    """

    spread: Spread
    until: Mapping[str, Tolerance]
    at_most: int


@dataclass(frozen=True)
class Replication:
    """The number of realisations of each case: first `at_least`, then more in rounds until every tolerance is met.

    Parameters
    ----------
    at_least, at_most : int
        Number of realisations in the first round, and largest number of realisations in all rounds together.
    until : mapping of str to Tolerance
        Largest accepted standard error of the mean of each output.
    answers : mapping of str to Tolerance
        Largest accepted half width of the 95 % interval of each fitted constant. The keys have the form
        ``fit.constant``.
    """

    at_least: int
    at_most: int
    until: Mapping[str, Tolerance]
    answers: Mapping[str, Tolerance] = field(default_factory=dict)

    @property
    def goes_on(self) -> bool:
        """Whether there may be more than one round."""
        return bool(self.until or self.answers)


@dataclass(frozen=True)
class Campaign:
    """A campaign file after all checks.

    Parameters
    ----------
    name, model : str
        Names of the campaign and of its model.
    seed : int
        Seed of every random number.
    replication : Replication
        Number of realisations of each case.
    series : tuple of Series
        At least one series.
    outputs : tuple of str
        The arrays to compute and store, in the order of the model.
    accuracy : float or None
        Relative error allowed for the outputs.
    store : str
        Path (relative to the working directory) or URL of the store.
    blocks : mapping of str to int
        Lengths of chunks that the file sets, by dimension. All other lengths are chosen automatically.
    text, source : str
        Text of the campaign file, and its path.
    remarks : tuple of str
        Questions about numbers without a unit that are far from the usual values, each with its position in the file.
    measured : DataFile or None
        Table of measured values of an output, for the fit ``calibration``. None if the campaign has no table.
    """

    name: str
    model: str
    seed: int
    replication: Replication
    series: tuple[Series, ...]
    outputs: tuple[str, ...]
    accuracy: float | None
    store: str
    blocks: Mapping[str, int]
    text: str
    source: str
    remarks: tuple[str, ...] = ()
    measured: DataFile | None = None
