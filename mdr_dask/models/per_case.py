"""The function `compute` of a model, made from a function that solves one case."""

from __future__ import annotations

import os
import reprlib
import signal
import threading
import traceback
from collections.abc import Callable, Mapping
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mdr_dask.arrays import random_stream
from mdr_dask.models.base import Block, Result, Status

#: Longest time in s for the solution of one case, or None for no limit. After this time, the alarm signal SIGALRM is
#: sent to this process. A process that sets a limit must also set a handler that raises TimeoutError, as
#: `mdr_dask.execute.children` does.
time_limit: float | None = None

#: Folder of the package mdr_dask.
PACKAGE = f"{Path(__file__).parents[1]}{os.sep}"

Solve = Callable[[Any, np.random.Generator], Mapping[str, ArrayLike]]


def per_case(solve: Solve) -> Callable[[Block[Any]], Result]:
    """Return a function for ``Model(compute=...)`` that solves the cases of a block one after another.

    `solve` receives the parameters of one case in SI units and a random generator. All cases of a realisation get the
    same random numbers. `solve` returns a mapping from the name of each output to its value. If an output has an error,
    `solve` also returns this error, as ``<output>_error``.

    A case fails if `solve` raises an exception, even SystemExit, but not if the user presses Ctrl-C. A case also fails
    if an output is missing, is not declared, is not real, does not have the declared shape, or is not finite although
    ``allow_nan`` is False. A case also fails if an error is negative.
    """

    def compute(block: Block[Any]) -> Result:
        shape = (block.cases, len(block.realisations))
        status = np.full(shape, Status.DONE, dtype=np.int8)
        found: dict[tuple[int, int], dict[str, NDArray[np.float64]]] = {}
        messages: dict[tuple[int, int], str] = {}
        further: set[str] = set()
        streams = [random_stream(block.seed, realisation) for realisation in block.realisations]
        starts = [stream.bit_generator.state for stream in streams]
        for case in range(block.cases):
            parameters = block.case(case)
            for number, (stream, start) in enumerate(zip(streams, starts, strict=True)):
                stream.bit_generator.state = start  # setting the state is much faster than making a new generator
                try:
                    outputs = _limited(solve, parameters, stream)
                    found[case, number] = {name: _output(name, outputs) for name in block.outputs}
                    further |= outputs.keys() - found[case, number].keys()
                except BaseException as error:
                    if is_interrupt(error):
                        raise
                    status[case, number] = Status.FAILED
                    messages[case, number] = reason(error) + where(error)
        # further outputs are returned without values: the task refuses those that the model does not declare
        values = dict.fromkeys(further, np.empty(0))
        values |= {name: _gathered(name, found, shape) for name in block.outputs}
        return Result(values, status, messages, solves=status.size)

    compute.is_plain_python = True  # type: ignore[attr-defined]
    compute.__wrapped__ = solve  # type: ignore[attr-defined]
    return compute


def _limited(solve: Solve, parameters: Any, random: np.random.Generator) -> Any:
    """Solve a case, and send the alarm signal to this process if the solution takes longer than the time limit."""
    if time_limit is None:
        return solve(parameters, random)
    signal.setitimer(signal.ITIMER_REAL, time_limit)
    try:
        return solve(parameters, random)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def is_interrupt(error: BaseException) -> bool:
    """Return whether an exception comes from Ctrl-C.

    Only the main thread receives Ctrl-C, and only in a process that does not ignore SIGINT. Every KeyboardInterrupt in
    such a thread counts as Ctrl-C. Any other KeyboardInterrupt was raised by the user's function.
    """
    is_main = threading.current_thread() is threading.main_thread()
    return isinstance(error, KeyboardInterrupt) and is_main and signal.getsignal(signal.SIGINT) is not signal.SIG_IGN


def reason(error: BaseException) -> str:
    """Return the type and, if there is one, the text of an exception, as the reason why a case failed."""
    try:
        text = str(error)
    except Exception:  # the method that returns the text of the exception may itself fail
        text = ""
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def where(error: BaseException) -> str:
    """Return where the user's function failed, such as `` (model.py:12)``.

    If another package raised the exception, the text names the line of the user's file that called that package. The
    text is empty if the exception was raised after the user's function returned, for example because of an invalid
    output.
    """
    frames = [(frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(error.__traceback__)]
    others = [(file, line) for file, line in frames if not file.startswith(PACKAGE)]
    own = [line for file, line in others if file == others[0][0]]
    return f" ({Path(others[0][0]).name}:{own[-1]})" if own else ""


def _output(name: str, outputs: Any) -> NDArray[np.float64]:
    if not isinstance(outputs, Mapping):
        got = "None (is the return statement missing?)" if outputs is None else type(outputs).__name__
        raise TypeError(f"expected a dictionary with a value for each output, got {got}")
    if name not in outputs:
        got = ", ".join(map(str, outputs)) or "none"
        raise ValueError(f"the output {name} is missing, got {got}")
    return real_numbers(name, outputs[name])


def real_numbers(name: str, value: Any) -> NDArray[np.float64]:
    """Return an output as an array of floating-point numbers.

    Raise ValueError if the output contains, for example, True, a text, a masked number or a quantity with a unit.
    """
    if type(value) is float:
        return np.asarray(value)
    try:
        array = None if hasattr(value, "units") or np.ma.is_masked(value) else np.asarray(value)
    except Exception:  # such as a list of lists of different lengths
        array = None
    if array is not None and array.dtype.kind == "O" and all(_is_real(item) for item in array.flat):
        array = array.astype(np.float64)
    if array is None or array.dtype.kind not in "iuf":
        raise ValueError(f"{name}: expected a real number or an array of them, in SI units, got {reprlib.repr(value)}")
    return array.astype(np.float64)


def _is_real(item: Any) -> bool:
    return isinstance(item, Real) and not isinstance(item, bool)


def _gathered(
    name: str, found: Mapping[tuple[int, int], Mapping[str, NDArray[np.float64]]], shape: tuple[int, int]
) -> NDArray[np.float64]:
    """Return one output for all cases, with NaN for failed cases. Raise ValueError if their shapes differ."""
    arrays = {place: outputs[name] for place, outputs in found.items()}
    extra = {array.shape for array in arrays.values()} or {()}
    if len(extra) > 1:
        raise ValueError(
            f"{name}: expected an array of the same shape in all cases, got {' and '.join(map(str, sorted(extra)))}"
        )
    gathered = np.full(shape + extra.pop(), np.nan)
    for place, array in arrays.items():
        gathered[place] = array
    return gathered
