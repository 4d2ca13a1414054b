"""The data classes of a checked campaign, with all quantities in SI units."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import LISTED
from mdr_dask.models.base import Parameters
from mdr_dask.models.data_file import DataFile

#: Number of digits to which the values of a range are rounded: a double holds 15 digits, and the last digit may contain
#: the rounding errors of `Spread.at`.
_DIGITS = sys.float_info.dig - 1
#: Two values of an axis count as equal if they agree in this number of digits, so that a study can be continued on a
#: machine that rounds the 14th digit differently.
SAME_DIGITS = 12


@dataclass(frozen=True)
class Spread:
    """An interval of values, on a logarithmic scale if `geometric` is true and on a linear scale otherwise.

    `low` may be larger than `high`. If `whole` is true, the values are rounded to whole numbers.
    """

    low: float
    high: float
    geometric: bool
    whole: bool

    def at(self, shares: Any) -> list[float]:
        """Return the rounded value (see `tidy`) at each fraction of the interval: 0 gives `low`, 1 gives `high`."""
        if self.geometric:
            values = self.low * (self.high / self.low) ** shares
        else:
            values = self.low + (self.high - self.low) * shares
        values = np.clip(values, min(self.low, self.high), max(self.low, self.high))
        return [tidy(value, self.whole) for value in values]

    def shares(self, values: Any) -> FloatArray:
        """Return the position of each value as a fraction of the interval (the inverse of `at`)."""
        numbers = np.asarray(values, dtype=np.float64)
        if self.geometric:
            found: FloatArray = np.log(numbers / self.low) / np.log(self.high / self.low)
        else:
            found = (numbers - self.low) / (self.high - self.low)
        return found


def tidy(value: float, whole: bool, exact: bool = False) -> float:
    """Round a number to a whole number if `whole` is true. Otherwise round to 14 digits, unless `exact` is true."""
    if whole:
        return round(value)
    return float(value) if exact else float(f"{value:.{_DIGITS}g}")


@dataclass(frozen=True)
class Axis:
    """One varied parameter."""

    # Dotted path in the model's parameters (``velocity``, ``indenter.angle``).
    path: str
    # Name of the coordinate in the store: the path, in which ``_`` replaces ``.``.
    name: str
    # Dimension of the axis in the store: `name` in a grid, and ``case`` if parameters vary together.
    dim: str
    # Checked values in SI, in the order of the file: numbers, names, or whole parameter sets.
    values: tuple[Any, ...]
    # Names of the values in the store if the values are not numbers. None for numbers.
    labels: tuple[str, ...] | None
    # SI unit, ``"1"`` for pure numbers. None if the values are not numbers.
    unit: str | None
    long_name: str
    # None if the axis is not adaptive.
    refinement: Refinement | None = None

    @property
    def some(self) -> list[Any]:
        """The values for checks and notes: all values or, of many numbers, the smallest and the largest."""
        is_short = self.labels is not None or len(self.values) <= LISTED
        return list(self.values) if is_short else [min(self.values), max(self.values)]


@dataclass(frozen=True)
class Series:
    """The parameters and the axes of one series of a campaign. Each series is one group of the store."""

    # Name of the Zarr group; empty in a campaign without series.
    name: str
    # All parameters of the model. Each varied parameter is set to the first value of its axis.
    parameters: Parameters
    axes: tuple[Axis, ...]

    @property
    def sizes(self) -> dict[str, int]:
        """Length of each dimension, in the order of the axes."""
        return {axis.dim: len(axis.values) for axis in self.axes}


@dataclass(frozen=True)
class Tolerance:
    """The largest accepted relative error and the largest accepted absolute error.

    An error is accepted if it is within at least one of these two limits.
    """

    relative: float = 0.0
    absolute: float = 0.0


@dataclass(frozen=True)
class Refinement:
    """The rule by which a study chooses the values of an adaptive axis."""

    # The interval of the axis and its scale, linear or logarithmic. Outputs are interpolated on this scale of the axis.
    spread: Spread
    # Largest interpolation error of each output. A relative error refers to the largest absolute value along the axis.
    until: Mapping[str, Tolerance]
    # Largest number of values of the axis, for each combination of values of the non-adaptive axes.
    at_most: int


@dataclass(frozen=True)
class Replication:
    """The least and the largest number of realisations of a case, and the tolerances that decide between them."""

    # Number of realisations in the first round, and largest number of realisations in all rounds together.
    at_least: int
    at_most: int
    # Largest accepted standard error of the mean of each output.
    until: Mapping[str, Tolerance]

    @property
    def goes_on(self) -> bool:
        """Whether a second round of realisations may follow the first."""
        return bool(self.until)


@dataclass(frozen=True)
class Campaign:
    """A campaign file after all checks."""

    name: str
    model: str
    seed: int
    replication: Replication
    series: tuple[Series, ...]
    # The outputs to compute and store, in the order in which the model declares them. Each output is followed by its
    # companion, unless the campaign has ``errors: false``.
    outputs: tuple[str, ...]
    # Largest accepted discretisation error of every output, relative to its value. None if the file sets no accuracy.
    accuracy: float | None
    # Path (relative to the working directory) or URL of the store.
    store: str
    # Lengths of chunks that the campaign file sets, by dimension.
    blocks: Mapping[str, int]
    text: str
    source: str
    # Questions about numbers without a unit, and notes about unused columns of a table of cases.
    remarks: tuple[str, ...] = ()
    # Table of measured values of an output, for the fit ``calibration``.
    measured: DataFile | None = None
    # Notes on this table, such as the rows outside the ranges of the study.
    measured_notes: tuple[str, ...] = ()
    # Unit of each parameter as written in the campaign file, see `written.units_in`.
    written_units: Mapping[str, str] = field(default_factory=dict)
