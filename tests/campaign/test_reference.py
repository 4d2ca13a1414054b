"""The schema agrees with what is read, and the committed reference and schema are current."""

from __future__ import annotations

import json
import re
from importlib.util import find_spec
from pathlib import Path

import jsonschema
import pytest
from ruamel.yaml import YAML

from mdr_dask import models
from mdr_dask.campaign import reference, schema
from mdr_dask.campaign.spec import CampaignSpec
from tests.campaign.test_read import FULL, SMALL

DOCS = Path(__file__).parents[2] / "docs"
INVALID = Path(__file__).parent / "invalid"
STRUCTURES = """\
name: structures
model: rubbing
parameters:
  length: [20 mm, 0.03]
  points: {geometric: [10, 1000, 4]}
  moduli: [1 MPa, 2e6]
  normal_force: {geometric: [1 mN, 100, 6]}
  indenter: [{shape: cone, angle: {linear: [5 deg, 75 deg, 3]}}, {shape: plane}]
  oversampling: [auto, 2]
  profile: line.txt
series:
  shapes: {indenter: {shape: power, exponent: {values: [1, 2]}, radius: 1 mm}, scheme: [exact, euler]}
"""
DRAWN = (
    SMALL.replace("1 N", "{geometric: [1 N, 2 kN]}, indenter: {shape: cone}") + "sampling: {table: a.csv}\nseed: 3\n"
)


@pytest.fixture(name="validator")
def _validator(rubbing, monkeypatch):
    monkeypatch.setattr(models, "NAMES", (rubbing.name,))
    content = json.loads(schema.text())
    jsonschema.Draft202012Validator.check_schema(content)
    return jsonschema.Draft202012Validator(content)


def plain(text):
    return YAML(typ="safe", pure=True).load(text)


@pytest.mark.parametrize("text", [SMALL, FULL, STRUCTURES, DRAWN], ids=["small", "full", "structures", "drawn"])
def test_schema_accepts_valid_files(validator, text):
    assert not [error.message for error in validator.iter_errors(plain(text))]


@pytest.mark.parametrize(
    "name",
    [
        "unknown_key",
        "unknown_parameter",
        "unknown_nested_key",
        "hurst_above_one",
        "empty_axis",
        "unknown_model",
        "missing_keys",
        "unknown_output",
        "range_count_of_half",
        "range_misspelt",
        "unknown_sampling",
        "misspelt_shape",
        "number_or_word",
        "realisations_of_none",
        "negative_seed",
        "series_empty",
    ],
)
def test_schema_refuses_what_needs_no_units(validator, name):
    assert list(validator.iter_errors(plain((INVALID / f"{name}.yaml").read_text())))


def test_reference_names_every_key_parameter_and_output(rubbing, monkeypatch):
    monkeypatch.setattr(models, "NAMES", (rubbing.name,))
    page = reference.text()
    for name in [*CampaignSpec.model_fields, *rubbing.parameters.model_fields]:
        assert f"| `{name}` |" in page
    for output in rubbing.outputs:
        assert f"| `{output.name}` |" in page
    assert "| `indenter.angle` | rad | required | number > 0, < 1.5 | (shape: cone) inclination of the flank |" in page
    assert "| `hurst` | — | `0.7` | number ≥ 0, ≤ 1 | Hurst exponent |" in page
    assert "| `moduli` | Pa | `[1000000]` | list, each: number | moduli of the Prony series |" in page


def test_tables_have_as_many_cells_in_every_row(rubbing, monkeypatch):
    monkeypatch.setattr(models, "NAMES", (rubbing.name,))
    tables = re.findall(r"(?:^\|.*\n)+", reference.text(), flags=re.MULTILINE)
    assert len(tables) == 5
    for table in tables:
        assert len({len(re.split(r"(?<!\\)\|", row)) for row in table.splitlines()}) == 1


@pytest.mark.parametrize(
    ("name", "content"), [("campaign-file.md", reference.text), ("campaign.schema.json", schema.text)]
)
def test_committed_pages_are_current(name, content, monkeypatch):
    monkeypatch.undo()
    if any(find_spec(f"mdr_dask.models.{model}") is None for model in models.NAMES):
        pytest.skip("not all models are written yet")
    assert (DOCS / name).read_text(encoding="utf-8") == content(), "run reference.write('docs')"
