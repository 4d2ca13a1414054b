"""One task: compute a block, write it whole, tell the counts."""

from __future__ import annotations

import ctypes
import os
import pickle
import platform
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask import models, store
from mdr_dask.campaign import Replication
from mdr_dask.compile_clock import compile_clock
from mdr_dask.errors import ClusterError, MachineError, MdrDaskError
from mdr_dask.models.base import Block, Model, Result, Status
from mdr_dask.replication import growth_needed, known_scatter, next_round
from mdr_dask.store import Place
from mdr_dask.version import __version__

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h
MAPPED, TRIMMED = 32 * 2**20, 128 * 2**20  # bytes: the largest that glibc allows on the heap, and a few of them


@dataclass(frozen=True)
class Rounds:
    """Rounds that a block may go through by itself: what decides them, and how many realisations it holds at most."""

    replication: Replication
    most: int


@dataclass(frozen=True)
class Work:
    """One task: everything a worker needs to compute a block and write it.

    Parameters
    ----------
    place : Place
        Where it stands in the store.
    model : str
        Name of the model.
    versions : tuple
        What the driver runs, as `versions` gives it.
    block : Block
        Its cases and realisations.
    wanted, spared : bool array, shape of the block
        Results to compute, and those to write down as not needed.
    attempt : int
        How often the block has been run, this time included.
    estimate : float
        Seconds that it should take by the model's estimate.
    rounds : Rounds, optional
        By which it goes on, if it holds the whole study.
    """

    place: Place
    model: str
    versions: tuple[str, int]
    block: Block[Any]
    wanted: NDArray[np.bool_]
    spared: NDArray[np.bool_]
    attempt: int
    estimate: float
    rounds: Rounds | None = None

    def halves(self) -> tuple[Work, ...]:
        """Return the same work as two tasks, to be run one after the other; none for a single result."""
        cells = np.flatnonzero(self.wanted)
        if cells.size < 2:
            return ()
        first = np.zeros_like(self.wanted)
        first.flat[cells[: cells.size // 2]] = True
        half = self.estimate / 2
        rest = self.wanted & ~first
        part = replace(self, estimate=half, rounds=None)
        return replace(part, wanted=first), replace(part, wanted=rest)

    def grown(self, count: int) -> Work:
        """Return the same block with so many realisations, all of them this task's."""
        *cases, realisations = self.place.region
        numbers = slice(realisations.start, realisations.start + count)
        wanted = np.ones((*self.wanted.shape[:-1], count), dtype=bool)
        return replace(
            self,
            place=replace(self.place, region=(*cases, numbers)),
            block=replace(self.block, realisations=tuple(range(numbers.start, numbers.stop))),
            wanted=wanted,
            spared=~wanted,
        )


@dataclass(frozen=True)
class Outcome:
    """What a task sends home: counts and times, never numbers of the study.

    Of the time to compute, `compile_seconds` went by while this process compiled kernels. `warned` counts the results
    that are done and have a message all the same, `further` the results of rounds that the block went on to by itself;
    it is `settled` if no case needs more.
    """

    counts: tuple[int, ...]
    solves: int
    estimate: float
    compute_seconds: float
    write_seconds: float
    compile_seconds: float = 0.0
    warned: int = 0
    further: int = 0
    settled: bool = False

    @property
    def seconds(self) -> float:
        """Time that the block kept its worker busy, compiling left out."""
        return self.compute_seconds + self.write_seconds - min(self.compile_seconds, self.compute_seconds)


def versions(model: str) -> tuple[str, int]:
    """Return what decides the numbers of a model: the versions of the program and of the model."""
    return __version__, models.load(model).version


def run_block(work: Work) -> Outcome:
    """Compute a block and write it: whole, at once, ledger last; doing it twice changes nothing.

    Raises
    ------
    ClusterError
        If this worker has another version of the program than the driver.
    StoreError
        If the store cannot be read or written.
    """
    if versions(work.model) != work.versions:
        raise ClusterError(_other_version(work))
    model = models.load(work.model)
    _one_blas_thread()
    keep_freed_memory()
    clock = compile_clock() if model.compiling else None
    compiled = clock.seconds if clock else 0.0
    started = time.perf_counter()
    if work.wanted.all():
        result = _compute(model, work.block, models.is_own(work.model))
        shape = work.wanted.shape
        values = {name: array.reshape(shape + array.shape[2:]) for name, array in result.values.items()}
        status = result.status.reshape(shape)
    else:
        kept = not (work.wanted | work.spared).all()
        values, status = store.read_block(work.place, work.block.outputs) if kept else _nothing(model, work)
        status[work.spared] = Status.NOT_NEEDED
        result = _compute_part(
            model, models.is_own(work.model), work.block, work.wanted.reshape(work.block.cases, -1), values, status
        )
    asked, settled = work, False
    if work.rounds:
        work, values, status, result, settled = _go_on(model, work, values, status, result)
    middle = time.perf_counter()
    compiled = clock.seconds - compiled if clock else 0.0
    record = _record(work, result, status, middle - started)
    _write(work, values if work.wanted.any() else {}, status, record)
    written, warned = time.perf_counter() - middle, _warned(record)
    further = work.wanted.size - asked.wanted.size
    times = work.estimate, middle - started, written, compiled
    return Outcome(_counts(work, status), result.solves, *times, warned, further, settled)


def finished(work: Work) -> Outcome | None:
    """Return how a task ended that a worker finished before it died untold; None for one that is not finished.

    The record of an attempt is written before the ledger, and holds the digest of what the ledger then is.
    """
    record = store.record(work.place.url, work.place.series, work.place.index, work.attempt)
    if record is None or not store.is_written(work.place, record):
        return None
    _, status = store.read_block(work.place, ())
    seconds, warned = record["compute_seconds"], _warned(record)
    return Outcome(_counts(work, status), record["solves"], work.estimate, seconds, 0.0, warned=warned)


def _other_version(work: Work) -> str:
    here, there = (
        f"mdr_dask {program} with {work.model} {model}" for program, model in (versions(work.model), work.versions)
    )
    return f"worker {platform.node()} has {here}, this program is {there}; install the same on both"


def _write(
    work: Work, values: dict[str, NDArray[np.float64]], status: NDArray[np.int8], record: dict[str, Any]
) -> None:
    store.write_block(work.place, work.attempt, values, status, record)


def _counts(work: Work, status: NDArray[np.int8]) -> tuple[int, ...]:
    return tuple(np.bincount(status[work.wanted | work.spared], minlength=len(Status)).tolist())


def _warned(record: Mapping[str, Any]) -> int:
    return sum(message["status"] == Status.DONE.name.lower() for message in record["messages"])


#: Faults of the machine rather than of a case: the files of the compiler's cache, a full disk, a missing library.
MACHINE_FAULTS = (OSError, EOFError, ImportError, pickle.UnpicklingError)
#: Longest message that is kept of a case.
LONGEST_MESSAGE = 1000


def _compute(model: Model[Any], block: Block[Any], is_own: bool) -> Result:
    """Call the model. If it raises for the block, compute every result by itself: only those that raise have failed.

    `is_own` says that the model is the user's own. Then any exception is a failed case, and results are checked.
    """
    is_single = block.cases == len(block.realisations) == 1
    try:
        result = model.compute(block)
        return _checked(model, block, result) if is_own else result
    except (Exception, SystemExit) as error:
        is_fault = isinstance(error, MACHINE_FAULTS) or (is_single and isinstance(error, MemoryError))
        if is_fault and not is_own and not isinstance(error, MdrDaskError):
            raise MachineError(
                f"{platform.node()} cannot compute {model.name}: {type(error).__name__}: {error}"
            ) from None
        if is_single:
            return _failed(model, block, f"{type(error).__name__}: {error}")
    parts = [
        _compute(model, block.part(case, number), is_own)
        for case in range(block.cases)
        for number in block.realisations
    ]
    return _join(block, parts)


def _checked(model: Model[Any], block: Block[Any], result: Result) -> Result:
    """Return the result of a user's own model if it has the declared shapes; a value that is not finite has failed."""
    if not isinstance(result, Result):
        raise TypeError(f"expected a Result, got {type(result).__name__}")
    shape = block.cases, len(block.realisations)
    values, status, messages = {}, np.array(result.status, dtype=np.int8), dict(result.messages)
    if status.shape != shape:
        raise ValueError(f"status: expected shape {shape}, got {status.shape}")
    for name, unknown in _unknown(model, block, shape).items():
        if name not in result.values:
            raise ValueError(f"the output {name} is missing")
        values[name] = np.array(result.values[name], dtype=np.float64)
        if values[name].shape != unknown.shape:
            expected, got = unknown.shape[2:], values[name].shape[2:]
            what = f"shape {expected}" if expected else "a number"
            raise ValueError(f"{name}: expected {what} for each case, got shape {got or values[name].shape}")
    for output in model.outputs:
        if output.name in values and not output.allow_nan:
            finite = np.isfinite(values[output.name]).reshape(*shape, -1).all(axis=-1)
            for case, number in np.argwhere(~finite & (status == Status.DONE)).tolist():
                at, what = (case, number), values[output.name][case, number]
                messages[at] = f"{output.name} is {what}" if what.ndim == 0 else f"{output.name} holds NaN or infinity"
                status[at] = Status.FAILED
    for array in values.values():
        array[status == Status.FAILED] = np.nan
    return replace(result, values=values, status=status, messages=messages)


def _unknown(model: Model[Any], block: Block[Any], shape: tuple[int, ...]) -> dict[str, NDArray[np.float64]]:
    """Return the outputs of cases without results: NaN in the declared shapes."""
    extra = model.coordinates(block.parameters)
    sizes = {name: tuple(extra[dim].values.size for dim in model.output(name).dims) for name in block.outputs}
    return {name: np.full((*shape, *size), np.nan) for name, size in sizes.items()}


def _nothing(model: Model[Any], work: Work) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int8]]:
    """Return a block without results."""
    shape = work.wanted.shape
    return _unknown(model, work.block, shape), np.full(shape, Status.MISSING, dtype=np.int8)


