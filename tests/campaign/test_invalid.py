"""Every campaign in `mistakes` is refused with its messages."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest
from mistakes import MISTAKES, campaign, messages

from mdr_dask.campaign import load, loads
from mdr_dask.errors import CampaignError

TABLES = Path(__file__).parent / "tables"


@pytest.mark.parametrize("name", MISTAKES)
def test_an_invalid_campaign_is_refused_with_all_its_problems(name, monkeypatch):
    monkeypatch.chdir(TABLES)
    with pytest.raises(CampaignError) as caught:
        loads(campaign(name), "bad.yaml", ".")
    found = [str(problem).replace(f"{TABLES}/", "").removeprefix("bad.yaml:") for problem in caught.value.args]
    assert found == messages(name)


def test_problems_are_sorted_and_survive_pickling():
    with pytest.raises(CampaignError, match=r"bad\.yaml") as caught:
        loads(campaign("many"), "bad.yaml", ".")
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
