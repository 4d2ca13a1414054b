"""Parts of a campaign killed at random: ``python -m benchmarks runner kills [PARTS] [KILLS] [SEED] [BUCKET]``.

Starts all parts at once, kills one after the other with SIGKILL at random instants and starts it again; then compares
every chunk with those of an undisturbed run, and counts the blocks that were done twice. With the name of a bucket the
study lies in it, on an S3 server (moto) that is started on the loopback.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

import toy
from killed_parts import SILENCE, run_with_kills, study

from mdr_dask import store
from mdr_dask.execute import Resources, run
from mdr_dask.store import files

#: Seconds that a block sleeps, and blocks for each kill; fewer in a bucket, where a part is killed more seldom.
PAUSE, BLOCKS_PER_KILL, IN_A_BUCKET = 0.05, 12, 4


@contextmanager
def serving(bucket: str) -> Iterator[None]:
    """Start an S3 server with one bucket, and say so in the environment."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    os.environ |= {"AWS_ACCESS_KEY_ID": "somebody", "AWS_SECRET_ACCESS_KEY": "secret"}
    os.environ |= {"AWS_DEFAULT_REGION": "us-east-1", "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}"}
    command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        import boto3

        while True:
            with suppress(OSError), socket.create_connection(("127.0.0.1", port)):
                break
            time.sleep(0.1)
        boto3.client("s3").create_bucket(Bucket=bucket)
        yield
    finally:
        server.kill()
        server.wait()


def chunks(url: str) -> dict[str, bytes | None]:
    """Return all bytes of a store that are not metadata or records."""
    return dict(files.read_many(url, [name for name in files.listed(url) if "/c/" in name or name.endswith("/c")]))


def main(parts: int = 8, kills: int = 100, seed: int = 1, bucket: str = "") -> None:
    toy.install()
    blocks = (IN_A_BUCKET if bucket else BLOCKS_PER_KILL) * kills
    with tempfile.TemporaryDirectory() as folder, serving(bucket) if bucket else nullcontext():
        url, whole = (str(Path(folder, name)) for name in ("parts.zarr", "whole.zarr"))
        url = f"s3://{bucket}/parts.zarr" if bucket else url
        start = time.monotonic()
        hit = run_with_kills(url, parts, kills, blocks, PAUSE, seed)
        seconds = time.monotonic() - start
        left = run(study(blocks), url, Resources(threads=1), lambda _: None).done
        run(study(blocks), whole, Resources(threads=1), lambda _: None)
        twice = sum(attempt - 1 for attempt in store.attempts(url, "").values())
        same = chunks(url) == chunks(whole)
        faults = len(store.verify(url).findings)
    print(f"{parts} parts, {blocks} blocks of {PAUSE} s, {seconds:.0f} s: {hit} kills hit a part at work")
    print(f"{left} results left to a plain run, {twice} blocks done twice, {'the same' if same else 'OTHER'} bytes")
    print(f"verify: {faults} faults; a killed part in a bucket is taken over after {SILENCE:g} s here")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:4]), *sys.argv[4:])
