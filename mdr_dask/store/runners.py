"""Who is at work on a study: one runner alone, or the parts of a campaign beside each other.

Every runner comes in through the entrance, a lock that is held for moments. Whoever holds it can tell who is at work:
so a part and a runner alone never meet, and a study is laid out by one of them while the others wait.
"""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass

from mdr_dask.errors import MdrDaskError, StoreBusyError
from mdr_dask.store.files import local, sweep
from mdr_dask.store.locks import Hold, forget, holder, is_known, lock, lock_file, lock_names

_ENTRANCE = "entrance"
_PART = "part-"
log = logging.getLogger("mdr_dask.store")
#: Seconds between two tries at the entrance.
KNOCK = 0.1
#: Seconds after which waiting there is no longer silent.
SILENT = 4.0
#: Seconds that somebody who only wants to know waits there.
GLANCE = 2.0


@dataclass(frozen=True, order=True)
class Part:
    """One of several disjoint sets of blocks, each run by a process of its own.

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

        Blocks are dealt out like cards, each deal beginning one further on: else all blocks at one value of an axis
        that has as many of them as there are parts would fall to the same part.
        """
        return cls((position + position // count) % count + 1, count)


@contextmanager
def alone(url: str) -> Iterator[Hold]:
    """Hold a study for one runner; the operating system lets go of it however that ends.

    Raises
    ------
    StoreBusyError
        If another runner or a part is at work on it; the message says which.
    StoreError
        If nothing can be written there.
    """
    with _leaving_nothing(url), ExitStack() as held:
        with entrance(url):
            parts = _parts(url)
            if parts:
                raise StoreBusyError(f"{url}: {_named(parts)} running on this store; wait for them, or stop them")
            hold = held.enter_context(lock(url))
            for name in _part_locks(url):
                forget(url, name)
            sweep(url)
        yield hold


@contextmanager
def beside(url: str, part: Part) -> Iterator[Hold]:
    """Hold one part of a study, with other parts of as many beside it.

    Raises
    ------
    StoreBusyError
        If this part, a part of another number of parts, or a runner alone is at work.
    StoreError
        If nothing can be written there.
    """
    with _leaving_nothing(url), ExitStack() as held:
        with entrance(url):
            with lock(url):
                others = _parts(url)
            unfit = [other for other in others if other == part or other.count != part.count]
            if unfit:
                raise StoreBusyError(f"{url}: {_named(unfit)} running on this store; wait for them, or stop them")
            hold = held.enter_context(lock(url, part.lock))
            if not others:
                sweep(url)
        yield hold


@contextmanager
def _leaving_nothing(url: str) -> Iterator[None]:
    """After an error or Ctrl-C where nobody was at work before, take away locks and the folders made for them."""
    if local(url) is None:
        yield
        return
    door = lock_file(url, _ENTRANCE)
    if door.exists():
        yield
        return
    missing = [folder for folder in door.parents if not folder.exists()]
    try:
        yield
    except (MdrDaskError, KeyboardInterrupt):
        if door.exists():
            with suppress(StoreBusyError), entrance(url, GLANCE):
                names = {"", *lock_names(url)} - {_ENTRANCE}
                if all(_is_free(url, name) for name in names):
                    for name in names:
                        forget(url, name)
                    door.unlink()
        with suppress(OSError):  # somebody else has come, or there is a store
            for folder in missing:
                folder.rmdir()
        raise


@contextmanager
def entrance(url: str, patience: float = float("inf")) -> Iterator[None]:
    """Hold the entrance of a study: meanwhile nobody comes to work on it or lays it out.

    Raises
    ------
    StoreBusyError
        If somebody else holds it for longer than `patience` seconds.
    """
    start, told = time.monotonic(), False
    with ExitStack() as held:
        while True:
            try:
                held.enter_context(lock(url, _ENTRANCE))
                break
            except StoreBusyError as error:
                waited = time.monotonic() - start
                if waited > patience:
                    raise
                if waited > SILENT and not told:
                    log.warning("%s; waiting until it has looked at what is there", error.args[0].partition(";")[0])
                    told = True
                time.sleep(KNOCK)
        yield


def at_work(url: str) -> tuple[str | None, list[Part]]:
    """Return who is at work on a study: the runner alone if there is one, and the parts.

    Raises
    ------
    StoreError
        If that cannot be found out, since the study is being laid out, or belongs to somebody else.
    """
    if not is_known(url):
        return None, []
    with entrance(url, GLANCE):
        runner = None if _is_free(url) else holder(url)
        return runner, _parts(url)


def _parts(url: str) -> list[Part]:
    """Return the parts at work; only for who holds the entrance."""
    numbers = (name.removeprefix(_PART).split("-of-") for name in _part_locks(url))
    known = sorted(Part(int(number), int(count)) for number, count in numbers)
    return [part for part in known if not _is_free(url, part.lock)]


def _part_locks(url: str) -> list[str]:
    return [name for name in lock_names(url) if re.fullmatch(rf"{_PART}\d+-of-\d+", name)]


def _is_free(url: str, name: str = "") -> bool:
    try:
        with lock(url, name):
            return True
    except StoreBusyError:
        return False


def _named(parts: list[Part]) -> str:
    """Return the subject and the verb of a sentence about parts."""
    names = ", ".join(map(str, parts))
    return f"part {names} is" if len(parts) == 1 else f"parts {names} are"
