"""Locks: a store is used by one exclusive run, or by several parts of a campaign at the same time.

If the file system has locks, the operating system releases the locks of a process when the process ends. On other file
systems, and at URLs, a run creates a file in the store, called a claim, which only one process can create. The run then
writes a second file, the heartbeat, at regular intervals. A run also holds a lock named the gate while it searches for
active runs or lays out the study.
"""

from __future__ import annotations

import errno
import itertools
import json
import logging
import os
import platform
import re
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from glob import escape
from pathlib import Path
from typing import Any

from mdr_dask.errors import LOOK, PAUSE, StoreBusyError, StoreError
from mdr_dask.store.files import (
    BEAT,
    CLAIMS,
    conditional,
    create,
    guarded,
    listed,
    local,
    read_bytes,
    read_json,
    remove,
    sweep,
    write_bytes,
)

try:
    import fcntl
except ImportError:  # runs then create claims instead of locks
    fcntl = None  # type: ignore[assignment]

#: Time in s between two attempts to acquire a lock. Chosen by trial.
POLL = 0.05
#: `NO_LOCKS`: error numbers of a file system without locks. `READ_ONLY`: error numbers of files that this process may
#: not write.
NO_LOCKS = {errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP}
READ_ONLY = {errno.EACCES, errno.EPERM, errno.EROFS}

_GATE = "gate"
_PART = "part-"

log = logging.getLogger("mdr_dask.store")


@dataclass(frozen=True)
class Lock:
    """A lock that a run holds while its tasks write."""

    # Name of the lock. The exclusive lock has an empty name.
    name: str
    # Unique identifier, new each time the lock is acquired. It is empty if the run can only read.
    owner: str
    # Number of the claim. None for a lock of the operating system.
    claim: int | None = None
    # Whether an earlier run crashed or was killed while holding this lock. For the exclusive
    # lock, also whether a run crashed or was killed while holding the lock of a part. Always False for a claim.
    after_crash: bool = False