def _failed(model: Model[Any], block: Block[Any], message: str) -> Result:
    values = _unknown(model, block, (1, 1))
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
    is_own: bool,
    block: Block[Any],
    wanted: NDArray[np.bool_],
    values: dict[str, NDArray[np.float64]],
    status: NDArray[np.int8],
) -> Result:
    """Compute the wanted results of a block into arrays that hold the others already."""
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


def _go_on(
    model: Model[Any], work: Work, values: dict[str, NDArray[np.float64]], status: NDArray[np.int8], result: Result
) -> tuple[Work, dict[str, NDArray[np.float64]], NDArray[np.int8], Result, bool]:
    """Compute the rounds that follow, decided as between tasks, as long as the block holds them; say if all end."""
    assert work.rounds
    replication, until = work.rounds.replication, work.rounds.replication.until
    scatter = known_scatter(model, until, work.block.outputs)
    needed = np.ones(status.shape[:-1], dtype=bool)
    while True:
        count = status.shape[-1]
        within = {output: values[own] for output, own in scatter.items()}
        growth = np.where(needed, growth_needed(values, status, until, within), 0.0)
        needed = growth > 1
        further = next_round(replication, count, growth)
        if not count < further <= work.rounds.most:
            return work, values, status, result, not needed.any()
        work = work.grown(further)
        values = {name: _longer(array, status.ndim - 1, further, np.nan) for name, array in values.items()}
        status = _longer(status, status.ndim - 1, further, Status.NOT_NEEDED)
        wanted = np.zeros(status.shape, dtype=bool)
        wanted[..., count:] = needed[..., None]
        more = _compute_part(
            model, models.is_own(work.model), work.block, wanted.reshape(work.block.cases, -1), values, status
        )
        messages = {**result.messages, **more.messages}
        result = replace(result, messages=messages, solves=result.solves + more.solves)


