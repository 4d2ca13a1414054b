"""The page served to a browser on this machine: it follows a run, and shows nothing else.

There are two answers, the page and how far the run has come, at an address that holds a secret. No request names
a file.
"""

from __future__ import annotations

import hmac
import json
import secrets
import threading
import time
from collections import deque
from collections.abc import Sequence
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from mdr_dask.errors import MdrDaskError
from mdr_dask.questions import progress
from mdr_dask.report.page import page, policy
from mdr_dask.report.study import read_study, who_is_at_work
from mdr_dask.units import seconds

#: Seconds between two looks at the ledger, and how much longer than a page takes the pause between two pages is.
PAUSE, SHARE = 1.0, 2.0
#: Seconds that the rate is taken over.
WINDOW = 60.0
#: Names that a browser on this machine knows it by.
LOOPBACK = ("127.0.0.1", "localhost", "::1")
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


class Follower:
    """The latest page of some studies, and how far they have come; read by many, made by one thread.

    Parameters
    ----------
    urls : sequence of str
        Paths or URLs of stores. They may grow, be replaced or go away meanwhile: the last page stays.
    """

    def __init__(self, urls: Sequence[str]) -> None:
        self._urls = list(urls)
        self._seen: deque[tuple[float, int]] = deque()
        self._mark: object = None
        self._rest_until = 0.0
        self.edition = 0
        self.page = b""
        self.progress: dict[str, Any] = {}

    def look(self) -> None:
        """Look how far the studies have come, and make the page anew where that has changed.

        Raises
        ------
        MdrDaskError
            If a study is not there, or cannot be read.
        """
        rows = [row for url in self._urls for row in (progress.counts(look) for look in progress.looks(url))]
        self._tell(rows)
        mark = (rows, [who_is_at_work(url) for url in self._urls])
        if mark == self._mark or time.monotonic() < self._rest_until:
            return
        started = time.monotonic()
        self.page = page([read_study(url) for url in self._urls], follows=True).encode()
        self._mark = mark
        self.edition += 1
        self._rest_until = time.monotonic() + SHARE * (time.monotonic() - started)
        self._tell(rows)

    def _tell(self, rows: list[dict[str, Any]]) -> None:
        total = sum(row["results"] for row in rows)
        settled = total - sum(row["missing"] for row in rows)
        failed = sum(row["failed"] + row["not_converged"] for row in rows)
        now = time.monotonic()
        self._seen.append((now, settled))
        while now - self._seen[0][0] > WINDOW:
            self._seen.popleft()
        rate = (settled - self._seen[0][1]) / max(now - self._seen[0][0], PAUSE)
        parts = [f"{settled} of {total} results ({settled / max(total, 1):.0%})", f"{failed} failed"]
        if rate > 0 and settled < total:
            parts += [f"{rate:.3g} results/s", f"about {seconds((total - settled) / rate)} left"]
        who = "; ".join(filter(None, (who_is_at_work(url) for url in self._urls)))
        parts.append(f"at work: {who}" if who else "nobody is at work")
        told = {"results": total, "settled": settled, "failed": failed, "rate": rate, "edition": self.edition}
        self.progress = {**told, "sentence": ", ".join(parts)}

    def follow(self, ended: threading.Event) -> None:
        """Look again and again; a study that cannot be read at a moment is told, and looked at again."""
        while not ended.wait(PAUSE):
            try:
                self.look()
            except (MdrDaskError, OSError) as error:
                self.progress = {**self.progress, "sentence": f"the last page stays: {error}"}


class Server(ThreadingHTTPServer):
    """Serves a page under a secret, to this machine unless another address is asked for.

    Parameters
    ----------
    follower : Follower
        With its first page made.
    host, port
        Where it listens; port 0 is one that is free.
    """

    daemon_threads = True

    def __init__(self, follower: Follower, host: str = LOOPBACK[0], port: int = 0) -> None:
        self.follower = follower
        self.token = secrets.token_urlsafe(24)
        self.is_local = host in LOOPBACK
        super().__init__((host, port), _Answer)

    @property
    def address(self) -> str:
        """What a browser opens."""
        return f"http://{self.server_address[0]!s}:{self.server_address[1]}/{self.token}/"


class _Answer(BaseHTTPRequestHandler):
    server: Server
    timeout = 30
    server_version, sys_version = "mdr-dask", ""

    def do_GET(self) -> None:
        """Answer with the page, or with how far the run has come, and with nothing else."""
        self._answer(body=True)

    def do_HEAD(self) -> None:
        """Answer as to GET, without the content."""
        self._answer(body=False)

    def _answer(self, body: bool) -> None:
        host = self.headers.get("Host", "").rpartition(":")[0].strip("[]")
        if self.server.is_local and host not in LOOPBACK:  # a name of another site that was made to lead here
            self.send_error(HTTPStatus.FORBIDDEN)
            return
        _, token, *rest = self.path.partition("?")[0].split("/")
        if not hmac.compare_digest(token.encode(), self.server.token.encode()) or rest not in ([""], ["progress"]):
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        follower = self.server.follower
        content = json.dumps(follower.progress).encode() if rest == ["progress"] else follower.page
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "application/json" if rest == ["progress"] else "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if body:
            self.wfile.write(content)

    def end_headers(self) -> None:
        """Send with every answer what a browser may do with it."""
        for name, value in (HEADERS | {"Content-Security-Policy": policy(follows=True)}).items():
            self.send_header(name, value)
        super().end_headers()

    def log_message(self, *_: Any) -> None:
        """Keep quiet: the address is a secret."""
