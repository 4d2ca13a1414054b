"""One task: compute a block, write it whole, tell the counts."""

from __future__ import annotations

import os
import platform
import time
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask import models, store
from mdr_dask.models.base import Block, Model, Result, Status
from mdr_dask.plan import BlockIndex


@dataclass(frozen=True)
class Work:
    """One task: everything a worker needs to compute a block and write it."""

    url: str
    model: str
    series: str
    index: BlockIndex
    region: tuple[slice, ...]
    block: Block[Any]
    wanted: NDArray[np.bool_] | None
    attempt: int


@dataclass(frozen=True)
class Outcome:
    """What a task sends home: counts and times, never numbers of the study."""

    counts: tuple[int, ...]
    solves: int
    compute_seconds: float
    write_seconds: float


def run_block(work: Work) -> Outcome:
    """Compute a block and write it: whole, at once, ledger last; doing it twice changes nothing."""
    model = models.load(work.model)
    _one_blas_thread()
    started = time.perf_counter()
    shape = tuple(part.stop - part.start for part in work.region)
    if work.wanted is None:
        result = _compute(model, work.block)
        values = {name: array.reshape(shape + array.shape[2:]) for name, array in result.values.items()}
        status = result.status.reshape(shape)
        computed = np.ones(shape, dtype=bool)
    else:
        values, status = store.read_block(work.url, work.series, work.region, work.block.outputs)
        computed = work.wanted
        result = _compute_part(model, work.block, computed.reshape(work.block.cases, -1), values, status)
    middle = time.perf_counter()
    store.write_values(work.url, work.series, work.region, values)
    store.write_record(work.url, work.series, work.index, work.attempt, _record(work, result, status, middle - started))
    store.write_status(work.url, work.series, work.region, status)
    newly = computed | (status == Status.NOT_NEEDED)
    counts = np.bincount(status[newly], minlength=len(Status))
    return Outcome(tuple(counts.tolist()), result.solves, middle - started, time.perf_counter() - middle)


def _compute(model: Model[Any], block: Block[Any]) -> Result:
    """Call the model; should it raise in spite of its promise, find the case to blame by taking each alone."""
    try:
        return model.compute(block)
    except Exception as error:
        if block.cases == len(block.realisations) == 1:
            return _failed(model, block, f"{type(error).__name__}: {error}")
        parts = [
            _compute(model, block.part(case, number)) for case in range(block.cases) for number in block.realisations
        ]
        return _join(block, parts)


def _failed(model: Model[Any], block: Block[Any], message: str) -> Result:
    extra = model.coordinates(block.parameters)
    shapes = {name: tuple(extra[dim].values.size for dim in model.output(name).dims) for name in block.outputs}
    values = {name: np.full((1, 1, *shape), np.nan) for name, shape in shapes.items()}
    return Result(values, np.array([[Status.FAILED]], dtype=np.int8), {(0, 0): message})


def _join(block: Block[Any], parts: list[Result]) -> Result:
    shape = (block.cases, len(block.realisations))
    positions = list(np.ndindex(shape))
    return Result(
        values={
            name: np.stack([part.values[name][0, 0] for part in parts]).reshape(
                *shape, *parts[0].values[name].shape[2:]
            )
            for name in block.outputs
        },
        status=np.array([part.status[0, 0] for part in parts], dtype=np.int8).reshape(shape),
        messages={at: part.messages[0, 0] for at, part in zip(positions, parts, strict=True) if part.messages},
        solves=sum(part.solves for part in parts),
    )


def _compute_part(
    model: Model[Any],
    block: Block[Any],
    wanted: NDArray[np.bool_],
    values: dict[str, NDArray[np.float64]],
    status: NDArray[np.int8],
) -> Result:
    """Compute the wanted results of a block into arrays that hold the others already."""
    flat_status = status.reshape(wanted.shape)
    flat_status[~wanted & (flat_status == Status.MISSING)] = Status.NOT_NEEDED
    cases, numbers = np.flatnonzero(wanted.any(axis=1)), np.flatnonzero(wanted.any(axis=0))
    if cases.size == 0:
        return Result({}, status)
    part = replace(
        block,
        columns={path: column[cases] for path, column in block.columns.items()},
        cases=cases.size,
        realisations=tuple(block.realisations[number] for number in numbers),
    )
    result = _compute(model, part)
    inside = np.ix_(cases, numbers)
    chosen = wanted[inside]
    flat_status[inside] = np.where(chosen, result.status, flat_status[inside])
    for name, array in result.values.items():
        flat = values[name].reshape(wanted.shape + array.shape[2:])
        where = chosen.reshape(chosen.shape + (1,) * (array.ndim - 2))
        flat[inside] = np.where(where, array, flat[inside])
    messages = {
        (int(cases[case]), int(numbers[number])): text
        for (case, number), text in result.messages.items()
        if chosen[case, number]
    }
    return replace(result, messages=messages)


def _record(work: Work, result: Result, status: NDArray[np.int8], seconds: float) -> dict[str, Any]:
    states = status.reshape(work.block.cases, -1)
    messages = [
        {
            "case": _describe(work.block, case),
            "realisation": work.block.realisations[number],
            "status": Status(states[case, number]).name.lower(),
            "message": text,
        }
        for (case, number), text in result.messages.items()
    ]
    return {
        "attempt": work.attempt,
        "block": list(work.index),
        "compute_seconds": seconds,
        "finished": time.time(),
        "host": platform.node(),
        "messages": messages,
        "process": os.getpid(),
        "solves": result.solves,
    }


def _describe(block: Block[Any], case: int) -> dict[str, Any]:
    columns = {path: column[case] for path, column in block.columns.items()}
    return {path: value.item() if isinstance(value, np.generic) else str(value) for path, value in columns.items()}


@lru_cache(maxsize=1)
def _one_blas_thread() -> None:
    """Keep linear algebra to one thread in every kind of worker: same speed overall, and the same bytes."""
    import scipy.linalg  # noqa: F401  (brings its own BLAS, which has to be there to be limited)
    from threadpoolctl import threadpool_limits

    threadpool_limits(limits=1, user_api="blas")


def write_off(work: Work, message: str) -> Outcome:
    """Write a block down as failed without computing it, because computing it kills whoever tries."""
    values, status = store.read_block(work.url, work.series, work.region, work.block.outputs)
    lost = np.ones(status.shape, dtype=bool) if work.wanted is None else work.wanted
    status[lost] = Status.FAILED
    flat = status.reshape(work.block.cases, -1)
    result = Result({}, flat, dict.fromkeys(zip(*np.nonzero(lost.reshape(flat.shape)), strict=True), message))
    store.write_values(work.url, work.series, work.region, values)
    store.write_record(work.url, work.series, work.index, work.attempt, _record(work, result, status, 0.0))
    store.write_status(work.url, work.series, work.region, status)
    return Outcome(tuple(np.bincount(status[lost], minlength=len(Status)).tolist()), 0, 0.0, 0.0)
