"""The time that numba spends on compilation in this process."""

from __future__ import annotations

import threading
import time
from functools import lru_cache
from typing import Any


class CompileClock:
    """A clock that runs while at least one thread compiles."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running, self._since, self._before = 0, 0.0, 0.0

    def begin(self) -> None:
        """Register the start of a compilation."""
        with self._lock:
            self._since = self._since if self._running else time.perf_counter()
            self._running += 1

    def end(self) -> None:
        """Register the end of a compilation.

        Do nothing if no start is registered, because then the compilation started before the clock existed.
        """
        with self._lock:
            if self._running == 1:
                self._before += time.perf_counter() - self._since
            self._running = max(self._running - 1, 0)

    @property
    def is_running(self) -> bool:
        """Whether a thread is compiling."""
        return self._running > 0

    @property
    def seconds(self) -> float:
        """Time in s since the creation of the clock during which at least one thread was compiling."""
        with self._lock:
            return self._before + (time.perf_counter() - self._since if self._running else 0.0)


@lru_cache(maxsize=1)
def compile_clock() -> CompileClock:
    """Return the clock of this process. The first call creates the clock."""
    from numba.core.event import Event, Listener, register

    clock = CompileClock()

    class Listening(Listener):
        def on_start(self, event: Event) -> Any:
            clock.begin()

        def on_end(self, event: Event) -> Any:
            clock.end()

    register("numba:compile", Listening())  # type: ignore[no-untyped-call]
    return clock
