"""The served page: who gets it, what it follows, and that a store may grow, be replaced or go away meanwhile."""

import http.client
import json
import shutil
import socket
import threading

import pytest

from mdr_dask.cli import main
from mdr_dask.errors import StoreError
from mdr_dask.execute import Resources, run
from mdr_dask.report import serving
from mdr_dask.units import seconds


@pytest.fixture
def study(toy, url):
    def grow(*positions):
        made = toy.campaign(toy.axis("position", positions), name="")
        run(made, url, Resources(threads=1), lambda _: None)

    grow(1.0, 2.0)
    return grow


@pytest.fixture
def server(study, url, monkeypatch):
    monkeypatch.setattr(serving, "SHARE", 0.0)
    follower = serving.Follower([url])
    follower.look()
    with serving.Server(follower) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def ask(server, path, method="GET", **headers):
    connection = http.client.HTTPConnection(*server.server_address, timeout=60)
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    found = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return found


def test_the_page_is_given_to_whoever_knows_the_secret(server):
    code, headers, content = ask(server, f"/{server.token}/")
    assert code == 200
    assert b"data-follows" in content
    assert "connect-src 'self'" in headers["Content-Security-Policy"]
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert json.loads(ask(server, f"/{server.token}/progress")[2])["settled"] == 12
    assert server.address == f"http://127.0.0.1:{server.server_address[1]}/{server.token}/"
    assert len(server.token) >= 32


def test_a_head_comes_without_content(server):
    """Asked by hand: clients do not read what must not be there."""
    with socket.create_connection(server.server_address, timeout=60) as asking:
        host = ":".join(map(str, server.server_address))
        asking.sendall(f"HEAD /{server.token}/ HTTP/1.0\r\nHost: {host}\r\n\r\n".encode())
        head, _, content = b"".join(iter(lambda: asking.recv(65536), b"")).partition(b"\r\n\r\n")
    assert b" 200 " in head.splitlines()[0]
    assert content == b""


@pytest.mark.parametrize(
    "path",
    [
        *("/", "/wrong/", "/{token}", "/{token}/zarr.json", "/{token}/../zarr.json", "/{token}/%2e%2e/zarr.json"),
        *("/{token}//etc/passwd", "/{token}/progress/..", "/{token}/..%2fzarr.json", "/progress"),
    ],
)
def test_nothing_else_is_given(server, path):
    assert ask(server, path.format(token=server.token))[0] == 404


def test_nothing_can_be_written_and_no_other_site_leads_here(server):
    for method in ("POST", "PUT", "DELETE"):
        assert ask(server, f"/{server.token}/", method)[0] == 501
    assert ask(server, f"/{server.token}/", Host="elsewhere.example:80")[0] == 403


def test_it_follows_a_store_that_grows_is_gone_and_is_another(server, study, url, toy):
    follower = server.follower
    study(1.0, 2.0, 3.0, 4.0)
    follower.look()
    assert follower.edition == 2
    assert follower.progress["sentence"].startswith("24 of 24 results (100%), 0 failed")
    follower.look()
    assert follower.edition == 2  # nothing has changed
    before = follower.page
    shutil.rmtree(url)
    with pytest.raises(StoreError, match="no store here"):
        follower.look()
    assert follower.page == before
    other = toy.campaign(toy.axis("slope", [1.0, 2.0, 3.0]))
    run(other, url, Resources(threads=1), lambda _: None)
    follower.look()
    assert follower.edition == 3
    assert follower.progress["settled"] == 18


def test_the_time_left_goes_by_the_last_minute(url, monkeypatch):
    follower, now = serving.Follower([url]), [0.0]
    monkeypatch.setattr(serving.time, "monotonic", lambda: now[0])
    for now[0], missing in ((1000.0, 100), (1090.0, 90), (1120.0, 60)):
        follower._tell([{"results": 100, "missing": missing, "failed": 2, "not_converged": 1}])
    assert follower.progress["rate"] == pytest.approx(1.0)
    told = "40 of 100 results (40%), 3 failed, 1 results/s, about 60 s left, nobody is at work"
    assert follower.progress["sentence"] == told.replace("60 s", seconds(60.0))


def test_a_page_that_takes_long_is_made_less_often(study, url, monkeypatch):
    now, made = [1000.0], iter("abc")

    def page_in_three_seconds(*_, **__):
        now[0] += 3.0
        return next(made)

    monkeypatch.setattr(serving.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(serving, "page", page_in_three_seconds)
    follower = serving.Follower([url])
    follower.look()
    study(1.0, 2.0, 3.0)
    for now[0], page, edition in ((1008.9, b"a", 1), (1009.1, b"b", 2)):  # twice the three seconds after 1003
        follower.look()
        assert (follower.page, follower.edition) == (page, edition)
        assert follower.progress["settled"] == 18  # what is counted does not wait


def test_what_cannot_be_served_is_refused(capsys, tmp_path):
    assert main(["serve", str(tmp_path / "nothing.zarr")]) == 2
    assert "no store here" in capsys.readouterr().err
    assert main(["serve", "nothing.zarr", "--host", "203.0.113.7"]) == 2
    assert "cannot listen at 203.0.113.7" in capsys.readouterr().err