@dataclass(frozen=True, order=True)
class Part:
    """One of several disjoint sets of blocks. A separate process computes each set."""

    # `number`: index of this part, beginning with 1. `count`: how many parts there are.
    number: int
    count: int

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    @property
    def lock(self) -> str:
        """Name of the lock of the part."""
        return f"{_PART}{self.number}-of-{self.count}"

    @classmethod
    def of(cls, position: int, count: int) -> Part:
        """Return the part that a block belongs to, from the position of the block among all blocks.

        With 3 parts, the blocks belong in turn to the parts 1, 2, 3, then 2, 3, 1, then 3, 1, 2, and so on. With the
        order 1, 2, 3, 1, 2, 3, each part would get only one third of an axis that is divided into 3 blocks.
        """
        return cls((position + position // count) % count + 1, count)


@contextmanager
def exclusive(url: str) -> Iterator[Lock]:
    """Lock a study for one run; raise StoreBusyError if another run or a part is active.

    Remove the temporary files, and the lock files of parts, that earlier runs have left.
    """
    with ExitStack() as held:
        with gate(url):
            parts = _parts(url)
            if parts:
                raise _busy(url, f"part {', '.join(map(str, parts))}")
            lock = held.enter_context(acquire(url))
            if lock.owner:
                for name in _part_locks(url) if local(url) is not None else ():
                    lock = replace(lock, after_crash=lock.after_crash or bool(_runners(url, name)))
                    _retire(url, name)
                    _lock_file(url, name).unlink(missing_ok=True)
                sweep(url)
        yield lock


@contextmanager
def shared(url: str, part: Part) -> Iterator[Lock]:
    """Lock one part of a study. The other parts may run at the same time.

    Raise StoreBusyError if another process runs this part, the whole study, or a part with another `count`.
    """
    with ExitStack() as held:
        with gate(url), acquire(url):
            others = _parts(url)
            unfit = [other for other in others if other == part or other.count != part.count]
            if unfit:
                raise _busy(url, f"part {', '.join(map(str, unfit))}")
            lock = held.enter_context(acquire(url, part.lock))
            if lock.owner and not others:
                sweep(url)
        yield lock


@contextmanager
def gate(url: str) -> Iterator[None]:
    """Hold the gate of a study: the lock that every run needs to start and to lay out the study.

    If another process holds the gate, wait.
    """
    start, is_reported = time.monotonic(), False
    with ExitStack() as held:
        while True:
            try:
                held.enter_context(acquire(url, _GATE))
                break
            except StoreBusyError as error:
                if time.monotonic() - start > PAUSE and not is_reported:
                    log.warning("%s; waiting until it releases the store", error.args[0].partition(";")[0])
                    is_reported = True
                time.sleep(POLL)
        yield


def at_work(url: str) -> tuple[str | None, list[Part]]:
    """Return the name of the process that runs the whole study (None without such a process), and the active parts."""
    return (_holder(url) if _is_held(url) else None), _parts(url)


def active_runs(url: str) -> list[str]:
    """Return texts that describe the active runs of a study."""
    runner, parts = at_work(url)
    found = [runner] if runner else []
    for count, alike in itertools.groupby(parts, key=lambda part: part.count):
        numbers = [part.number for part in alike]
        found.append(f"{len(numbers)} of {count} parts ({_ranges(numbers)})")
    return found


def _ranges(numbers: list[int]) -> str:
    """Return ascending numbers as a text with ranges: ``1-3, 7`` for 1, 2, 3 and 7."""
    runs = itertools.groupby(enumerate(numbers), key=lambda pair: pair[1] - pair[0])
    ends = [[number for _, number in run] for _, run in runs]
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in ends)


@contextmanager
def acquire(url: str, name: str = "") -> Iterator[Lock]:
    """Hold the lock with the given name until the context ends; raise StoreBusyError if another process has this lock.

    An empty name stands for the exclusive lock. If the store is read-only, the lock has no owner and allows only
    reading.
    """
    if local(url) is None:
        with _claimed(url, name) as lock:
            yield lock
        return
    with ExitStack() as held:
        try:
            held.callback(os.close, _locked(_lock_file(url, name)))
        except BlockingIOError:
            raise _busy(url, _holder(url, name)) from None
        except OSError as error:
            if error.errno in READ_ONLY and Path(local(url) or "").exists():
                yield Lock(name, "")
                return
            if error.errno not in NO_LOCKS:
                raise StoreError(f"{url}: locking it failed: {error.strerror}") from None
            if not name:
                log.warning(
                    "%s: no locks on this file system (%s); the run creates a lock file instead", url, error.strerror
                )
            yield held.enter_context(_claimed(url, name))
        else:
            yield held.enter_context(_registered(url, name))


@contextmanager
def while_locked(url: str, lock: Lock) -> Iterator[None]:
    """Raise StoreBusyError if a run no longer holds the given lock, and StoreError if the store can only be read.

    While the context lasts, no other run can take over a lock of the operating system. A claim is checked only when
    the context begins.
    """
    if not lock.owner:
        raise StoreError(f"{url}: the study is not finished, and nothing can be written here (permission denied)")
    ended = StoreBusyError(f"{url}: the run of this block has ended or lost its lock; nothing was written")
    if lock.claim is not None:
        if (read_json(url, _claim(lock.name, lock.claim)) or {}).get("owner") != lock.owner:
            raise ended
        yield
        return
    try:
        descriptor = os.open(_runner(url, lock), os.O_RDONLY)
    except FileNotFoundError:
        raise ended from None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH)
        if os.fstat(descriptor).st_nlink == 0:
            raise ended
        yield
    finally:
        os.close(descriptor)


def _lock_file(url: str, name: str = "") -> Path:
    """Return the path of a lock file. The file is in the folder that contains the store, not in the store."""
    path = Path(url.removeprefix("file://"))
    try:
        path = path.resolve()
    except (OSError, RuntimeError, ValueError) as error:  # the path is a link to itself, or has a null character
        raise StoreError(f"{url}: expected a path: {error}") from None
    return path.with_name(".".join(["", path.name, *filter(None, [name]), "lock"]))


