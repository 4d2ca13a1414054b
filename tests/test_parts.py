"""Parts of a campaign: each block is computed once; parts and a single runner exclude each other."""

import json
import threading
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
from killed_parts import run_with_kills, study
from test_execute import digests, run
from test_faults import two_series

from mdr_dask import execute, store
from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.cli import main
from mdr_dask.errors import StoreBusyError
from mdr_dask.execute import Part, Resources

CAMPAIGN = """
name: toy
model: toy
realisations: 4
parameters: {position: [1 m, 3 m], fail_above: 2 m}
store: {path: toy.zarr, blocks: {position: 1, realisation: 2}}
"""


@pytest.fixture
def campaign_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("toy.yaml").write_text(CAMPAIGN)


def run_part(campaign, url, number, count, **options):
    return execute.run(campaign, url, Resources(threads=1), lambda _: None, part=Part(number, count), **options)


@pytest.mark.parametrize("kind", ["axes", "series", "more parts than blocks", "growth"])
def test_parts_one_after_the_other_do_each_block_once(toy, tmp_path, kind):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0, 4.0]), toy.axis("slope", [1.0, 3.0]))
    campaign = replace(campaign, blocks={"position": 1, "slope": 1, "realisation": 2})
    parts, whole = (str(tmp_path / name) for name in ("parts.zarr", "whole.zarr"))
    count = 20 if kind == "more parts than blocks" else 4
    if kind == "series":
        campaign = two_series(campaign)
    if kind == "growth":
        smaller = toy.campaign(toy.axis("position", [4.0]), toy.axis("slope", [3.0]))
        for url in (parts, whole):
            run(replace(smaller, blocks=campaign.blocks), url)
    run(campaign, whole)
    toy.COMPUTED.clear()
    progress = [run_part(campaign, parts, number, count) for number in range(1, count + 1)]
    done = sum(each.done for each in progress)
    assert done == len(toy.COMPUTED) == sum(each.total - each.kept for each in progress)
    assert digests(parts) == digests(whole)
    assert run(campaign, parts).done == 0


def adaptive(toy):
    replication = Replication(5, 60, {"height": Tolerance(relative=0.02)})
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0]), toy.axis("noise", [0.01, 0.1]), realisations=replication)
    return replace(campaign, blocks={"position": 1, "noise": 1, "realisation": 1})


