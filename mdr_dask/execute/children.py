"""Compute blocks in child processes: of a model that is plain Python, may crash, or may take too long.

A helper process imports everything and forks a child, which computes one block after the other. If the child dies, the
helper reports it and forks the next one within milliseconds. The child inherits the pipes: it reads blocks and writes
outcomes itself.
"""

from __future__ import annotations

import itertools
import os
import pickle
import select
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import FrameType
from typing import Any

import numpy as np

from mdr_dask.errors import MachineError
from mdr_dask.task import Outcome, Work, one_blas_thread, run_block, write_off

#: What the helper process runs.
COMMAND = "import sys; from mdr_dask.execute.children import serve; serve(int(sys.argv[1]), int(sys.argv[2]))"
#: Seconds beyond the limit of a case before its process is killed: Python code raises an exception before.
GRACE = 1.0
#: Results of a case that must have crashed before the rest of the case is written off.
CONVICTED = 2


@dataclass(frozen=True)
class Death:
    """The end of a child process while it computed a block."""

    why: str


class Helper:
    """A helper process and its pipes; one block at a time."""

    def __init__(self) -> None:
        read, theirs = os.pipe()
        mine, write = os.pipe()
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        command = [sys.executable, "-c", COMMAND, str(mine), str(theirs)]
        self._process = subprocess.Popen(command, pass_fds=(mine, theirs), env=environment)
        self._read, self._write = read, write
        os.close(mine)
        os.close(theirs)

    def run(self, work: Work, limit: float | None = None) -> Outcome | Death:
        """Compute a block in the child; `limit` is the time in seconds for each result.

        Raises
        ------
        MdrDaskError
            What the child raised: the store cannot be written, or the machine has a fault.
        """
        _send(self._write, (work, limit))
        child = self._receive(None)
        if isinstance(child, Death):
            return child
        hard_limit = None if limit is None else limit * np.count_nonzero(work.wanted) + GRACE
        reply = self._receive(hard_limit)
        if reply is None:
            os.kill(child, signal.SIGKILL)
            self._receive(None)
            return Death(f"took longer than {limit:g} s")
        if isinstance(reply, Exception):
            raise reply
        assert isinstance(reply, Outcome | Death)
        return reply

    def _receive(self, timeout: float | None) -> Any:
        if not select.select([self._read], [], [], timeout)[0]:
            return None
        found = _take(self._read)
        if found is None:
            raise MachineError("a process that computes blocks was killed; what is in the store is kept: run again")
        return found

    def close(self) -> None:
        """End the helper and its child after the block that it computes."""
        for descriptor in (self._write, self._read):
            os.close(descriptor)
        self._process.wait()


def compute_apart(helper: Helper, work: Work, limit: float | None = None) -> Iterator[tuple[Work, Outcome]]:
    """Compute a block that may crash: by halves if it does, down to the results to blame, which have failed.

    After `CONVICTED` results of a case have crashed, its other results are written off.
    """
    pieces, attempts = [work], itertools.count(work.attempt)
    crashed: Counter[int] = Counter()
    while pieces:
        piece = replace(pieces.pop(), attempt=next(attempts))
        flat = piece.wanted.reshape(work.block.cases, -1)
        lost = np.array([crashed[case] >= CONVICTED for case in range(work.block.cases)])
        if (flat & lost[:, None]).any():
            guilty = (flat & lost[:, None]).reshape(piece.wanted.shape)
            others = piece.wanted & ~guilty
            pieces += [replace(piece, wanted=others)] * bool(others.any())
            part = replace(piece, wanted=guilty, spared=np.zeros_like(guilty))
            yield part, write_off(part, "other realisations of this case crashed")
            continue
        reply = helper.run(piece, limit)
        if isinstance(reply, Outcome):
            yield piece, reply
        elif halves := piece.halves():
            pieces += reversed(halves)
        else:
            crashed[int(np.flatnonzero(flat.any(axis=1))[0])] += 1
            yield piece, write_off(piece, reply.why)


def serve(read: int, write: int) -> None:
    """Fork a child that computes blocks, and another one whenever it dies; end when the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to all processes; the driver decides
    one_blas_thread()
    while True:
        child = os.fork()
        if child == 0:
            _compute_blocks(read, write)
            os._exit(0)
        status = os.waitpid(child, 0)[1]
        if status == 0:
            return
        _reply(write, Death(_describe(status)))


def _describe(status: int) -> str:
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        memory = " (often: out of memory)" if number == signal.SIGKILL else ""
        return f"its process crashed: {signal.strsignal(number)}{memory}"
    return f"its process ended with exit code {os.WEXITSTATUS(status)}"


def _compute_blocks(read: int, write: int) -> None:
    """Compute the blocks of a pipe in this process."""
    while (request := _take_bytes(read)) is not None:
        _reply(write, os.getpid())
        try:
            work, limit = pickle.loads(request)
            with _limited(limit):
                reply: Any = run_block(work)
        except Exception as error:
            reply = error
        _reply(write, reply)


class _limited:  # noqa: N801
    """Raise TimeoutError in a case of plain Python that takes too long."""

    def __init__(self, limit: float | None) -> None:
        self._limit = limit

    def __enter__(self) -> None:
        from mdr_dask.models import per_case

        per_case.time_limit = self._limit
        if self._limit:
            signal.signal(signal.SIGALRM, self._alarm)

    def __exit__(self, *_: object) -> None:
        signal.setitimer(signal.ITIMER_REAL, 0)

    def _alarm(self, _number: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"took longer than {self._limit:g} s")


def _send(descriptor: int, content: Any) -> None:
    data = pickle.dumps(content)
    data = len(data).to_bytes(8, "little") + data
    while data:
        data = data[os.write(descriptor, data) :]


def _reply(descriptor: int, content: Any) -> None:
    """Send something to the driver; end this process if the driver has died."""
    try:
        _send(descriptor, content)
    except BrokenPipeError:
        os._exit(0)


def _take(descriptor: int) -> Any:
    """Return what was sent through a pipe; None if its other end is closed."""
    data = _take_bytes(descriptor)
    return None if data is None else pickle.loads(data)


def _take_bytes(descriptor: int) -> bytes | None:
    length = _read(descriptor, 8)
    return None if length is None else _read(descriptor, int.from_bytes(length, "little"))


def _read(descriptor: int, count: int) -> bytes | None:
    found = b""
    while len(found) < count:
        piece = os.read(descriptor, count - len(found))
        if not piece:
            return None
        found += piece
    return found
