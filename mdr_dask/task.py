"""One task: compute a block, write it to the store, and return the number of results in each state."""

from __future__ import annotations

import os
import pickle
import platform
import time
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask import models, store
from mdr_dask.compile_clock import compile_clock
from mdr_dask.errors import ClusterError, MachineError, MdrDaskError
from mdr_dask.models.base import Block, Model, Result, Status
from mdr_dask.models.per_case import is_interrupt, real_numbers, reason, where
from mdr_dask.store import Place
from mdr_dask.version import __version__

#: Environment variable from which child processes read the result of `kind` without importing SciPy.
KIND = "MDR_DASK_KIND_OF_MACHINE"


@dataclass(frozen=True)
class Work:
    """One task: everything that a worker needs to compute a block and to write it."""

    place: Place
    model: str
    # What `versions` returns in the process that started the run.
    versions: tuple[str, int, str | None]
    block: Block[Any]
    # Masks with the shape of the block. `wanted`: results to compute. `spared`: results to mark as not needed.
    wanted: NDArray[np.bool_]
    spared: NDArray[np.bool_]
    # Number of this attempt to compute the block or a part of it, beginning with 1. Each attempt has its own record.
    attempt: int
    operations: float

    def halves(self) -> tuple[Work, ...]:
        """Return two tasks, each with half of the wanted results, or no tasks if fewer than two results are wanted.

        The first task also marks the spared results.
        """
        cells = np.flatnonzero(self.wanted)
        if cells.size < 2:
            return ()
        first = np.zeros_like(self.wanted)
        first.flat[cells[: cells.size // 2]] = True
        half, nothing = self.operations / 2, np.zeros_like(self.spared)
        return replace(self, wanted=first, operations=half), replace(
            self, wanted=self.wanted & ~first, spared=nothing, operations=half
        )


@dataclass(frozen=True)
class Outcome:
    """The return value of a task: counts and times, but no results.

    `counts` has the number of wanted and spared results in each state of `Status`. `compile_seconds` is the part of
    `compute_seconds` in which this process compiled kernels. `warned` is the number of results that are done but have a
    warning.
    """

    counts: tuple[int, ...]
    solves: int
    operations: float
    compute_seconds: float
    write_seconds: float
    compile_seconds: float = 0.0
    warned: int = 0


def versions(model: str) -> tuple[str, int, str | None]:
    """Return the versions of the program and of the model, and a digest of the file of a user's model or None."""
    return __version__, models.load(model).version, models.imported_digest(model)


def run_block(work: Work) -> Outcome:
    """Compute the wanted results of a block and write the block.

    Raise ClusterError if the versions in this process differ from the versions in the process that started the run.
    Raise MachineError for a fault of the machine.
    """
    if versions(work.model) != work.versions:
        raise ClusterError(_other_version(work))
    model = models.load(work.model)
    is_own = models.is_own(work.model)
    clock = None if is_own else compile_clock()
    compiled = clock.seconds if clock else 0.0
    started = time.perf_counter()
    if (work.wanted | work.spared).all():
        shape = work.wanted.shape
        values, status = model.empty_arrays(work.block, shape), np.full(shape, Status.MISSING, dtype=np.int8)
    else:
        values, status = store.read_block(work.place, work.block.outputs)
    status[work.spared] = Status.NOT_NEEDED
    result = _compute_part(model, is_own, work.block, work.wanted.reshape(work.block.cases, -1), values, status)
    middle = time.perf_counter()
    compiled = clock.seconds - compiled if clock else 0.0
    record = _record(work, result, status, middle - started)
    store.write_block(work.place, work.attempt, values if work.wanted.any() else {}, status, record)
    times = work.operations, middle - started, time.perf_counter() - middle, compiled
    warned = sum(message["status"] == "done" for message in record["messages"])
    return Outcome(_counts(work, status), result.solves, *times, warned)


def _other_version(work: Work) -> str:
    here, there = (
        f"mdr_dask {program} with {work.model} {model}" + (f" (file {file})" if file else "")
        for program, model, file in (versions(work.model), work.versions)
    )
    remedy = "install the same on both, and restart the workers"
    return f"worker {platform.node()} has {here}, but the run was started with {there}; {remedy}"


def _counts(work: Work, status: NDArray[np.int8]) -> tuple[int, ...]:
    return tuple(np.bincount(status[work.wanted | work.spared], minlength=len(Status)).tolist())


#: Errors that a fault of the machine may cause, such as a full disk or a missing library.
MACHINE_FAULTS = (OSError, EOFError, ImportError, pickle.UnpicklingError)
#: Largest number of characters of a stored message. Every failed result has a message. Chosen by trial.
LONGEST_MESSAGE = 1000


def _compute(model: Model[Any], block: Block[Any], is_own: bool) -> Result:
    """Call the model for a block. If the call raises an exception, call the model again for each result alone.

    A single result for which the model raises an exception is marked as failed. A fault of the machine is different:
    MachineError is raised at once. MemoryError is such a fault only if it is raised for a single result. If the user
    wrote the model (`is_own`), faults of the machine are treated like other exceptions, and the results are checked.
    """
    is_single = block.cases == len(block.realisations) == 1
    try:
        result = model.compute(block)
        return _checked(model, block, result) if is_own else result
    except BaseException as error:
        if is_interrupt(error):
            raise
        is_fault = isinstance(error, MACHINE_FAULTS) or (is_single and isinstance(error, MemoryError))
        if is_fault and not is_own and not isinstance(error, MdrDaskError):
            raise MachineError(
                f"{platform.node()} cannot compute {model.name}: {type(error).__name__}: {error}"
            ) from None
        if is_single:
            message = reason(error) + (where(error) if is_own else "")
            status = np.full((1, 1), Status.FAILED, dtype=np.int8)
            return Result(model.empty_arrays(block, (1, 1)), status, {(0, 0): message})
    parts = [
        _compute(model, block.part(case, number), is_own)
        for case in range(block.cases)
        for number in block.realisations
    ]
    return _join(block, parts)


def _checked(model: Model[Any], block: Block[Any], result: Result) -> Result:
    """Return the result of a model that the user wrote. Results with invalid values are marked as failed.

    Raise TypeError if the model does not return a `Result`. Raise ValueError if the status is invalid, or a key of a
    message. Unless all results have failed, also raise ValueError if a requested output is missing, or an output is not
    declared, does not contain real numbers, or does not have the declared shape.
    """
    if not isinstance(result, Result):
        raise TypeError(f"expected a Result, got {type(result).__name__}")
    shape = block.cases, len(block.realisations)
    unknown, values = model.empty_arrays(block, shape), {}
    status, messages = np.array(result.status), dict(result.messages)
    if status.shape != shape or not np.isin(status, (Status.DONE, Status.NOT_CONVERGED, Status.FAILED)).all():
        raise ValueError(f"status: expected DONE, NOT_CONVERGED or FAILED in shape {shape}, got {status}")
    if not messages.keys() <= set(np.ndindex(shape)):
        raise ValueError(f"messages: expected keys (case, realisation) within the shape {shape}, got {list(messages)}")
    status = status.astype(np.int8)
    result = replace(result, status=status, messages=messages, solves=int(result.solves))
    if (status == Status.FAILED).all():
        return replace(result, values=unknown)
    _require_declared(model, block, result)
    for name, empty in unknown.items():
        values[name] = real_numbers(name, result.values[name])
        if values[name].shape != empty.shape:
            expected, got = empty.shape[2:], values[name].shape[2:]
            what = f"shape {expected}" if expected else "a number"
            raise ValueError(f"{name}: expected {what} for each case, got shape {got or values[name].shape}")
    errors = {output.name for output in model.companions.values()} | {output.scatter for output in model.outputs}
    for name, array in values.items():
        flat = array.reshape(*shape, -1)
        bad = flat < 0 if name in errors else np.zeros(flat.shape, dtype=bool)
        if not model.output(name).allow_nan:
            bad |= ~np.isfinite(flat)
        for case, number in np.argwhere(bad.any(axis=-1) & (status == Status.DONE)).tolist():
            got = flat[case, number][bad[case, number]][0]
            what = "at least 0" if got < 0 and name in errors else "a finite number"
            messages[case, number] = f"{name}: expected {what}, got {got:g}"
            status[case, number] = Status.FAILED
    for array in values.values():
        array[status == Status.FAILED] = np.nan
    return replace(result, values=values)


def _require_declared(model: Model[Any], block: Block[Any], result: Result) -> None:
    """Raise ValueError if a requested output is missing, or if an output is not declared."""
    for name in block.outputs:
        if name not in result.values:
            raise ValueError(f"the output {name!r} is missing")
    declared = {output.name for output in (*model.outputs, *model.companions.values())}
    for name in result.values.keys() - declared:
        raise ValueError(f"the output {name!r} is not declared, declared: {', '.join(sorted(declared))}")


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
    is_own: bool,
    block: Block[Any],
    wanted: NDArray[np.bool_],
    values: dict[str, NDArray[np.float64]],
    status: NDArray[np.int8],
) -> Result:
    """Compute the wanted results of a block, and insert them into the arrays `values` and `status` of the block.

    The keys of the messages in the returned result are positions in the whole block.
    """
    flat_status = status.reshape(wanted.shape)
    cases, numbers = np.flatnonzero(wanted.any(axis=1)), np.flatnonzero(wanted.any(axis=0))
    if cases.size == 0:
        return Result({}, status)
    part = replace(
        block,
        columns={path: column[cases] for path, column in block.columns.items()},
        cases=cases.size,
        realisations=tuple(block.realisations[number] for number in numbers),
    )
    result = _compute(model, part, is_own)
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
            "place": _place(work, case, number),
            "case": _describe(work.block, case),
            "realisation": work.block.realisations[number],
            "status": Status(states[case, number]).name.lower(),
            "message": " ".join(str(text).split())[:LONGEST_MESSAGE],
        }
        for (case, number), text in result.messages.items()
    ]
    return {
        "attempt": work.attempt,
        "block": list(work.place.index),
        "compute_seconds": seconds,
        "finished": time.time(),
        "host": platform.node(),
        "kind": kind(),
        "messages": messages,
        "process": os.getpid(),
        "solves": result.solves,
    }