def test_parts_go_from_round_to_round_together(toy, tmp_path, monkeypatch):
    monkeypatch.setattr(execute.rounds, "LOOK", 0.02)
    parts, whole = (str(tmp_path / name) for name in ("parts.zarr", "whole.zarr"))
    expected = run(adaptive(toy), whole)
    progress = {}
    gate = threading.Barrier(3)

    def work(number):
        gate.wait()
        progress[number] = run_part(adaptive(toy), parts, number, 3)

    threads = [threading.Thread(target=work, args=(number,)) for number in (1, 2, 3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if sum(each.done for each in progress.values()) < expected.done:  # one came after the others had left
        run(adaptive(toy), parts)
    assert digests(parts) == digests(whole)
    assert set(store.attempts(parts, "").values()) == {1}


def test_a_part_that_needs_results_of_missing_parts_ends_with_a_message(toy, url):
    events = []
    progress = run_part(adaptive(toy), url, 2, 3, tell=events.append)
    assert 0 < progress.done < 20
    assert events[-1].sentence == (
        "the round of 5 realisations needs results of parts that are not running: 1/3, 3/3; "
        "start these, then this part again"
    )


BUSY = {
    "alone": (lambda url: store.exclusive(url), r"process \d+ on .* is running on this store; wait for it, or stop it"),
    "2/3": (lambda url: store.shared(url, Part(2, 3)), "part 2/3 is running on this store; wait for it, or stop it"),
    "3/4": (lambda url: store.shared(url, Part(3, 4)), "part 3/4 is running on this store"),
}


@pytest.mark.parametrize(("holder", "comer"), [("alone", "2/3"), ("2/3", "alone"), ("2/3", "3/4")])
def test_a_runner_alone_is_kept_from_parts_and_parts_of_another_number_from_each_other(toy, url, holder, comer):
    hold, message = BUSY[holder]
    campaign = toy.campaign(toy.axis("position", [1.0]))
    part = None if comer == "alone" else Part(*map(int, comer.split("/")))
    with hold(url), pytest.raises(StoreBusyError, match=message):
        execute.run(campaign, url, Resources(threads=1), lambda _: None, part=part)
    assert execute.run(campaign, url, Resources(threads=1), lambda _: None, part=part).failed == 0


def test_parts_at_work_are_counted_and_leave_no_files_to_a_runner_alone(toy, tmp_path):
    url = str(tmp_path / "a [1].zarr")
    with ExitStack() as held:
        for number in (1, 3, 4):
            held.enter_context(store.shared(url, Part(number, 8)))
        assert store.at_work(url) == (None, [Part(1, 8), Part(3, 8), Part(4, 8)])
    assert store.at_work(url) == (None, [])
    with store.exclusive(url):
        runner, parts = store.at_work(url)
    assert runner.startswith("process ")
    assert parts == []
    assert not list(tmp_path.glob("*part*"))


@pytest.mark.slow
def test_parts_killed_at_random_end_with_the_bytes_of_an_undisturbed_run(toy, tmp_path):
    parts, whole = (str(tmp_path / name) for name in ("parts.zarr", "whole.zarr"))
    kills = run_with_kills(parts, parts=3, kills=6, blocks=60, pause=0.05)
    assert kills >= 3
    assert run(study(60), parts).done == 0
    run(study(60), whole)
    assert digests(parts) == digests(whole)
    assert store.verify(parts).findings == []
    assert sum(attempt - 1 for attempt in store.attempts(parts, "").values()) <= kills


def test_log_and_status_of_parts(toy, campaign_file, capsys):
    for part in ("1/2", "2/2"):
        assert main(["run", "toy.yaml", "--part", part, "--quiet", "--log", "log.jsonl"]) == 1
        assert capsys.readouterr().out == f"toy.zarr, part {part}: 2 done, 2 failed\n"
    events = [json.loads(line) for line in Path("log.jsonl").read_text().splitlines()]
    names = ["run begun", "laid out", *2 * ["block begun"], "block done", "block failed"]
    assert sorted(event["event"] for event in events) == sorted(
        ["laying out", *2 * [*names, "round ended", "run ended"]]
    )
    assert [event["part"] for event in events if event["event"] == "run begun"] == ["1/2", "2/2"]
    assert [event["results"] for event in events if event["event"] == "block failed"] == 2 * [{"failed": 2}]
    (laid_out,) = {json.dumps(event["blocks"]) for event in events if event["event"] == "laid out"}
    assert laid_out == '{"-": [2, 2]}'

    with store.shared("toy.zarr", Part(2, 8)), store.shared("toy.zarr", Part(3, 8)):
        assert main(["status", "toy.zarr"]) == 0
        assert capsys.readouterr().out.endswith("\nat work: 2 of 8 parts (2-3)\n")
        assert main(["status", "toy.zarr", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["at_work"] == ["2 of 8 parts (2-3)"]


def test_a_part_that_cannot_go_on_has_an_exit_code(toy, campaign_file, capsys):
    text = CAMPAIGN.replace("realisations: 4", "realisations: {at_least: 4, at_most: 40, until: {height: 1 %}}")
    Path("toy.yaml").write_text(text.replace(", fail_above: 2 m", ""))
    assert main(["run", "toy.yaml", "--part", "1/2", "--quiet"]) == 2
    assert "toy.zarr, part 1/2 (unfinished: it needs results of other parts): " in capsys.readouterr().out
    assert main(["run", "toy.yaml", "--quiet"]) == 0
