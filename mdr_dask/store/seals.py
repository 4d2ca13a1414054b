"""What was read once and found sound: a stamp of every chunk, so that a later look needs no contents.

A chunk whose file has still the stamp of its seal is what it was. A study that was copied has no such chunk; it is read
again, and the next run seals it.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.store.files import ROOT, group_name, read_bytes, stamps
from mdr_dask.store.records import digest

_NAME = "status/seal.json"
Contents = tuple[bytes | None, ...]


@dataclass(frozen=True)
class Chunks:
    """Where the chunks of a group lie: those of the ledger, and those of every output.

    Parameters
    ----------
    series : str
        Name of the group.
    grid, lengths : tuple of int
        Number of blocks along each dimension, and length of a block.
    further : mapping of str to int
        Number of dimensions of each array beyond those of the ledger, which comes first.
    """

    series: str
    grid: tuple[int, ...]
    lengths: tuple[int, ...]
    further: Mapping[str, int]

    @classmethod
    def of(cls, series: str, held: Mapping[str, Any]) -> Chunks:
        """Find them in the metadata of a group."""
        arrays = held["consolidated_metadata"]["metadata"]
        status = arrays["status"]
        lengths = tuple(status["chunk_grid"]["configuration"]["chunk_shape"])
        grid = tuple(math.ceil(size / length) for size, length in zip(status["shape"], lengths, strict=True))
        names = ("status", *held["attributes"]["outputs"])
        return cls(series, grid, lengths, {name: len(arrays[name]["shape"]) - len(grid) for name in names})

    def names(self, array: str) -> Iterator[str]:
        """Yield the chunks of an array, block by block."""
        prefix, suffix = group_name(self.series, f"{array}/c/"), "/0" * self.further[array]
        for place in product(*([str(i) for i in range(count)] for count in self.grid)):
            yield f"{prefix}{'/'.join(place)}{suffix}"

    def name(self, array: str, block: tuple[int, ...]) -> str:
        """Return the chunk of a block."""
        return group_name(self.series, f"{array}/c/{'/'.join(map(str, block))}{'/0' * self.further[array]}")

    def stamps(self, url: str, array: str) -> NDArray[np.int64]:
        """Return the stamps of the chunks of an array as they are now."""
        found = np.fromiter(stamps(url, self.names(array)), dtype=np.int64, count=math.prod(self.grid))
        return found.reshape(self.grid)


@dataclass(frozen=True)
class Seal:
    """Stamps of chunks that are what was written, and what the ledger then was.

    Parameters
    ----------
    series : str
        Name of the group.
    stamps : mapping of str to int64 array, shape of the grid of blocks
        Of every array, the ledger among them; 0 for a chunk that is not sealed.
    different : tuple of bytes or None
        Each different content of the ledger; the first is that of chunks that are not there.
    which : int64 array, shape of the grid of blocks
        The content of every chunk of the ledger, by its number.
    """

    series: str
    stamps: Mapping[str, NDArray[np.int64]]
    different: Contents
    which: NDArray[np.int64]

    @classmethod
    def nothing(cls, series: str, grid: tuple[int, ...]) -> Seal:
        """Return the seal of a group of which nothing is sealed."""
        return cls("" if series == ROOT else series, {}, (None,), np.zeros(grid, dtype=np.int64))

    def file(self) -> tuple[str, bytes]:
        """Return the name and the content of its file."""
        held = {
            "series": self.series,
            "arrays": list(self.stamps),
            "grid": list(self.which.shape),
            "different": [None if one is None else base64.b64encode(one).decode() for one in self.different],
            "numbers": base64.b64encode(np.stack([*self.stamps.values(), self.which]).astype("<i8").tobytes()).decode(),
        }
        text = json.dumps(held, sort_keys=True)
        return seal_name(self.series), json.dumps({**held, "digest": digest(text.encode())}, sort_keys=True).encode()

    def known(self, array: str, grid: tuple[int, ...]) -> NDArray[np.int64]:
        """Return the sealed stamps of an array, for a grid that may have grown since."""
        return _grown(self.stamps[array], grid) if array in self.stamps else np.zeros(grid, dtype=np.int64)

    def contents(self, grid: tuple[int, ...]) -> NDArray[np.int64]:
        """Return the content of every chunk of the ledger, by its number, for a grid that may have grown since."""
        return _grown(self.which, grid)


def _grown(numbers: NDArray[np.int64], grid: tuple[int, ...]) -> NDArray[np.int64]:
    found = np.zeros(grid, dtype=np.int64)
    common = tuple(map(slice, np.minimum(grid, numbers.shape)))
    found[common] = numbers[common]
    return found


def seal_name(series: str) -> str:
    """Return the name of the seal of a group."""
    return group_name(series, _NAME)


def read_seal(url: str, series: str) -> Seal | None:
    """Return the seal of a group; None if there is none, or it is not what was written."""
    content = read_bytes(url, seal_name(series))
    if content is None:
        return None
    try:
        held = json.loads(content)
        stated = held.pop("digest")
        if stated != digest(json.dumps(held, sort_keys=True).encode()):
            return None
        if held["series"] != ("" if series == ROOT else series):
            return None
        different = tuple(None if one is None else base64.b64decode(one) for one in held["different"])
        numbers = np.frombuffer(base64.b64decode(held["numbers"]), dtype="<i8")
        *each, which = numbers.reshape(len(held["arrays"]) + 1, *held["grid"])
        if different[0] is not None or which.min(initial=0) < 0 or which.max(initial=0) >= len(different):
            return None
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError):
        return None
    return Seal(held["series"], dict(zip(held["arrays"], each, strict=True)), different, which)