def _place(work: Work, case: int, number: int) -> list[int]:
    """Return the position of a result in the ledger, from the indices of case and realisation in the block."""
    region = work.place.region
    shape = [part.stop - part.start for part in region]
    inside = [int(offset) for offset in np.unravel_index(case, shape[:-1])] if len(shape) > 1 else []
    return [part.start + offset for part, offset in zip(region, [*inside, number], strict=True)]


def _describe(block: Block[Any], case: int) -> dict[str, Any]:
    columns = {path: column[case] for path, column in block.columns.items()}
    return {path: value.item() if isinstance(value, np.generic) else str(value) for path, value in columns.items()}


@lru_cache(maxsize=1)
def kind() -> str:
    """Return a text with the processor and the libraries, on which the last digits of results may depend."""
    if KIND in os.environ:
        return os.environ[KIND]
    from importlib.metadata import version

    import scipy.linalg  # noqa: F401  (loads the BLAS library of SciPy)
    from llvmlite import binding
    from threadpoolctl import threadpool_info

    blas = sorted({str(found.get("architecture")) for found in threadpool_info() if found["user_api"] == "blas"})
    programs = [f"{name} {version(name)}" for name in ("numpy", "scipy", "numba")]
    processor = os.environ.get("NUMBA_CPU_NAME") or binding.get_host_cpu_name()
    return ", ".join([f"processor {processor}", f"BLAS for {' '.join(blas)}", *programs, f"mdr_dask {__version__}"])


def one_blas_thread() -> AbstractContextManager[object]:
    """Limit the libraries for linear algebra to one thread, because results could depend on the number of threads.

    The limit holds from the call until the returned context ends, or for good if it is not used as a context.
    """
    import scipy.linalg  # noqa: F401  (loads the BLAS library of SciPy, which must be loaded before it can be limited)
    from threadpoolctl import threadpool_limits

    limits: AbstractContextManager[object] = threadpool_limits(limits=1, user_api="blas")
    return limits


def write_off(work: Work, message: str) -> Outcome:
    """Mark the wanted results of a task as failed, with the given message, without computing anything.

    The spared results are marked as not needed.
    """
    _, status = store.read_block(work.place, ())
    status[work.spared] = Status.NOT_NEEDED
    status[work.wanted] = Status.FAILED
    lost = zip(*np.nonzero(work.wanted.reshape(work.block.cases, -1)), strict=True)
    result = Result({}, status, {(int(case), int(number)): message for case, number in lost})
    store.write_block(work.place, work.attempt, {}, status, _record(work, result, status, 0.0))
    return Outcome(_counts(work, status), 0, work.operations, 0.0, 0.0)
