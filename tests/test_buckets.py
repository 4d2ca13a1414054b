"""Studies in a bucket, of a real S3 server on the loopback: kills, two runners, a network that drops and stalls."""

import os
import socket
import socketserver
import threading
import time
from contextlib import suppress
from importlib.util import find_spec

import pytest
from killed_parts import run_with_kills, study
from test_execute import run
from test_locks import small

from mdr_dask import execute, store
from mdr_dask.cli import main
from mdr_dask.errors import StoreBusyError, StoreError
from mdr_dask.execute import Part, Resources
from mdr_dask.store import files, locks

MISSING = [name for name in ("moto", "s3fs") if find_spec(name) is None]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}"),
    pytest.mark.filterwarnings("ignore:.*:DeprecationWarning"),
    pytest.mark.filterwarnings("ignore:.*:ResourceWarning"),
    pytest.mark.filterwarnings("ignore:.*:pytest.PytestUnraisableExceptionWarning"),
]


class Link(socketserver.ThreadingTCPServer):
    """A link to a server that can be slow, and that can drop what goes through it."""

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, port: int) -> None:
        self.target, self.delay, self.cut_after, self.drops, self.seen = port, 0.0, None, 0, 0
        super().__init__(("127.0.0.1", 0), Pipe)
        threading.Thread(target=self.serve_forever, daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"


class Pipe(socketserver.BaseRequestHandler):
    def handle(self) -> None:
        with socket.create_connection(("127.0.0.1", self.server.target)) as far:
            back = threading.Thread(target=self.pass_on, args=(far, self.request, False), daemon=True)
            back.start()
            self.pass_on(self.request, far, True)
            back.join()

    def pass_on(self, source: socket.socket, target: socket.socket, forth: bool) -> None:
        link = self.server
        try:
            while data := source.recv(65536):
                time.sleep(link.delay)
                link.seen += forth
                if forth and link.drops and link.seen % link.cut_after == 0:
                    link.drops -= 1
                    break
                target.sendall(data)
        except OSError:
            pass
        for end in (source, target):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)


@pytest.fixture(scope="module")
def server():
    import logging

    from moto.server import ThreadedMotoServer  # takes more than a second to import

    logging.getLogger("werkzeug").setLevel(logging.CRITICAL)
    threaded = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    threaded.start()
    yield threaded.get_host_and_port()[1]
    threaded.stop()


@pytest.fixture
def link(server, monkeypatch):
    """A bucket behind a link; credentials are in the environment, as everywhere."""
    with Link(server) as link:
        environment = {
            "AWS_ACCESS_KEY_ID": "somebody",
            "AWS_SECRET_ACCESS_KEY": "secret",
            "AWS_DEFAULT_REGION": "us-east-1",
            "AWS_ENDPOINT_URL": link.url,
        }
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        import boto3

        boto3.client("s3").create_bucket(Bucket="studies")
        import s3fs

        s3fs.S3FileSystem.clear_instance_cache()
        files.bytes_of.cache_clear()
        yield link
        files.bytes_of.cache_clear()
        link.shutdown()


@pytest.fixture
def bucket(link, request):
    return f"s3://studies/{abs(hash(request.node.name))}.zarr"


def chunks(url: str) -> dict[str, bytes]:
    found = dict(files.read_many(url, [name for name in files.listed(url) if "/c/" in name or name.endswith("/c")]))
    return {name: content for name, content in found.items() if content is not None}


def test_a_study_in_a_bucket_is_run_grown_verified_and_mended_like_one_on_a_disk(toy, bucket, url, caplog):
    assert run(small(toy), bucket).done == 12
    assert run(small(toy), bucket).kept == 12
    assert run(small(toy, 9), bucket).done == 6
    run(small(toy), url)
    run(small(toy, 9), url)
    assert chunks(bucket) == chunks(url)
    assert caplog.text == ""
    assert store.verify(bucket).findings == []
    with locks.acquire(bucket), pytest.raises(StoreBusyError, match=rf"process {os.getpid()} on .* is running"):
        run(small(toy), bucket)
    files.remove(bucket, ["height/c/0/0"])
    files.write_bytes(bucket, "position/c/0", b"")
    with pytest.raises(StoreError, match="position/c/0 is damaged"):
        store.datasets(bucket)
    found, left = store.repair(bucket)
    assert {finding.name for finding in found.findings} == {"height/c/0/0", "position/c/0"}
    assert [(each.kind, each.name) for each in left.findings] == [("missing", "position/c/0")]
    assert run(small(toy, 9), bucket).done == 8
    assert store.verify(bucket).findings == []
    assert chunks(bucket) == chunks(url)


def test_a_run_ends_with_the_network_and_the_next_one_goes_on(toy, link, bucket, url, monkeypatch):
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")  # those of the library below take more than a minute
    run(small(toy, 9), url)
    port, begun = link.target, []
    monkeypatch.setattr(locks, "BEAT", 0.25)

    def report(progress):
        if progress.blocks and not begun:
            begun.append(progress.blocks)
            link.target = 1  # where nobody listens
            link.cut_after, link.drops = 1, 10**6

    with pytest.raises(StoreError) as caught:
        execute.run(small(toy, 9), bucket, Resources(threads=1), report)
    assert "\n" not in str(caught.value)
    link.target, link.drops = port, 0
    time.sleep(0.6)
    progress = run(small(toy, 9), bucket)
    assert progress.kept > 0
    assert chunks(bucket) == chunks(url)
    assert store.verify(bucket).findings == []


def test_a_server_that_does_not_answer_ends_a_run_in_one_sentence(toy, link, bucket, monkeypatch):
    run(small(toy), bucket)
    monkeypatch.setattr(files, "BEAT", 0.25)
    link.delay = 30.0
    start = time.monotonic()
    with pytest.raises(StoreError, match="the server has not answered for 1 s"):
        run(small(toy, 9), bucket)
    assert time.monotonic() - start < 15


def test_parts_in_a_bucket_are_kept_apart_and_may_be_killed(toy, bucket, url):
    with store.shared(bucket, Part(1, 2)), store.shared(bucket, Part(2, 2)):
        assert store.at_work(bucket) == (None, [Part(1, 2), Part(2, 2)])
        with pytest.raises(StoreBusyError, match="part 1/2 is running on this store"):
            execute.run(study(12), bucket, Resources(threads=1), lambda _: None, part=Part(1, 2))
    assert run_with_kills(bucket, parts=2, kills=1, blocks=12, pause=0.05) == 1
    assert run(study(12), bucket).done == 0
    run(study(12), url)
    assert chunks(bucket) == chunks(url)
    assert store.verify(bucket).findings == []


def test_a_bucket_that_is_missing_and_credentials_that_are_missing_are_one_sentence(toy, link, monkeypatch, capsys):
    with pytest.raises(StoreError, match="bucket does not exist") as refused:
        run(small(toy), "s3://nothing-here/a.zarr")
    assert "\n" not in str(refused.value)
    for command in ("status", "show", "verify"):
        assert main([command, "s3://nothing-here/a.zarr"]) == 2
        assert "bucket does not exist" in capsys.readouterr().err
    assert main(["status", "s3://studies/none.zarr"]) == 2
    assert "no store here" in capsys.readouterr().err
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("HOME", "/nonexistent")
    import s3fs

    s3fs.S3FileSystem.clear_instance_cache()
    files.bytes_of.cache_clear()
    assert main(["status", "s3://studies/a.zarr"]) == 2
    said = capsys.readouterr().err
    assert "redentials" in said
    assert len(said.splitlines()) == 1