def _locked(file: Path) -> int:
    """Lock a lock file and return the descriptor. If another process deletes the file, create the file again.

    If another process holds the lock, try again for `LOOK` seconds, because that process may hold the lock only for an
    instant, to check whether it is free. Then raise BlockingIOError.
    """
    give_up = time.monotonic() + LOOK
    while True:
        if not file.parent.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _flock(descriptor)
            if os.fstat(descriptor).st_nlink:
                return descriptor
        except BlockingIOError:
            if time.monotonic() > give_up:
                os.close(descriptor)
                raise
            time.sleep(POLL)
        except OSError:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _flock(descriptor: int, shared: bool = False) -> None:
    """Acquire a lock of the operating system, or raise BlockingIOError if another process holds the lock.

    Raise OSError if the operating system or the file system has no locks.
    """
    if fcntl is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)


def _is_held(url: str, name: str = "") -> bool:
    """Return whether a process holds a lock, without writing to the store."""
    standing = _numbers(url, name)
    if standing and _is_alive(url, name, max(standing)):
        return True
    if local(url) is None:
        return False
    try:
        descriptor = os.open(_lock_file(url, name), os.O_RDONLY)
    except OSError:
        return False
    try:
        _flock(descriptor, shared=True)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False


def _parts(url: str) -> list[Part]:
    numbers = (name.removeprefix(_PART).split("-of-") for name in _part_locks(url))
    known = sorted(Part(int(number), int(count)) for number, count in numbers)
    return [part for part in known if _is_held(url, part.lock)]


def _part_locks(url: str) -> list[str]:
    """Return the names of all locks of parts, held or not."""
    names = {claim.removeprefix(CLAIMS).partition("/")[0] for claim in listed(url, CLAIMS)}
    if local(url) is not None:
        file = _lock_file(url)
        before = file.name.removesuffix("lock")
        files = (found.name for found in file.parent.glob(f"{escape(before)}*.lock"))
        names |= {found.removeprefix(before).removesuffix(".lock") for found in files}
    return [name for name in sorted(names) if re.fullmatch(rf"{_PART}\d+-of-\d+", name)]


def _busy(url: str, who: str) -> StoreBusyError:
    return StoreBusyError(f"{url}: {who} is running on this store; wait for it, or stop it")


def _holder(url: str, name: str = "") -> str:
    """Return a text that names the process that holds a lock."""
    names = [_read_claim(url, _claim(name, number)).get("who") for number in sorted(_numbers(url, name), reverse=True)]
    for runner in _runners(url, name) if local(url) is not None else ():
        with suppress(OSError):
            names.append(runner.read_text())
    return next(filter(None, names), "another process")


def _this_process() -> str:
    return f"process {os.getpid()} on {platform.node()}"


def _runner(url: str, lock: Lock) -> Path:
    return _lock_file(url, lock.name).with_suffix(f".{lock.owner}.runner")


def _runners(url: str, name: str) -> list[Path]:
    file = _lock_file(url, name)
    return sorted(file.parent.glob(f"{escape(file.stem)}.{'[0-9a-f]' * 32}.runner"))


@contextmanager
def _registered(url: str, name: str) -> Iterator[Lock]:
    """Write the runner file of a lock, and remove older runner files of the lock. A runner file names the process.

    A task that writes holds a shared lock on the runner file (`while_locked`).
    """
    lock = Lock(name, uuid.uuid4().hex, after_crash=bool(_runners(url, name)))
    _retire(url, name)
    with guarded(url, "locking it"):
        _runner(url, lock).write_text(_this_process())
    try:
        yield lock
    finally:
        _retire(url, name)


