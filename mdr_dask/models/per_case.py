"""Make the `compute` of a model from a function that solves one case: the short way to your own model."""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mdr_dask.models.base import Block, Result, Status

#: Seconds after which a case raises TimeoutError, in a process that has set an alarm for it.
time_limit: float | None = None

Solve = Callable[[Any, np.random.Generator], Mapping[str, ArrayLike]]


def per_case(solve: Solve) -> Callable[[Block[Any]], Result]:
    """Return a function for ``Model(compute=...)`` that solves the cases of a block one after the other.

    Parameters
    ----------
    solve : callable, (parameters, random generator) -> mapping of output to number or array
        Takes the parameters of one case, in SI, and the random numbers of a realisation, the same for all cases.
        Returns every output of the model by name, and the error of an output that has one as ``<output>_error``.
        A case has failed if `solve` raises an exception or calls ``sys.exit``, or if an output is missing or None,
        is not finite (unless declared with ``allow_nan=True``) or has another shape than declared.

    Notes
    -----
    If no case of a block succeeds, or if the outputs of two cases differ in shape, the function raises. The runner then
    computes the cases one by one and compares each with the declared shapes.
    """

    def compute(block: Block[Any]) -> Result:
        shape = (block.cases, len(block.realisations))
        status = np.full(shape, Status.DONE, dtype=np.int8)
        found: dict[tuple[int, int], dict[str, NDArray[np.float64]]] = {}
        messages: dict[tuple[int, int], str] = {}
        failure: BaseException | None = None
        for case in range(block.cases):
            parameters = block.case(case)
            for number, realisation in enumerate(block.realisations):
                if time_limit:
                    signal.setitimer(signal.ITIMER_REAL, time_limit)
                try:
                    outputs = solve(parameters, _stream(block.seed, realisation))
                    found[case, number] = {name: _array(name, outputs) for name in block.outputs}
                except (Exception, SystemExit) as error:
                    failure = error
                    status[case, number] = Status.FAILED
                    messages[case, number] = f"{type(error).__name__}: {error}"
        if failure and not found:
            raise failure
        values = {name: _gathered(name, found, shape) for name in block.outputs}
        return Result(values, status, messages, solves=status.size)

    compute.is_plain_python = True  # type: ignore[attr-defined]
    return compute


def _stream(seed: int, realisation: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(realisation,))))


def _array(name: str, outputs: Mapping[str, ArrayLike]) -> NDArray[np.float64]:
    if name not in outputs:
        raise ValueError(f"the output {name} is missing")
    value = outputs[name]
    if value is None or np.ma.is_masked(value):
        raise ValueError(f"{name} is {'None' if value is None else 'masked'}")
    return np.asarray(value, dtype=np.float64)


def _gathered(
    name: str, found: Mapping[tuple[int, int], Mapping[str, NDArray[np.float64]]], shape: tuple[int, int]
) -> NDArray[np.float64]:
    """Return one output of all cases, NaN where a case failed."""
    arrays = {place: outputs[name] for place, outputs in found.items()}
    extra = {array.shape for array in arrays.values()}
    if len(extra) > 1:
        raise ValueError(f"{name}: expected one shape for all cases, got {' and '.join(map(str, sorted(extra)))}")
    gathered = np.full(shape + extra.pop(), np.nan)
    for place, array in arrays.items():
        gathered[place] = array
    return gathered
