"""Who may write: one runner of a study at a time, and nobody on behalf of a runner that is gone.

On a file system with locks the operating system lets go of a lock however its holder ends. Elsewhere, and at URLs, a
claim takes its place: an object that is made only if it is missing, beside signs of life that its owner gives.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import platform
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
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
    write_bytes,
)

try:
    import fcntl
except ImportError:  # a system without it: claims are held instead
    fcntl = None  # type: ignore[assignment]

#: Seconds between two signs of life of the owner of a claim, and after which a silent one counts as gone.
BEAT = 10.0
SILENCE = 60.0
#: How often claims are listed again when the last one is gone before it is read.
LISTINGS = 10
#: What a file system without locks answers.
NO_LOCKS = {errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP}

log = logging.getLogger("mdr_dask.store")


@dataclass(frozen=True)
class Hold:
    """One of the locks of a study, held by a runner: what its tasks need to know to write on its behalf.

    Parameters
    ----------
    name : str
        Which lock; that of a runner alone has no name.
    owner : str
        Differs from one runner to the next.
    claim : int or None
        Number of the claim that stands for the lock, None where the operating system has one.
    """

    name: str
    owner: str
    claim: int | None = None


@contextmanager
def lock(url: str, name: str = "") -> Iterator[Hold]:
    """Hold a lock of a study for one runner.

    Parameters
    ----------
    url : str
        Path or URL of the store.
    name : str
        Which of its locks; that of a runner alone has no name.

    Raises
    ------
    StoreBusyError
        If another process holds it; the message names that process.
    StoreError
        If nothing can be written there.
    """
    if local(url) is None:
        with _claimed(url, name) as hold:
            yield hold
        return
    file = lock_file(url, name)
    with ExitStack() as held:
        try:
            held.callback(os.close, _locked(url, file))
        except BlockingIOError:
            raise _busy(url, holder(url, name)) from None
        except OSError as error:
            if error.errno not in NO_LOCKS:
                raise StoreError(f"{url}: locking it failed: {error.strerror}") from None
            if not name:
                log.warning(
                    "%s: this file system has no locks (%s); claims in the store do instead", url, error.strerror
                )
            yield held.enter_context(_claimed(url, name))
        else:
            yield held.enter_context(_registered(url, name))


@contextmanager
def holding(url: str, hold: Hold) -> Iterator[None]:
    """Write on behalf of a runner, who must still hold the study; the next one waits for what has begun.

    Raises
    ------
    StoreBusyError
        If that runner has ended, or another one has taken over.
    """
    gone = StoreBusyError(f"{url}: the run that asked for this block has ended or lost the store; nothing was written")
    if hold.claim is not None:
        if (read_json(url, _claim(hold.name, hold.claim)) or {}).get("owner") != hold.owner:
            raise gone
        yield
        return
    try:
        descriptor = os.open(_runner(url, hold), os.O_RDONLY)
    except FileNotFoundError:
        raise gone from None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH)
        if os.fstat(descriptor).st_nlink == 0:
            raise gone
        yield
    finally:
        os.close(descriptor)


def lock_file(url: str, name: str = "") -> Path:
    """Return the file of a lock beside a store on this machine."""
    path = Path(url.removeprefix("file://"))
    try:
        path = path.resolve()
    except (OSError, RuntimeError, ValueError) as error:  # a link to itself, a null character
        raise StoreError(f"{url}: expected a path: {error}") from None
    return path.with_name(".".join(["", path.name, *filter(None, [name]), "lock"]))


def lock_names(url: str) -> list[str]:
    """Return the names of all locks of a study that have been held and not forgotten since."""
    claims = {claim.removeprefix(CLAIMS).partition("/")[0] for claim in listed(url, CLAIMS)}
    if local(url) is None:
        return sorted(claims)
    file = lock_file(url)
    inside = file.name.removesuffix("lock")
    files = (found.name for found in file.parent.glob(f"{escape(inside)}*.lock"))
    return sorted({found.removeprefix(inside).removesuffix(".lock") for found in files} | claims)


def is_known(url: str) -> bool:
    """Say whether anybody has ever been at work on a study from here."""
    return bool(listed(url, CLAIMS)) if local(url) is None else lock_file(url).exists()


def forget(url: str, name: str) -> None:
    """Remove what a lock has left that nobody holds, as soon as no task is in the middle of writing."""
    if local(url) is not None:
        for runner in _runners(url, name):
            _retire(url, runner)
        lock_file(url, name).unlink(missing_ok=True)


def holder(url: str, name: str = "") -> str:
    """Return who holds a lock that is held."""
    told = [_told(url, claim).get("who", "") for claim in _standing(url, name)]
    for runner in _runners(url, name) if local(url) is not None else ():
        with suppress(OSError):
            told.append(runner.read_text())
    return next(filter(None, told), "another process")


def _locked(url: str, file: Path) -> int:
    """Return the descriptor of a file that is now locked, and that nobody has taken away meanwhile."""
    while True:
        with guarded(url, "making it"):
            if not file.parent.exists():
                file.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _flock(descriptor)
            if os.fstat(descriptor).st_nlink:
                return descriptor
        except OSError:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _flock(descriptor: int) -> None:
    """Take a lock of the operating system for oneself, or fail at once."""
    if fcntl is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _busy(url: str, who: str) -> StoreBusyError:
    return StoreBusyError(f"{url}: {who} is running on this store; wait for it, or stop it")


def _me() -> str:
    return f"process {os.getpid()} on {platform.node()}"


def _runner(url: str, hold: Hold) -> Path:
    return lock_file(url, hold.name).with_suffix(f".{hold.owner}.runner")


def _runners(url: str, name: str) -> list[Path]:
    file = lock_file(url, name)
    return sorted(file.parent.glob(f"{escape(file.stem)}.{'[0-9a-f]' * 32}.runner"))


@contextmanager
def _registered(url: str, name: str) -> Iterator[Hold]:
    """Say who holds a lock, in a file that tasks hold together while they write; remove those of holders before."""
    hold = Hold(name, uuid.uuid4().hex)
    for runner in _runners(url, name):
        _retire(url, runner)
    mine = _runner(url, hold)
    with guarded(url, "making it"):
        mine.write_text(_me())
    try:
        yield hold
    finally:
        _retire(url, mine)


def _retire(url: str, runner: Path) -> None:
    """Remove the file of a runner that has ended, as soon as no task of it is in the middle of writing."""
    patience = time.monotonic() + SILENCE
    with guarded(url, "removing the file of a runner"), runner.open("rb+") as file:
        while True:
            try:
                _flock(file.fileno())
            except BlockingIOError:
                if time.monotonic() > patience:
                    raise _busy(url, f"a task of {runner.read_text() or 'a run that has ended'}") from None
                time.sleep(0.05)
            else:
                runner.unlink(missing_ok=True)
                return


def _claims(name: str) -> str:
    return f"{CLAIMS}{name or 'alone'}/"


def _claim(name: str, number: int) -> str:
    return f"{_claims(name)}{number:06d}.json"


def _standing(url: str, name: str) -> list[str]:
    return [claim for claim in listed(url, _claims(name)) if claim.endswith(".json")]


def _life(name: str, number: int) -> str:
    return f"{_claims(name)}{number:06d}.life"


@contextmanager
def _claimed(url: str, name: str) -> Iterator[Hold]:
    """Hold a claim, and give signs of life until the end."""
    owner = uuid.uuid4().hex
    number = _stake(url, name, owner)
    ended = threading.Event()

    def live() -> None:
        while not ended.wait(BEAT):
            with suppress(StoreError):  # the network may come back; blocks are only written while the claim stands
                write_bytes(url, _life(name, number), json.dumps({"time": time.time()}).encode())

    alive = threading.Thread(target=live, daemon=True)
    alive.start()
    try:
        yield Hold(name, owner, number)
    finally:
        ended.set()
        alive.join()
        with suppress(StoreError):  # without a network it will be taken over
            if _told(url, _claim(name, number)).get("owner") == owner:
                remove(url, [_claim(name, number), _life(name, number)])


def _stake(url: str, name: str, owner: str) -> int:
    """Make the next claim, unless the owner of the last one is alive; return its number."""
    for _ in range(LISTINGS):
        standing = _numbers(url, name)
        if not standing or _is_silent(url, name, max(standing)):
            break
    else:
        raise _busy(url, "another process")
    number = max(standing, default=0) + 1
    content = json.dumps({"owner": owner, "who": _me(), "time": time.time()}).encode()
    if not create(url, _claim(name, number), content):
        held = _told(url, _claim(name, number))
        if held.get("owner") != owner:  # it is ours where the answer to the first try was lost
            raise _busy(url, held.get("who", "another process"))
    elif not name and (not conditional(url) or create(url, _claim(name, number), content)):
        log.warning("%s: nothing here keeps two runs apart (no conditional write): start one at a time", url)
    remove(url, [old for n in standing for old in (_claim(name, n), _life(name, n))])
    return number


def _numbers(url: str, name: str) -> list[int]:
    return [int(claim.rpartition("/")[2].removesuffix(".json")) for claim in _standing(url, name)]


def _is_silent(url: str, name: str, number: int) -> bool:
    """Refuse if the owner of a claim has given a sign of life, by its own clock or while we wait for one.

    False if the claim is gone: its owner has just left, and somebody else may have come.
    """
    claim = _told(url, _claim(name, number))
    if not claim and read_bytes(url, _claim(name, number)) is None:
        return False
    last = _told(url, _life(name, number)) or claim
    if time.time() - last.get("time", 0.0) > SILENCE:
        log.warning("%s: waiting %g s for a sign of life of %s", url, 2 * BEAT, claim.get("who", "another process"))
        time.sleep(2 * BEAT)
        if (_told(url, _life(name, number)) or claim) == last:
            return True
    raise _busy(url, claim.get("who", "another process"))


def _told(url: str, document: str) -> dict[str, Any]:
    """Read a claim or a sign of life; on a disk its maker may be in the middle of writing it."""
    try:
        return read_json(url, document) or {}
    except StoreError:
        if local(url) is None:
            raise
        return {}
