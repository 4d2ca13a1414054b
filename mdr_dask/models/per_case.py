"""A function of one case as the `compute` of a model: the short way to a model of one's own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.models.base import Block, Result, Status

Solve = Callable[[Any, np.random.Generator], Mapping[str, ArrayLike]]


def per_case(solve: Solve) -> Callable[[Block[Any]], Result]:
    """Return a function for ``Model(compute=...)`` that solves every case of a block by itself.

    Parameters
    ----------
    solve : callable, (parameters, random generator) -> mapping of output to number or array
        Takes the parameters of one case, in SI, and a stream of random numbers of its realisation, the same for all
        cases. Returns every output of the model by name, and the error of an output that has one as
        ``<output>_error``. What it raises is the reason why the case failed.

    Notes
    -----
    Where no case of a block succeeds, the last reason is raised: the runner then takes the cases one by one, and knows
    the shapes of outputs that have dimensions of their own.
    """

    def compute(block: Block[Any]) -> Result:
        shape = (block.cases, len(block.realisations))
        status = np.full(shape, Status.DONE, dtype=np.int8)
        found: dict[tuple[int, int], Mapping[str, ArrayLike]] = {}
        messages: dict[tuple[int, int], str] = {}
        for case in range(block.cases):
            for number, realisation in enumerate(block.realisations):
                try:
                    found[case, number] = solve(block.case(case), _stream(block.seed, realisation))
                except Exception as error:
                    if not found and (case, number) == (block.cases - 1, len(block.realisations) - 1):
                        raise
                    status[case, number] = Status.FAILED
                    messages[case, number] = f"{type(error).__name__}: {error}"
        values = {name: _gathered(name, found, shape) for name in block.outputs}
        return Result(values, status, messages, solves=status.size)

    return compute


def _stream(seed: int, realisation: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(realisation,))))


def _gathered(
    name: str, found: Mapping[tuple[int, int], Mapping[str, ArrayLike]], shape: tuple[int, int]
) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return one output of all cases, NaN where a case failed."""
    arrays = {place: np.asarray(outputs[name], dtype=np.float64) for place, outputs in found.items()}
    extra = next((array.shape for array in arrays.values()), ())
    gathered = np.full(shape + extra, np.nan)
    for place, array in arrays.items():
        gathered[place] = array
    return gathered
