"""Every file in ``invalid`` is refused with the messages that stand beside it."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from mdr_dask.campaign import load
from mdr_dask.errors import CampaignError

FOLDER = Path(__file__).parent / "invalid"
FILES = sorted(FOLDER.glob("*.yaml"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_invalid_campaign_is_refused_with_all_its_problems(path, monkeypatch):
    monkeypatch.chdir(FOLDER)
    with pytest.raises(CampaignError, match=r"^[a-z_]+\.(yaml|csv):\d+:\d+: ") as caught:
        load(path.name)
    messages = str(caught.value).replace(f"{FOLDER}/", "")
    assert messages.splitlines() == path.with_suffix(".txt").read_text().splitlines()


def test_problems_are_sorted_and_survive_pickling(monkeypatch):
    monkeypatch.chdir(FOLDER)
    with pytest.raises(CampaignError, match=r"many\.yaml") as caught:
        load("many.yaml")
    lines = [int(problem.split(":")[1]) for problem in caught.value.args]
    assert lines == sorted(lines)
    assert len(lines) > 10
    assert pickle.loads(pickle.dumps(caught.value)).args == caught.value.args


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(CampaignError, match=r"nowhere\.yaml: cannot be read: No such file"):
        load(tmp_path / "nowhere.yaml")


def test_a_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"name: \xff\xfe")
    with pytest.raises(CampaignError, match=r"binary\.yaml:1:1: expected UTF-8 text, got byte 0xff"):
        load(path)
