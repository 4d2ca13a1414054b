"""Hostile files are refused at once with one message; an internal error has its own exit code."""

import json
import time
from pathlib import Path

import pytest

from mdr_dask import cli
from mdr_dask.campaign import loads
from mdr_dask.cli import main
from mdr_dask.errors import CampaignError

HEAD = "name: a\nmodel: toy\n"
HOSTILE = {
    "nested lists": HEAD + "parameters: {position: " + "[" * 5000 + "]" * 5000 + "}\n",
    "a key of aliases": HEAD
    + "a: &a [x, x]\n"
    + "".join(f"b{i}: &{chr(98 + i)} [*{chr(97 + i)}, *{chr(97 + i)}]\n" for i in range(24))
    + "? [*y, *y]\n: 1\n",
    "a long whole number": HEAD + "seed: " + "9" * 5000 + "\nparameters: {}\n",
    "a million values": HEAD + f"parameters: {{position: {list(range(10**6))}}}\n",
    "a null character": HEAD + 'parameters: {}\nstore: {path: "a\\0b"}\n',
    "an endless table": HEAD + "parameters: {}\nsampling: {table: /dev/zero}\n",
    "a series that ends like a leftover": HEAD + "parameters: {}\nseries: {x.partial: {}}\n",
    "a deep chain of aliases": HEAD
    + "a0: &a0 [1]\n"
    + "".join(f"a{i}: &a{i} [*a{i - 1}]\n" for i in range(1, 3000))
    + "parameters: {position: *a2999}\n",
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_campaign_is_refused_at_once(toy, kind):
    began = time.process_time()
    with pytest.raises(CampaignError) as caught:
        loads(HOSTILE[kind], "a.yaml", ".")
    assert time.process_time() - began < 5
    lines = str(caught.value).splitlines()
    assert all(line.startswith("a.yaml:") and len(line) < 600 for line in lines)


@pytest.fixture
def filled(toy, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = HEAD + "realisations: 3\nparameters: {position: [1, 2, 3], fail_above: 2.5}\noutputs: [height]\n"
    Path("a.yaml").write_text(text)
    assert main(["run", "a.yaml", "--quiet"]) == 1
    capsys.readouterr()
    return Path("results/a.zarr")


def test_control_characters_of_messages_are_escaped(filled, capsys):
    together = next((filled / "status/records").glob("*.jsonl"))
    lines = [json.loads(line) for line in together.read_text().splitlines()]
    for record in lines:
        del record["digest"]
        for message in record["messages"]:
            message["message"] = "\x1b]0;owned\x07 \x1b[31mred"
    together.write_text("".join(json.dumps(record) + "\n" for record in lines))
    assert main(["status", str(filled), "--failures"]) == 0
    shown = capsys.readouterr().out
    assert "\x1b" not in shown
    assert "\\x1b[31mred" in shown


def test_a_store_in_memory_is_refused(filled, capsys):
    assert main(["run", "a.yaml", "--store", "memory://a"]) == 2
    assert "expected a store on a disk or server, not in memory" in capsys.readouterr().err


def test_a_link_to_itself_is_one_message(filled, capsys):
    Path("loop.zarr").symlink_to("loop.zarr")
    assert main(["run", "a.yaml", "--store", "loop.zarr"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_fault_of_the_program_has_its_own_exit_code_and_a_traceback(filled, monkeypatch, capsys):
    def broken(*_):
        raise RuntimeError("wheels came off")

    monkeypatch.setattr("mdr_dask.store.series_names", broken)
    assert main(["status", str(filled)]) == cli.BROKE == 3
    printed = capsys.readouterr().err
    assert printed.startswith("Traceback")
    assert "RuntimeError: wheels came off" in printed
    assert "please report" in printed.splitlines()[-1]