def _retire(url: str, name: str) -> None:
    """Remove the runner files of a lock. Before this, wait until tasks that have locked these files finish writing.

    Raise StoreBusyError if a task has not finished after twice the time `BEAT`.
    """
    give_up = time.monotonic() + 2 * BEAT
    for runner in _runners(url, name):
        with guarded(url, "removing the file of a run"), runner.open("rb+") as file:
            while True:
                try:
                    _flock(file.fileno())
                    break
                except BlockingIOError:
                    if time.monotonic() > give_up:
                        raise _busy(url, f"a task of {_holder(url, name)}") from None
                    time.sleep(POLL)
            runner.unlink(missing_ok=True)


def _claim(name: str, number: int, ending: str = "json") -> str:
    """Return the name of the file of a claim or, with the ending ``life``, of its heartbeat."""
    return f"{CLAIMS}{name or 'alone'}/{number:06d}.{ending}"


def _numbers(url: str, name: str) -> list[int]:
    folder = _claim(name, 0).rpartition("/")[0]
    return [int(Path(claim).stem) for claim in listed(url, f"{folder}/") if claim.endswith(".json")]


@contextmanager
def _claimed(url: str, name: str) -> Iterator[Lock]:
    """Hold a claim, and write heartbeats until the context ends."""
    owner = uuid.uuid4().hex
    number = _make_claim(url, name, owner)
    ended = threading.Event()

    def live() -> None:
        while not ended.wait(BEAT):
            # go on after an error: the network may come back, and blocks are written only while the claim exists
            with suppress(StoreError):
                write_bytes(url, _claim(name, number, "life"), json.dumps({"time": time.time()}).encode())

    alive = threading.Thread(target=live, daemon=True)
    alive.start()
    try:
        yield Lock(name, owner, number)
    finally:
        ended.set()
        alive.join()
        with suppress(StoreError):  # if there is no network, the next run replaces the claim
            if _read_claim(url, _claim(name, number)).get("owner") == owner:
                remove(url, [_claim(name, number), _claim(name, number, "life")])


def _make_claim(url: str, name: str, owner: str) -> int:
    """Make a claim and return its number.

    Raise StoreBusyError if the owner of the last claim is active, or if another run makes the new claim first.
    """
    standing = _numbers(url, name)
    if standing and _is_alive(url, name, max(standing)):
        raise _busy(url, _holder(url, name))
    number = max(standing, default=0) + 1
    content = json.dumps({"owner": owner, "who": _this_process(), "time": time.time()}).encode()
    if not create(url, _claim(name, number), content):
        # if only the reply of the server was lost, the claim exists and this run is its owner
        if _read_claim(url, _claim(name, number)).get("owner") != owner:
            raise _busy(url, _holder(url, name))
    elif not name and (not conditional(url) or create(url, _claim(name, number), content)):
        log.warning(
            "%s: two simultaneous runs cannot be prevented here (no conditional writes): start one run at a time", url
        )
    remove(url, [old for n in standing for old in (_claim(name, n), _claim(name, n, "life"))])
    return number


def _is_alive(url: str, name: str, number: int) -> bool:
    """Return whether the owner of a claim has recently written a heartbeat, or writes one while this function waits.

    If the claim has just been removed, return True, because another run may have started.
    """
    claim = _read_claim(url, _claim(name, number))
    last = _read_claim(url, _claim(name, number, "life")) or claim
    if time.time() - last.get("time", 0.0) <= 2 * BEAT:
        return True
    if not claim and read_bytes(url, _claim(name, number)) is None:
        return True  # the owner has just ended, and another run may have started
    log.warning("%s: waiting %g s for a heartbeat of %s", url, 2 * BEAT, claim.get("who", "another process"))
    time.sleep(2 * BEAT)
    return (_read_claim(url, _claim(name, number, "life")) or claim) != last


def _read_claim(url: str, name: str) -> dict[str, Any]:
    """Return the content of a claim or a heartbeat, or an empty dictionary if the file is missing.

    On a disk, a file that is incomplete or cannot be read counts as missing; at a URL it raises StoreError.
    """
    try:
        return read_json(url, name) or {}
    except StoreError:
        if local(url) is None:
            raise
        return {}
