"""Child processes of this machine that compute blocks. A block that crashes or takes too long does not end the run.

A server process imports all modules and forks the children. The driver is the process that starts the server. Each
child has a pipe to the driver, from which it reads blocks, and to which it writes the outcomes. If a child dies, the
server reports the death through the pipe of the child and forks a new child for the same pipe.
"""

from __future__ import annotations

import itertools
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from mdr_dask import models
from mdr_dask.errors import PAUSE, MachineError
from mdr_dask.task import KIND, Outcome, Work, kind, run_block, write_off

#: Code that the server process runs.
COMMAND = "import sys; from mdr_dask.execute.children import serve; serve(sys.argv[1], [int(x) for x in sys.argv[2:]])"
#: Environment variables that limit libraries for linear algebra to one thread when these libraries are imported.
BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


@dataclass(frozen=True)
class Crash:
    """The reason why a child process ended while it was computing a block."""

    why: str


@dataclass(frozen=True)
class Child:
    """The pipe to a child process, and the server that has started the child. A child computes one block at a time."""

    pipe: Connection
    server: subprocess.Popen[bytes]

    def run(self, work: Work, limit: float | None = None) -> Outcome | Crash:
        """Compute a block in the child process, with at most `limit` seconds for each result.

        At the limit, a case of a plain Python model raises TimeoutError and counts as failed. The child process is
        killed if the whole block takes `PAUSE` seconds longer than the limits of all its results together. Return a
        Crash if the child process was killed or has crashed. Raise MachineError if the server has ended. If the child
        process raises an exception, the same exception is raised here.
        """
        try:
            self.pipe.send((work, limit))
            begun = self.pipe.recv()
            if isinstance(begun, Crash):
                return begun
            if limit is not None and not self.pipe.poll(limit * np.count_nonzero(work.wanted) + PAUSE):
                os.kill(begun, signal.SIGKILL)
                self.pipe.recv()
                return Crash(f"took longer than {limit:g} s")
            reply = self.pipe.recv()
        except (EOFError, OSError):
            code = self.server.wait()  # the pipe breaks only when the server has ended
            ended = "was killed" if code < 0 else f"ended with exit code {code} (its error is printed above)"
            raise MachineError(
                f"the process that starts the workers {ended}; what is in the store is kept: run again"
            ) from None
        if isinstance(reply, Exception):
            raise reply
        assert isinstance(reply, Outcome | Crash)
        return reply


@contextmanager
def children(count: int, model: str) -> Iterator[list[Child]]:
    """Start `count` child processes for a model. At the end wait until they end; after an exception kill them."""
    pipes = [Pipe() for _ in range(count)]
    numbers = [theirs.fileno() for _, theirs in pipes]
    path = os.pathsep.join(str(Path(folder).absolute()) for folder in sys.path)
    environment = {**os.environ, **dict.fromkeys(BLAS_THREADS, "1"), "PYTHONPATH": path, KIND: kind()}
    command = [sys.executable, "-P", "-c", COMMAND, model, *map(str, numbers)]
    with subprocess.Popen(command, pass_fds=numbers, env=environment, process_group=0) as process:
        try:
            for _, theirs in pipes:
                theirs.close()
            yield [Child(ours, process) for ours, _ in pipes]
        except BaseException:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            raise
        finally:
            for ours, _ in pipes:
                ours.close()


def compute_apart(child: Child, work: Work, limit: float | None = None) -> Iterator[tuple[Work, Outcome]]:
    """Compute a block that may crash its process.

    If the process crashes or is killed at the time limit, each half of the block is computed alone. A half for which
    this happens again is halved again, down to single results. A single result that crashes the process or exceeds the
    limit is marked as failed. Yield each computed part of the block with its outcome.
    """
    pieces, attempts = [work], itertools.count(work.attempt)
    while pieces:
        piece = replace(pieces.pop(), attempt=next(attempts))
        reply = child.run(piece, limit)
        if isinstance(reply, Outcome):
            yield piece, reply
        elif halves := piece.halves():
            pieces += reversed(halves)
        else:
            yield piece, write_off(piece, reply.why)


def serve(model: str, numbers: list[int]) -> None:
    """Import the modules that blocks need, and run one child for each pipe until the driver closes the pipe."""
    # only the driver reacts to Ctrl-C
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(Exception):  # the error is reported when the first block raises it again
        models.load(model)
    pipes = [Connection(number) for number in numbers]
    served = {_fork(pipe, pipes): pipe for pipe in pipes}
    while served:
        child, status = os.wait()
        pipe = served.pop(child)
        if status == 0:
            pipe.close()
            continue
        with suppress(OSError):  # if the driver has died, sending fails, and the new child ends at once
            pipe.send(Crash(_describe(status)))
        served[_fork(pipe, pipes)] = pipe


def _fork(pipe: Connection, pipes: list[Connection]) -> int:
    """Fork a child that computes the blocks from a pipe, and return its process number."""
    child = os.fork()
    if child == 0:
        for other in pipes:
            if other is not pipe:
                other.close()
        _compute_blocks(pipe)
        os._exit(0)
    return child


def _describe(status: int) -> str:
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        memory = " (often: out of memory)" if number == signal.SIGKILL else ""
        return f"its process crashed: {signal.strsignal(number)}{memory}"
    return f"its process ended with exit code {os.WEXITSTATUS(status)}"


def _compute_blocks(pipe: Connection) -> None:
    """Compute the blocks from a pipe in this process, until the other end of the pipe is closed."""
    while True:
        try:
            request = pipe.recv_bytes()
        except EOFError:
            return
        _reply(pipe, os.getpid())
        try:
            work, limit = pickle.loads(request)
            with _limited(limit):
                reply: Any = run_block(work)
        except Exception as error:
            reply = error
        _reply(pipe, reply)


@contextmanager
def _limited(limit: float | None) -> Iterator[None]:
    """Within the context, raise TimeoutError if a case of a plain Python model takes longer than `limit` seconds."""
    from mdr_dask.models import per_case

    def alarm(_number: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"took longer than {limit:g} s")

    per_case.time_limit = limit
    if limit:
        signal.signal(signal.SIGALRM, alarm)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def _reply(pipe: Connection, content: Any) -> None:
    """Send an object to the driver; end this process if the driver has died."""
    try:
        pipe.send(content)
    except OSError:
        os._exit(0)