def _longer(array: NDArray[Any], axis: int, length: int, fill: float) -> NDArray[Any]:
    """Return an array with a longer axis."""
    before = [(0, length - size if dim == axis else 0) for dim, size in enumerate(array.shape)]
    return np.pad(array, before, constant_values=fill)


def _record(work: Work, result: Result, status: NDArray[np.int8], seconds: float) -> dict[str, Any]:
    states = status.reshape(work.block.cases, -1)
    messages = [
        {
            "place": _place(work, case, number),
            "case": _describe(work.block, case),
            "realisation": work.block.realisations[number],
            "status": Status(states[case, number]).name.lower(),
            "message": text[:LONGEST_MESSAGE],
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
    """Return where a result of a block stands in the ledger."""
    region = work.place.region
    shape = [part.stop - part.start for part in region]
    inside = [int(offset) for offset in np.unravel_index(case, shape[:-1])] if len(shape) > 1 else []
    return [part.start + offset for part, offset in zip(region, [*inside, number], strict=True)]


def _describe(block: Block[Any], case: int) -> dict[str, Any]:
    columns = {path: column[case] for path, column in block.columns.items()}
    return {path: value.item() if isinstance(value, np.generic) else str(value) for path, value in columns.items()}


@lru_cache(maxsize=1)
def kind() -> str:
    """Return what the last digits of numbers may depend on: the processor, and what computes on it."""
    from importlib.metadata import version

    import scipy.linalg  # noqa: F401  (brings its own BLAS)
    from llvmlite import binding
    from numba.core import config
    from threadpoolctl import threadpool_info

    blas = sorted({str(found.get("architecture")) for found in threadpool_info() if found["user_api"] == "blas"})
    programs = [f"{name} {version(name)}" for name in ("numpy", "scipy", "numba")]
    processor = getattr(config, "CPU_NAME", None) or binding.get_host_cpu_name()
    return ", ".join([f"processor {processor}", f"BLAS for {' '.join(blas)}", *programs, f"mdr_dask {__version__}"])


@lru_cache(maxsize=1)
def _one_blas_thread() -> None:
    """Keep linear algebra to one thread in every kind of worker: same speed overall, and the same bytes."""
    import scipy.linalg  # noqa: F401  (brings its own BLAS, which has to be there to be limited)
    from threadpoolctl import threadpool_limits

    threadpool_limits(limits=1, user_api="blas")


@lru_cache(maxsize=1)
def keep_freed_memory() -> None:
    """Keep arrays of some megabytes within the process: glibc gives them back, and faults on every page the next time.

    Lines of 100000 points took a third longer with it.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if os.name == "posix" else None
    if mallopt is not None:
        mallopt(M_MMAP_THRESHOLD, MAPPED)
        mallopt(M_TRIM_THRESHOLD, TRIMMED)


def write_off(work: Work, message: str) -> Outcome:
    """Write a block down as failed without computing it, because computing it kills whoever tries."""
    _, status = store.read_block(work.place, ())
    status[work.spared] = Status.NOT_NEEDED
    status[work.wanted] = Status.FAILED
    lost = zip(*np.nonzero(work.wanted.reshape(work.block.cases, -1)), strict=True)
    result = Result({}, status, {(int(case), int(number)): message for case, number in lost})
    _write(work, {}, status, _record(work, result, status, 0.0))
    return Outcome(_counts(work, status), 0, work.estimate, 0.0, 0.0)
