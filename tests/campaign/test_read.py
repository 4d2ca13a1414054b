"""A whole campaign file, its defaults, and what reading it costs."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mdr_dask.campaign import Replication, Tolerance, load, loads
from mdr_dask.errors import CampaignError

VALID = Path(__file__).parent / "valid"
SMALL = (VALID / "small.yaml").read_text()
FULL = (VALID / "full.yaml").read_text()


def test_defaults():
    campaign = loads(SMALL, "a.yaml", ".")
    assert campaign.replication == Replication(1, 1, {})
    assert campaign.outputs == ("friction_coefficient", "indentation_depth")
    assert (campaign.seed, campaign.accuracy, campaign.blocks) == (0, None, {})
    assert campaign.store == "results/small.zarr"
    assert [series.name for series in campaign.series] == [""]


def test_every_key():
    campaign = loads(FULL, "force.yaml", ".")
    assert (campaign.name, campaign.model, campaign.seed) == ("full", "rubbing", 2013)
    assert campaign.replication == Replication(
        10, 200, {"friction_coefficient": Tolerance(relative=0.01), "indentation_depth": Tolerance(absolute=2e-6)}
    )
    assert [list(series.sizes.values()) for series in campaign.series] == [[6, 20, 36], [20, 36, 3]]
    assert campaign.outputs == ("friction_coefficient", "indentation_depth", "pressure")
    assert campaign.accuracy == 0.01
    assert campaign.store == "results/other.zarr"
    assert campaign.blocks == {"realisation": 50, "velocity": 36}
    assert (campaign.text, campaign.source) == (FULL, "force.yaml")


@pytest.mark.parametrize(
    ("written", "tolerance"),
    [
        ("0.02", Tolerance(relative=0.02)),
        ("{relative: 1 %, absolute: 3 mm}", Tolerance(0.01, 0.003)),
        ("{absolute: 0.5}", Tolerance(0.0, 0.5)),
    ],
)
def test_tolerances(written, tolerance):
    text = SMALL + f"realisations: {{at_least: 2, at_most: 9, until: {{indentation_depth: {written}}}}}\n"
    assert loads(text, "a.yaml", ".").replication.until == {"indentation_depth": tolerance}


def test_files_are_looked_for_beside_the_campaign(tmp_path, monkeypatch):
    (tmp_path / "line.txt").write_text("1 2 3")
    path = tmp_path / "a.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + SMALL.replace("1 N", "1 N, profile: line.txt").encode())
    monkeypatch.chdir("/")
    campaign = load(path)
    assert campaign.series[0].parameters.profile.read_text() == "1 2 3"
    assert campaign.source == str(path)


@pytest.mark.parametrize("path", sorted(VALID.glob("*.yaml")), ids=lambda path: path.stem)
def test_valid_files_are_read(path):
    assert load(path).name == path.stem


FRAGMENTS = [*"[]{}:-'*~10%#|", "&a", "-1", "mm", "null", "true", "[]", "{}", "1e400", ".nan", "!x", "3.5", "[1, 2]"]
FRAGMENTS += ["linear", "values", "{linear: [1, 2, 3]}", "{shape: cone}"]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=150)
@given(st.data())
def test_no_damage_to_a_file_does_more_than_raise_a_campaign_error(data):
    text = data.draw(st.sampled_from([path.read_text() for path in sorted(VALID.glob("*.yaml"))]))
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        length = data.draw(st.integers(0, 8))
        text = text[:start] + data.draw(st.sampled_from(["", *FRAGMENTS])) + text[start + length :]
    problems = ()
    try:
        assert loads(text, "a.yaml", str(VALID)).series
    except CampaignError as error:
        problems = error.args
    assert {problem.partition(":")[0] for problem in problems} <= {"a.yaml", "cases.csv"}
