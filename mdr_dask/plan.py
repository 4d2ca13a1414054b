"""Turn a campaign into templates of the arrays in the store, and into blocks to compute."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask import models
from mdr_dask.campaign import Axis, Campaign, Series
from mdr_dask.errors import CampaignError, ModelError
from mdr_dask.models.base import Block, Coordinate, Model, Output, notes_of, with_value
from mdr_dask.models.numbers import numbers_of

#: Number of operations that a block of a large study should have. Such a block takes about a second to compute, and
#: only milliseconds to schedule and write.
OPERATIONS = 1e9
#: A small study is cut into about `FEW_BLOCKS` blocks, so that several workers can share it. If possible, a block has
#: at least `LEAST` operations. Both are chosen by trial.
FEW_BLOCKS, LEAST = 16, OPERATIONS / 10
#: Blocks whose cases share a part of the computation are always halved if they need more operations than this.
#: Chosen by trial.
MOST_SHARED = 30 * OPERATIONS
#: If cases share work, blocks of at most `MOST_SHARED` operations are halved only if the operations of all blocks
#: together increase by less than this factor. Chosen by trial.
REPEATED_WORK = 1.15
#: Largest number of blocks of a series whose operations are counted; it keeps `check` fast. Chosen by trial.
SAMPLED = 1000
#: Largest number of records in one file. A file with this number of records has about a megabyte.
RECORDS_TOGETHER = 1000
#: Largest size of a chunk in bytes. A task needs memory for one chunk of each output. Chosen by trial.
CHUNK_BYTES = 64 * 2**20

BlockIndex = tuple[int, ...]


@dataclass(frozen=True)
class Template:
    """Shape, chunks and coordinates of one group of the store, before anything is computed."""

    campaign: Campaign
    series: Series
    # Length of each case dimension, then of ``realisation``.
    sizes: Mapping[str, int]
    # Length of a block along each dimension.
    chunks: Mapping[str, int]
    outputs: tuple[Output, ...]
    # Coordinates of the dimensions that outputs have in addition to the case dimensions and ``realisation``.
    extra: Mapping[str, Coordinate]

    @property
    def dims(self) -> tuple[str, ...]:
        """Case dimensions, then ``realisation``."""
        return tuple(self.sizes)

    @property
    def cases(self) -> int:
        """Number of cases."""
        return math.prod(size for dim, size in self.sizes.items() if dim != "realisation")

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of ``status``."""
        return tuple(self.sizes.values())

    @property
    def grid(self) -> tuple[int, ...]:
        """Number of blocks along each dimension."""
        return tuple(math.ceil(size / self.chunks[dim]) for dim, size in self.sizes.items())

    def extra_shape(self, output: Output) -> tuple[int, ...]:
        """Return the lengths of the dimensions that an output has in addition to `dims`."""
        return tuple(self.extra[dim].values.size for dim in output.dims)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Notes for the user on the parameters, collected for some values of every axis."""
        base = self.series.parameters
        sets = [with_value(base, axis.path, value) for axis in self.series.axes for value in axis.some] or [base]
        of_parts = [note for parameters in sets for note in notes_of(parameters)]
        return tuple(dict.fromkeys((*of_parts, *models.load(self.campaign.model).notes(sets))))

    @property
    def bytes(self) -> int:
        """Size of all arrays in bytes, before compression."""
        each = sum(8 * math.prod(self.extra_shape(output)) for output in self.outputs)
        return math.prod(self.shape) * (each + 1)

    @property
    def files(self) -> int:
        """Number of files of the group when all results are computed: chunks, coordinates, metadata and records."""
        blocks, arrays = math.prod(self.grid), len(self.outputs) + 1
        axes = {axis.name for axis in self.series.axes}
        coordinates = axes | set(self.extra) | (numbers_of(self.series.parameters).keys() - self.sizes.keys())
        return blocks * arrays + math.ceil(blocks / RECORDS_TOGETHER) + 2 * (len(coordinates) + 1) + arrays + 1

    def block_indices(self) -> Iterator[BlockIndex]:
        """Yield the indices of all blocks, beginning with the blocks of the first realisations of all cases."""
        *cases, realisations = (range(count) for count in self.grid)
        for last in realisations:
            for index in itertools.product(*cases):
                yield (*index, last)

    def region(self, index: BlockIndex) -> tuple[slice, ...]:
        """Return the slices of the arrays that a block fills."""
        return tuple(
            slice(i * self.chunks[dim], min((i + 1) * self.chunks[dim], size))
            for i, (dim, size) in zip(index, self.sizes.items(), strict=True)
        )

    def block(self, index: BlockIndex) -> Block[Any]:
        """Return a block to compute. The cases of the block are in C order of the dimensions."""
        return self._block(dict(zip(self.dims, self.region(index), strict=True)))

    def operations(self, index: BlockIndex) -> float:
        """Return the approximate number of operations of a block.

        The operations are counted for the first realisations of its cases. If the last block along ``realisation`` is
        shorter, they are reduced in proportion.
        """
        *cases, last = index
        chunk, size = self.chunks["realisation"], self.sizes["realisation"]
        first, known = (*cases, 0), self._known
        if first not in known:
            known[first] = self._operations(self.block(first))
        return known[first] * min((size - last * chunk) / min(chunk, size), 1.0)

    def _operations(self, block: Block[Any]) -> float:
        """Return the operations of a block, counted by the model or else estimated from the number of results."""
        count = models.load(self.campaign.model).operations
        if count is not None:
            return count(block)
        results = self.cases * self.campaign.replication.at_least
        return OPERATIONS * block.cases * len(block.realisations) / math.sqrt(results)

    @cached_property
    def _known(self) -> dict[Any, float]:
        return {}

    def _block(self, region: Mapping[str, slice]) -> Block[Any]:
        case_dims = self.dims[:-1]
        shape = tuple(region[dim].stop - region[dim].start for dim in case_dims)
        columns = {}
        for axis in self.series.axes:
            position = case_dims.index(axis.dim)
            along = self._values[axis.path][region[axis.dim]]
            spread = along.reshape([-1 if i == position else 1 for i in range(len(shape))])
            columns[axis.path] = np.broadcast_to(spread, shape).ravel()
        realisations = region["realisation"]
        return Block(
            parameters=self.series.parameters,
            columns=columns,
            cases=math.prod(shape),
            realisations=tuple(range(realisations.start, realisations.stop)),
            seed=self.campaign.seed,
            outputs=tuple(output.name for output in self.outputs),
            accuracy=self.campaign.accuracy,
        )

    @cached_property
    def _values(self) -> dict[str, NDArray[Any]]:
        return {axis.path: _as_array(axis) for axis in self.series.axes}

    def sample(self, chunks: Mapping[str, int], position: float) -> Block[Any]:
        """Return a block with the lengths `chunks`: at the start of the study for `position` 0, at the end for 1."""
        starts = self._starts(chunks, position)
        return self._block({dim: slice(start, start + chunks[dim]) for dim, start in starts.items()})

    def _starts(self, chunks: Mapping[str, int], position: float) -> dict[str, int]:
        return {dim: round(position * (size - chunks[dim])) for dim, size in self.sizes.items()}

    def mean_operations(self, chunks: Mapping[str, int]) -> float:
        """Return the mean number of operations of the first, the middle and the last block of the given lengths."""
        known, found = self._known, []
        for position in (0.0, 0.5, 1.0):
            key = tuple(self._starts(chunks, position).values()), tuple(chunks.values())
            if key not in known:
                known[key] = self._operations(self.sample(chunks, position))
            found.append(known[key])
        return float(np.mean(found))


def _as_array(axis: Axis) -> NDArray[Any]:
    if axis.labels is None:
        return np.array(axis.values)
    column = np.empty(len(axis.values), dtype=object)
    column[:] = axis.values
    return column


@dataclass(frozen=True)
class Estimate:
    """The costs of the first round of a campaign. ``run --dry-run`` prints these costs.

    `operations` is None if the model does not count operations. `growth` is the factor by which adaptive axes can
    increase the number of cases.
    """

    cases: int
    realisations: int
    at_most: int
    results: int
    blocks: int
    bytes: int
    operations: float | None
    files: int
    notes: tuple[str, ...]
    growth: float = 1.0

    @property
    def seconds(self) -> float | None:
        """Estimated time in s on one core (order of magnitude)."""
        return None if self.operations is None else self.operations / OPERATIONS

    @property
    def rounds(self) -> float:
        """Largest possible work of all rounds together, divided by the work of the first round."""
        return self.growth * self.at_most / self.realisations


def templates(
    campaign: Campaign, realisations: int, stored_chunks: Mapping[str, Mapping[str, int]] | None = None
) -> tuple[Template, ...]:
    """Return the template of every series.

    `stored_chunks` contains the chunk lengths of the series that are already in the store. Raise CampaignError if the
    ledger and the masks of a series do not fit into the memory. Raise ModelError if the model gives no coordinates for
    a dimension.
    """
    model = models.load(campaign.model)
    known = stored_chunks or {}
    laid_out = []
    problems = []
    for series in campaign.series:
        sizes = {**series.sizes, "realisation": realisations}
        needed, limit = 6.0 * math.prod(sizes.values()), available_memory()  # in bytes, for the ledger and five masks
        if needed > limit:
            counts = " x ".join(f"{size} {dim}" for dim, size in sizes.items())
            where = f"series.{series.name}" if series.name else "parameters"
            problems.append(
                f"{campaign.source}: {where}: {counts} results need about {needed / 2**30:.4g} GiB of memory, "
                f"but this machine has {limit / 2**30:.4g} GiB: reduce the number of results"
            )
            continue
        outputs = _outputs(campaign, series, model)
        extra = model.coordinates(series.parameters)
        lacking = [dim for output in outputs for dim in output.dims if dim not in extra]
        if lacking:
            raise ModelError(
                f"{campaign.model}: outputs have the dimension {lacking[0]!r}, whose values are not known: "
                f"give the model coordinates=lambda parameters: {{{lacking[0]!r}: Coordinate(values, unit, meaning)}}"
            )
        empty = Template(campaign, series, sizes, {}, outputs, extra)
        chunks = known.get(series.name) or _choose_chunks(empty, model)
        template = Template(campaign, series, sizes, chunks, outputs, empty.extra)
        laid_out.append(template)
    if problems:
        raise CampaignError(*problems)
    return tuple(laid_out)


def _outputs(campaign: Campaign, series: Series, model: Model[Any]) -> tuple[Output, ...]:
    units = model.units(series.parameters)
    units = units | {companion.name: units[name] for name, companion in model.companions.items() if name in units}
    wanted = [model.output(name) for name in campaign.outputs]
    return tuple(replace(output, unit=units.get(output.name, output.unit)) for output in wanted)


def available_memory() -> float:
    """Return the memory of this machine in bytes, or the limit of the control group if the limit is lower."""
    import psutil

    limits = [psutil.virtual_memory().total]
    for path in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        with suppress(OSError, ValueError):  # the file does not exist or states no limit
            limits.append(int(Path(path).read_text()))
    return float(min(limits))


def _choose_chunks(template: Template, model: Model[Any]) -> dict[str, int]:
    """Return the length of a block along each dimension.

    A block first gets all values of the axes along which cases share work. A block that is too large is halved along
    these axes. A block with few operations gets more realisations, then more values of other axes. If one block then
    contains the whole first round, it may also get realisations of later rounds. Lengths in `blocks` of the campaign
    replace the computed lengths.
    """
    shared = (
        axis.dim for path in model.whole for axis in template.series.axes if f"{axis.path}.".startswith(f"{path}.")
    )
    whole = list(dict.fromkeys(shared))
    chunks = {dim: size if dim in whole else 1 for dim, size in template.sizes.items()}
    numbers = max((math.prod(template.extra_shape(output)) for output in template.outputs), default=1)
    limit = max(1, CHUNK_BYTES // (8 * numbers))
    parts = math.prod(template.sizes.values()) / math.prod(chunks.values())
    goal = min(OPERATIONS, max(LEAST, parts * template.mean_operations(chunks) / FEW_BLOCKS))
    for dim in reversed(whole):
        while chunks[dim] > 1 and (math.prod(chunks.values()) > limit or _is_cut(template, chunks, dim, 4 * goal)):
            chunks[dim] = math.ceil(chunks[dim] / 2)

    def capacity() -> int:
        return int(min(goal / max(template.mean_operations(chunks), 1.0), limit / math.prod(chunks.values())))

    for dim in ("realisation", *reversed([dim for dim in template.dims[:-1] if dim not in whole])):
        chunks[dim] = _part(template, dim, max(1, min(template.sizes[dim], capacity())))
    replication = template.campaign.replication
    if replication.goes_on and chunks == template.sizes:
        chunks["realisation"] = max(1, min(replication.at_most, capacity() * template.sizes["realisation"]))
    return {
        **chunks,
        **{dim: min(n, template.sizes[dim]) for dim, n in template.campaign.blocks.items() if dim in template.sizes},
    }


def _is_cut(template: Template, chunks: Mapping[str, int], dim: str, most: float) -> bool:
    """Return whether to halve blocks along `dim`, a dimension along which cases share work.

    Blocks of at most `most` operations are not halved. Larger blocks are halved according to `MOST_SHARED` and
    `REPEATED_WORK`.
    """
    now = template.mean_operations(chunks)
    if now <= most or now > MOST_SHARED:
        return now > most
    half = math.ceil(chunks[dim] / 2)
    growth = template.mean_operations({**chunks, dim: half}) / now * chunks[dim] / half
    return growth < REPEATED_WORK


def _part(template: Template, dim: str, most: int) -> int:
    """Return the length of the parts if a dimension is cut into nearly equal parts of at most `most` values.

    If later rounds may follow, the number of realisations in the first round is a multiple of the length along
    ``realisation``.
    """
    size = template.sizes[dim]
    replication = template.campaign.replication
    if dim == "realisation" and replication.goes_on:
        return max(part for part in range(1, most + 1) if math.gcd(part, replication.at_least) == part)
    return math.ceil(size / math.ceil(size / most))


def estimate(campaign: Campaign) -> Estimate:
    """Return the costs of a campaign without running it; raise CampaignError if the campaign is too large to be run."""
    model, replication = models.load(campaign.model), campaign.replication
    layout = templates(campaign, replication.at_least)
    cases = sum(template.cases for template in layout)
    notes = (note for template in layout for note in template.notes)
    return Estimate(
        cases=cases,
        realisations=replication.at_least,
        at_most=replication.at_most,
        results=cases * replication.at_least,
        blocks=sum(math.prod(template.grid) for template in layout),
        bytes=sum(template.bytes for template in layout),
        operations=None if model.operations is None else sum(map(_operations, layout)),
        files=1 + sum(template.files for template in layout) + any(series.name for series in campaign.series),
        notes=tuple(dict.fromkeys((*notes, *campaign.measured_notes))),
        growth=sum(template.cases * _growth(template.series) for template in layout) / cases,
    )


def _growth(series: Series) -> float:
    """Return the factor by which the number of cases grows if all adaptive axes reach their largest length."""
    return math.prod(
        max(axis.refinement.at_most / len(axis.values), 1.0) for axis in series.axes if axis.refinement is not None
    )


def _operations(template: Template) -> float:
    """Estimate the number of operations of a series from at most `SAMPLED` of its blocks."""
    lengths, realisations = template.grid[:-1], template.sizes["realisation"]
    blocks = math.prod(lengths)
    sample = np.linspace(0, blocks - 1, min(blocks, SAMPLED)).round().astype(int)
    places = zip(*np.unravel_index(sample, lengths), strict=True) if lengths else [()]
    operations = sum(template.operations((*map(int, place), 0)) for place in places) * blocks / sample.size
    return operations * realisations / min(template.chunks["realisation"], realisations)
