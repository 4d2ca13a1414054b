"""Who may write: one runner of a study at a time, and nobody on behalf of a runner that is gone.

On a file system with locks the operating system lets go of a lock however its holder ends. Elsewhere, and at URLs, a
claim takes its place: an object that is made only if it is not there yet, beside signs of life that its owner gives.
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
from glob import escape
from pathlib import Path
from typing import Any

from mdr_dask.errors import StoreBusyError, StoreError
from mdr_dask.store.files import CLAIMS, conditional, create, guarded, local, names, read_json, remove, write_bytes

try:
    import fcntl
except ImportError:  # a system without it: claims are held instead
    fcntl = None  # type: ignore[assignment]

#: Seconds between two signs of life of the owner of a claim, and after which a silent one counts as gone.
BEAT = 10.0
SILENCE = 60.0
#: What a file system without locks answers.
NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP)

log = logging.getLogger("mdr_dask.store")


@contextmanager
def lock(url: str) -> Iterator[str]:
    """Hold a study for one runner, and yield the token under which it writes.

    Parameters
    ----------
    url : str
        Path or URL of the store.

    Raises
    ------
    StoreBusyError
        If another runner holds it; the message names that runner.
    StoreError
        If nothing can be written there.
    """
    path = local(url)
    with ExitStack() as held:
        if path is None:
            yield held.enter_context(_claimed(url))
            return
        path = _resolved(url, path)
        with guarded(url, "making it"):
            path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(path.with_name(f".{path.name}.lock"), os.O_RDWR | os.O_CREAT, 0o666)
        held.callback(os.close, descriptor)
        try:
            _flock(descriptor)
        except BlockingIOError:
            raise _busy(url, _runner_at_work(path)) from None
        except OSError as error:
            if error.errno not in NO_LOCKS:
                raise StoreError(f"{url}: locking it failed: {error.strerror}") from None
            log.warning(
                "%s: this file system has no locks (%s); a claim in the store keeps other runs out", url, error.strerror
            )
            yield held.enter_context(_claimed(url))
        else:
            yield held.enter_context(_registered(url, path))


@contextmanager
def holding(url: str, token: str) -> Iterator[None]:
    """Write on behalf of a runner, who must still hold the study; the next one waits for what has begun.

    Raises
    ------
    StoreBusyError
        If that runner has ended, or another one has taken over.
    """
    gone = StoreBusyError(f"{url}: the run that asked for this block has ended or lost the store; nothing was written")
    number, _, owner = token.rpartition("-")
    if number:
        if (read_json(url, _claim(int(number))) or {}).get("owner") != owner:
            raise gone
        yield
        return
    try:
        descriptor = os.open(_runner(_resolved(url, Path(url.removeprefix("file://"))), token), os.O_RDONLY)
    except FileNotFoundError:
        raise gone from None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH)
        if os.fstat(descriptor).st_nlink == 0:
            raise gone
        yield
    finally:
        os.close(descriptor)


def _resolved(url: str, path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError) as error:  # a link to itself, a null character
        raise StoreError(f"{url}: expected a path: {error}") from None


def _flock(descriptor: int) -> None:
    """Take a lock of the operating system for oneself, or fail at once."""
    if fcntl is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _busy(url: str, who: str) -> StoreBusyError:
    return StoreBusyError(f"{url}: {who} is running on this store; wait for it, or stop it")


def _me() -> str:
    return f"process {os.getpid()} on {platform.node()}"


def _runner(path: Path, token: str) -> Path:
    return path.with_name(f".{path.name}.{token}.runner")


def _runners(path: Path) -> list[Path]:
    return sorted(path.parent.glob(f".{escape(path.name)}.*.runner"))


def _runner_at_work(path: Path) -> str:
    for runner in _runners(path):
        with suppress(OSError):
            if told := runner.read_text():
                return told
    return "another process"


@contextmanager
def _registered(url: str, path: Path) -> Iterator[str]:
    """Say who holds the lock, in a file that tasks hold together while they write; remove those of runners before."""
    token = uuid.uuid4().hex
    for runner in _runners(path):
        _retire(url, runner)
    mine = _runner(path, token)
    with guarded(url, "making it"):
        mine.write_text(_me())
    try:
        yield token
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


def _claim(number: int) -> str:
    return f"{CLAIMS}{number:06d}.json"


def _life(number: int) -> str:
    return f"{CLAIMS}{number:06d}.life"


@contextmanager
def _claimed(url: str) -> Iterator[str]:
    """Hold a claim, and give signs of life until the end."""
    owner = uuid.uuid4().hex
    number = _stake(url, owner)
    ended = threading.Event()

    def live() -> None:
        while not ended.wait(BEAT):
            with suppress(StoreError):  # the network may come back; blocks are only written while the claim stands
                write_bytes(url, _life(number), json.dumps({"time": time.time()}).encode())

    alive = threading.Thread(target=live, daemon=True)
    alive.start()
    try:
        yield f"{number}-{owner}"
    finally:
        ended.set()
        alive.join()
        with suppress(StoreError):  # without a network it will be taken over
            if _told(url, _claim(number)).get("owner") == owner:
                remove(url, [_claim(number), _life(number)])


def _stake(url: str, owner: str) -> int:
    """Make the next claim, unless the owner of the last one is alive; return its number."""
    standing = [int(name.rpartition("/")[2].removesuffix(".json")) for name in names(url, CLAIMS)]
    number = max(standing, default=0) + 1
    if standing:
        _require_silence(url, number - 1)
    content = json.dumps({"owner": owner, "who": _me(), "time": time.time()}).encode()
    if not create(url, _claim(number), content):
        held = _told(url, _claim(number))
        if held.get("owner") != owner:  # it is ours where the answer to the first try was lost
            raise _busy(url, held.get("who", "another process"))
    elif not conditional(url) or create(url, _claim(number), content):
        log.warning("%s: nothing here keeps two runs apart (no conditional write): start one at a time", url)
    remove(url, [name for old in standing for name in (_claim(old), _life(old))])
    return number


def _require_silence(url: str, number: int) -> None:
    """Refuse if the owner of a claim has given a sign of life, by its own clock or while we wait for one."""
    claim = _told(url, _claim(number))
    last = _told(url, _life(number)) or claim
    if time.time() - last.get("time", 0.0) > SILENCE:
        log.warning("%s: waiting %g s for a sign of life of %s", url, 2 * BEAT, claim.get("who", "another process"))
        time.sleep(2 * BEAT)
        if (_told(url, _life(number)) or claim) == last:
            return
    raise _busy(url, claim.get("who", "another process"))


def _told(url: str, name: str) -> dict[str, Any]:
    """Read a claim or a sign of life; on a disk its maker may be in the middle of writing it."""
    try:
        return read_json(url, name) or {}
    except StoreError:
        if local(url) is None:
            raise
        return {}
