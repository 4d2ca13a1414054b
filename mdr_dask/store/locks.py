"""Locks: one run per store, or the parts of a campaign side by side. Tasks of a dead run cannot write.

On a file system with locks, the operating system releases a lock however its holder ends. Elsewhere, and at URLs, a run
makes a claim instead: a file that is created only if it is missing, with a sign of life that its owner renews.

Every run passes the gate, a lock that is held for moments only. Whoever holds it can see which other runs there are. So
a part and an exclusive run never start together, and one of them lays a study out while the others wait.
"""

from __future__ import annotations

import errno
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

from mdr_dask.errors import StoreBusyError, StoreError
from mdr_dask.store.files import (
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
except ImportError:  # a system without it: runs make claims instead
    fcntl = None  # type: ignore[assignment]

#: Seconds between two signs of life of the owner of a claim, and after which a silent owner is taken for dead.
BEAT = 10.0
SILENCE = 60.0
#: How often claims are listed again when the last one disappears before it is read.
LISTINGS = 10
#: Seconds for which a lock is tried: somebody may only have looked whether it is held.
GLANCE = 0.5
#: Seconds between two tries, and after which a wait at the gate is reported.
KNOCK, PATIENCE = 0.1, 4.0
#: Errors of a file system without locks, and of one that can only be read.
NO_LOCKS = {errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP}
READ_ONLY = {errno.EACCES, errno.EPERM, errno.EROFS}

_GATE = "entrance"
_PART = "part-"

log = logging.getLogger("mdr_dask.store")


@dataclass(frozen=True)
class Lock:
    """A lock that a run holds; its tasks need it to write.

    Parameters
    ----------
    name : str
        Which lock of the study; the exclusive one has no name.
    owner : str
        Differs from one run to the next; empty for a run that may only read.
    claim : int or None
        Number of the claim, None where the operating system keeps the lock.
    begun : tuple of str
        Blocks that earlier runs began and did not end because they crashed or were killed, as `note_begun` had them.
    """

    name: str
    owner: str
    claim: int | None = None
    begun: tuple[str, ...] = ()


@dataclass(frozen=True, order=True)
class Part:
    """One of several disjoint sets of blocks, each computed by a process of its own.

    Parameters
    ----------
    number, count : int
        Which one, from 1, and of how many.
    """

    number: int
    count: int

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    @property
    def lock(self) -> str:
        """Name of its lock."""
        return f"{_PART}{self.number}-of-{self.count}"

    @classmethod
    def of(cls, position: int, count: int) -> Part:
        """Return the part that a block belongs to, by its position among all blocks.

        Blocks are dealt in turn, each turn beginning one part further on. Otherwise all blocks at one value of an axis
        that has as many of them as there are parts would belong to the same part.
        """
        return cls((position + position // count) % count + 1, count)


@contextmanager
def exclusive(url: str) -> Iterator[Lock]:
    """Lock a study for one run.

    Raises
    ------
    StoreBusyError
        If another run or a part is at work on it; the message names it.
    StoreError
        If nothing can be written there.
    """
    with ExitStack() as held:
        with gate(url):
            parts = _parts(url)
            if parts:
                raise StoreBusyError(f"{url}: {_named(parts)} running on this store; wait for them, or stop them")
            lock = held.enter_context(acquire(url))
            if lock.owner:
                begun = [block for name in _part_locks(url) for block in _remove_lock(url, name)]
                lock = replace(lock, begun=(*lock.begun, *begun))
            if lock.owner:
                sweep(url)
        yield lock


@contextmanager
def shared(url: str, part: Part) -> Iterator[Lock]:
    """Lock one part of a study, while other parts of the same number run side by side.

    Raises
    ------
    StoreBusyError
        If this part, a part of another number of parts, or an exclusive run is at work.
    StoreError
        If nothing can be written there.
    """
    with ExitStack() as held:
        with gate(url), acquire(url):
            others = _parts(url)
            unfit = [other for other in others if other == part or other.count != part.count]
            if unfit:
                raise StoreBusyError(f"{url}: {_named(unfit)} running on this store; wait for them, or stop them")
            lock = held.enter_context(acquire(url, part.lock))
            if lock.owner and not others:
                sweep(url)
        yield lock


@contextmanager
def gate(url: str) -> Iterator[None]:
    """Hold the gate of a study: meanwhile no other run starts or lays it out."""
    start, is_reported = time.monotonic(), False
    with ExitStack() as held:
        while True:
            try:
                held.enter_context(acquire(url, _GATE))
                break
            except StoreBusyError as error:
                if time.monotonic() - start > PATIENCE and not is_reported:
                    log.warning("%s; waiting until it has looked at the store", error.args[0].partition(";")[0])
                    is_reported = True
                time.sleep(KNOCK)
        yield


def at_work(url: str) -> tuple[str | None, list[Part]]:
    """Return who is at work on a study: the exclusive run if there is one, and the parts. This only reads."""
    return (_holder(url) if _is_held(url) else None), _parts(url)


@contextmanager
def acquire(url: str, name: str = "") -> Iterator[Lock]:
    """Hold a lock of a study. Where nothing can be written, it is a lock to read with.

    Parameters
    ----------
    url : str
        Path or URL of the store.
    name : str
        Which of its locks; the exclusive one has no name.

    Raises
    ------
    StoreBusyError
        If another process holds it; the message names that process.
    StoreError
        If there is no lock because of another error.
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
                log.warning("%s: no locks on this file system (%s); the run makes a claim", url, error.strerror)
            yield held.enter_context(_claimed(url, name))
        else:
            yield held.enter_context(_registered(url, name))


@contextmanager
def while_locked(url: str, lock: Lock) -> Iterator[None]:
    """Write for a run that must still hold its lock; the next run waits until this has ended.

    Raises
    ------
    StoreBusyError
        If that run has ended, or another one has taken over.
    StoreError
        If the store can only be read.
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


def note_begun(url: str, lock: Lock, begun: list[str]) -> None:
    """Write down which blocks a run has begun, for the next run in case this process crashes."""
    if lock.claim is None and local(url) is not None:
        content = "\n".join([_me(), *begun]) + "\n"
        with guarded(url, "noting a block"), _runner(url, lock).open("r+") as file:
            file.write(content)
            file.truncate()


def _lock_file(url: str, name: str = "") -> Path:
    """Return the file of a lock beside a store on this machine."""
    path = Path(url.removeprefix("file://"))
    try:
        path = path.resolve()
    except (OSError, RuntimeError, ValueError) as error:  # a link to itself, a null character
        raise StoreError(f"{url}: expected a path: {error}") from None
    return path.with_name(".".join(["", path.name, *filter(None, [name]), "lock"]))


def _locked(file: Path) -> int:
    """Return the descriptor of a lock file that is now locked and still has its name."""
    give_up = time.monotonic() + GLANCE
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
            time.sleep(GLANCE / 10)
        except OSError:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _flock(descriptor: int, shared: bool = False) -> None:
    """Take a lock of the operating system, or fail at once."""
    if fcntl is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)


def _is_held(url: str, name: str = "") -> bool:
    """Return whether somebody holds a lock, without writing anything."""
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
    """Return the parts at work."""
    numbers = (name.removeprefix(_PART).split("-of-") for name in _part_locks(url))
    known = sorted(Part(int(number), int(count)) for number, count in numbers)
    return [part for part in known if _is_held(url, part.lock)]


def _part_locks(url: str) -> list[str]:
    """Return the names of the locks of parts that have been held and not removed since."""
    names = {claim.removeprefix(CLAIMS).partition("/")[0] for claim in listed(url, CLAIMS)}
    if local(url) is not None:
        file = _lock_file(url)
        before = file.name.removesuffix("lock")
        files = (found.name for found in file.parent.glob(f"{escape(before)}*.lock"))
        names |= {found.removeprefix(before).removesuffix(".lock") for found in files}
    return [name for name in sorted(names) if re.fullmatch(rf"{_PART}\d+-of-\d+", name)]


def _named(parts: list[Part]) -> str:
    """Return the subject and the verb of a sentence about parts."""
    names = ", ".join(map(str, parts))
    return f"part {names} is" if len(parts) == 1 else f"parts {names} are"


def _busy(url: str, who: str) -> StoreBusyError:
    return StoreBusyError(f"{url}: {who} is running on this store; wait for it, or stop it")


def _holder(url: str, name: str = "") -> str:
    """Return who holds a lock that is held."""
    names = [_told(url, _claim(name, number)).get("who", "") for number in _numbers(url, name)]
    for runner in _runners(url, name) if local(url) is not None else ():
        with suppress(OSError):
            names.append(runner.read_text().partition("\n")[0])
    return next(filter(None, names), "another process")


def _me() -> str:
    return f"process {os.getpid()} on {platform.node()}"


def _runner(url: str, lock: Lock) -> Path:
    return _lock_file(url, lock.name).with_suffix(f".{lock.owner}.runner")


def _runners(url: str, name: str) -> list[Path]:
    file = _lock_file(url, name)
    return sorted(file.parent.glob(f"{escape(file.stem)}.{'[0-9a-f]' * 32}.runner"))


@contextmanager
def _registered(url: str, name: str) -> Iterator[Lock]:
    """Write who holds a lock, in a file that tasks lock together while they write; remove those of earlier holders."""
    begun: list[str] = []
    for runner in _runners(url, name):
        begun += _retire(url, runner)
    lock = Lock(name, uuid.uuid4().hex, begun=tuple(begun))
    mine = _runner(url, lock)
    with guarded(url, "locking it"):
        mine.write_text("\n".join([_me(), *begun]) + "\n")
    try:
        yield lock
    finally:
        _retire(url, mine)


def _retire(url: str, runner: Path) -> list[str]:
    """Remove the file of a run that has ended as soon as no task of it is writing; return the blocks it had begun."""
    give_up = time.monotonic() + SILENCE
    with guarded(url, "removing the file of a run"), runner.open("rb+") as file:
        while True:
            who, *begun = file.read().decode("utf-8", "replace").splitlines() or [""]
            try:
                _flock(file.fileno())
            except BlockingIOError:
                if time.monotonic() > give_up:
                    raise _busy(url, f"a task of {who or 'a run that has ended'}") from None
                time.sleep(GLANCE / 10)
                file.seek(0)
            else:
                runner.unlink(missing_ok=True)
                return begun


def _remove_lock(url: str, name: str) -> list[str]:
    """Remove the files of a lock that nobody holds; return the blocks that its last holder had begun."""
    if local(url) is None:
        return []
    begun = [block for runner in _runners(url, name) for block in _retire(url, runner)]
    _lock_file(url, name).unlink(missing_ok=True)
    return begun


def _claims(name: str) -> str:
    return f"{CLAIMS}{name or 'alone'}/"


def _claim(name: str, number: int) -> str:
    return f"{_claims(name)}{number:06d}.json"


def _life(name: str, number: int) -> str:
    return f"{_claims(name)}{number:06d}.life"


def _numbers(url: str, name: str) -> list[int]:
    claims = [claim.rpartition("/")[2] for claim in listed(url, _claims(name)) if claim.endswith(".json")]
    return [int(claim.removesuffix(".json")) for claim in claims]


@contextmanager
def _claimed(url: str, name: str) -> Iterator[Lock]:
    """Hold a claim, and give signs of life until the end."""
    owner = uuid.uuid4().hex
    number = _make_claim(url, name, owner)
    ended = threading.Event()

    def live() -> None:
        while not ended.wait(BEAT):
            with suppress(StoreError):  # the network may come back; blocks are only written while the claim is valid
                write_bytes(url, _life(name, number), json.dumps({"time": time.time()}).encode())

    alive = threading.Thread(target=live, daemon=True)
    alive.start()
    try:
        yield Lock(name, owner, number)
    finally:
        ended.set()
        alive.join()
        with suppress(StoreError):  # without a network, another run will take it over
            if _told(url, _claim(name, number)).get("owner") == owner:
                remove(url, [_claim(name, number), _life(name, number)])


def _make_claim(url: str, name: str, owner: str) -> int:
    """Make the next claim, unless the owner of the last one is alive; return its number."""
    for _ in range(LISTINGS):
        standing = _numbers(url, name)
        if not standing or not _is_alive(url, name, max(standing)):
            break
        if read_bytes(url, _claim(name, max(standing))) is not None:  # otherwise its owner has just left
            raise _busy(url, _told(url, _claim(name, max(standing))).get("who", "another process"))
    else:
        raise _busy(url, "another process")
    number = max(standing, default=0) + 1
    content = json.dumps({"owner": owner, "who": _me(), "time": time.time()}).encode()
    if not create(url, _claim(name, number), content):
        held = _told(url, _claim(name, number))
        if held.get("owner") != owner:  # we own it if only the reply to our first request was lost
            raise _busy(url, held.get("who", "another process"))
    elif not name and (not conditional(url) or create(url, _claim(name, number), content)):
        log.warning("%s: nothing keeps two runs apart here (no conditional write): start one at a time", url)
    remove(url, [old for n in standing for old in (_claim(name, n), _life(name, n))])
    return number


def _is_alive(url: str, name: str, number: int) -> bool:
    """Return whether the owner of a claim has given a sign of life: recently by its own clock, or while we wait."""
    claim = _told(url, _claim(name, number))
    last = _told(url, _life(name, number)) or claim
    if time.time() - last.get("time", 0.0) <= SILENCE:
        return True
    if not claim and read_bytes(url, _claim(name, number)) is None:
        return True  # its owner has just left, and somebody else may have come
    log.warning("%s: waiting %g s for a sign of life of %s", url, 2 * BEAT, claim.get("who", "another process"))
    time.sleep(2 * BEAT)
    return (_told(url, _life(name, number)) or claim) != last


def _told(url: str, name: str) -> dict[str, Any]:
    """Return a claim or a sign of life; nothing if its owner is writing it."""
    try:
        return read_json(url, name) or {}
    except StoreError:
        if local(url) is None:
            raise
        return {}
