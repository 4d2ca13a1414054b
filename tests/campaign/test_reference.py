"""The schema agrees with what is read, and the reference names everything."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest
from mistakes import campaign
from ruamel.yaml import YAML

from mdr_dask import models
from mdr_dask.campaign import json_schema, reference
from mdr_dask.campaign.spec import CampaignSpec
from mdr_dask.models.fretting_wear import MODEL as FRETTING

VALID = Path(__file__).parent / "valid"


@pytest.fixture(name="validator")
def _validator(rubbing, monkeypatch):
    monkeypatch.setattr(models, "NAMES", (rubbing.name,))
    content = json.loads(json.dumps(json_schema()))
    jsonschema.Draft202012Validator.check_schema(content)
    return jsonschema.Draft202012Validator(content)


def plain(text):
    return YAML(typ="safe", pure=True).load(text)


@pytest.mark.parametrize("path", sorted(VALID.glob("*.yaml")), ids=lambda path: path.stem)
def test_schema_accepts_valid_files(validator, path):
    assert not [error.message for error in validator.iter_errors(plain(path.read_text()))]


WITHOUT_UNITS = """many unknown_nested_key empty_axis missing_keys range_count_of_half range_misspelt unknown_sampling
misspelt_shape number_or_word series_empty"""


@pytest.mark.parametrize("name", WITHOUT_UNITS.split())
def test_schema_refuses_what_needs_no_units(validator, name):
    assert list(validator.iter_errors(plain(campaign(name))))


def test_reference_names_every_key_parameter_and_output(rubbing, monkeypatch):
    monkeypatch.setattr(models, "NAMES", (rubbing.name,))
    page = reference.reference_page()
    for name in [*CampaignSpec.model_fields, *rubbing.parameters.model_fields]:
        assert f"| `{name}` |" in page
    for output in rubbing.outputs:
        assert f"| `{output.name}` |" in page
    assert "| `indenter.angle` | rad | required | number > 0, < 1.5 | (shape: cone) inclination of the flank |" in page
    assert "| `hurst` | 1 | 0.7 | number ≥ 0, ≤ 1 | Hurst exponent |" in page
    load_step = "list, each: {cycles, amplitude_factor, load_factor}"
    assert any(load_step in row["allowed"] for row in reference.parameter_rows(FRETTING))
    assert "| `moduli` | Pa | [1000000] | list, each: number | moduli of the Prony series |" in page
