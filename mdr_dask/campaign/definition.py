"""The nouns of a campaign: checked, in SI, frozen. Nothing here reads a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mdr_dask.models.base import DataFile, Parameters


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
        Dimension of the store that it lies along: its own name in a grid, ``case`` where parameters vary together.
    values : tuple
        Checked values in SI, in the order of the file: numbers, names, or whole parameter sets.
    labels : tuple of str or None
        What stands in the store for values that are not numbers.
    unit : str or None
        SI unit, ``"1"`` for pure numbers, None for names.
    long_name : str
        The parameter's meaning.
    """

    path: str
    name: str
    dim: str
    values: tuple[Any, ...]
    labels: tuple[str, ...] | None
    unit: str | None
    long_name: str


@dataclass(frozen=True)
class Series:
    """A group of the store: base parameters and the axes along which they vary.

    Parameters
    ----------
    name : str
        Name of its Zarr group; empty for a campaign without series, whose arrays stand at the root.
    parameters : Parameters
        The parameters with every axis at its first value.
    axes : tuple of Axis
        In the order of the file.
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
    """How narrow a standard error has to be: both parts zero means nothing is enough."""

    relative: float = 0.0
    absolute: float = 0.0


@dataclass(frozen=True)
class Replication:
    """How many realisations each case gets: ``at_least``, then whole rounds until every tolerance is met."""

    at_least: int
    at_most: int
    until: Mapping[str, Tolerance]


@dataclass(frozen=True)
class Campaign:
    """A campaign file after all checks.

    Parameters
    ----------
    name, model : str
        Its name and the name of its model.
    seed : int
        Seed of every random number.
    replication : Replication
        Number of realisations of each case.
    series : tuple of Series
        At least one.
    outputs : tuple of str
        The arrays to compute and store, in the order of the model.
    accuracy : float or None
        Relative error allowed for the outputs.
    store : str
        Path (relative to the working directory) or URL of the store.
    blocks : mapping of str to int
        Chunk lengths asked for by dimension; the others are chosen.
    text, source : str
        The file as written, and where it was read.
    remarks : tuple of str
        Questions about bare numbers that are far from usual, each with its place.
    measured : DataFile or None
        Table of measurements of an output, for the fit ``calibration``.
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
