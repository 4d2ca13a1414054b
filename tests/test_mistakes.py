"""Likely mistakes in a campaign: one message with the place and the remedy."""

import pytest

from mdr_dask.campaign import load, loads
from mdr_dask.errors import CampaignError
from mdr_dask.units import COMMON, is_unit

CAMPAIGN = """\
name: study
model: sliding_friction
seed: 1
realisations: 2
parameters:
  length: 20 mm
  points: 500
  hurst: 0.7
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  normal_force: [0.1 N, 1 N]
  velocity: {geometric: [1 mm/s, 1 m/s, 4]}
accuracy: 1 %
"""
VELOCITY = "{geometric: [1 mm/s, 1 m/s, 4]}"

#: What is changed into what, and the parts of the sentence: line and column, key, value, remedy.
MISTAKES = [
    # words
    ("velocity", "speed", "13:3: parameters.speed: ", "did you mean 'velocity'?"),
    ("sliding_friction", "json:MODEL", "2:8: model: ", "expected module:NAME"),
    ("hurst: 0.7", "indenter: {shape: plane, velocity: 1 m/s}", "8:28: ", "write it beside 'indenter', not inside"),
    ("accuracy: 1 %", "outputs: [mu]", "14:11: outputs[0]: ", "did you mean 'friction_coefficient'?"),
    ("accuracy: 1 %", "outputs: film", "14:10: outputs: ", "got 'film'", "write [film]"),
    ("accuracy: 1 %", "sampling: sobol", "14:11: sampling: ", "write {sobol: ...}"),
    ("name: study", f"name: {'a' * 101}", "1:7: name: ", "at most 100"),
    # numbers
    ("points: 500", "points: 1,000", "7:11: ", "'1000'", "'1.000'"),
    ("hurst: 0.7", "hurst: 70", "8:10: ", "at most 1", "'70 %'"),
    # units
    ("20 mm", "20 milimeters", "6:11: ", "did you mean 'millimeter'?"),
    ("20 mm", "20 kg", "6:11: parameters.length: ", "a length (such as '20 mm')"),
    ("[0.1 N, 1 N]", "10 kg", "12:17: ", "1 kg weighs 9.81 N"),
    # ranges
    (VELOCITY, "1 mm/s to 1 m/s", "13:13: ", "{geometric: [a, b, n]}"),
    # YAML
    ("hurst: 0.7", "hurst:0.7", "a space is missing after 'hurst:' in line 8"),
    ("  length", "   length", "same column"),
    ("name: study", "name: my: study", "1:9: ", "put quotation marks"),
    # files
    ("hurst: 0.7", "material: rubber.csv", "8:13: ", "write {dma_table: rubber.csv}"),
    ("hurst: 0.7", "surface: {profile: no.csv}", "no.csv", "folder of the campaign file"),
    ("hurst: 0.7", "surface: {profile: README.ms}", "did you mean 'README.md'?"),
    # bodies
    ("hurst: 0.7", "indenter: {shape: cone, angle: 30}", "'30 deg'"),
    ("hurst: 0.7", "material: {kelvin: {}}", "parameters.material.kelvin.shear_modulus: missing"),
]


@pytest.mark.parametrize("case", MISTAKES, ids=[case[1] for case in MISTAKES])
def test_a_mistake_is_a_sentence_that_says_where_it_is_and_what_to_do(case):
    right, wrong, *parts = case
    with pytest.raises(CampaignError) as caught:
        loads(CAMPAIGN.replace(right, wrong, 1), "study.yaml", ".")
    sentences = str(caught.value).splitlines()
    assert all(sentence.startswith("study.yaml:") for sentence in sentences)
    assert any(all(part in sentence for part in parts) for sentence in sentences), sentences


def test_numbers_without_units_are_asked_about_beside_other_problems():
    text = CAMPAIGN.replace("0.5 um", "0.5").replace("hurst: 0.7", "hurst: 7").replace("accuracy: 1 %", "outputs: [mu]")
    with pytest.raises(CampaignError) as caught:
        loads(text, "study.yaml", ".")
    first, second, question = caught.value.args
    assert first.startswith("study.yaml:8:10: parameters.hurst: expected")
    assert second.startswith("study.yaml:14:11: outputs[0]: unknown output")
    assert question.startswith("study.yaml:9:18: parameters.rms_roughness: 0.5 is read as 0.5 m: write '0.5 um'")


@pytest.mark.parametrize("number", [".inf", ".nan", "1e999", "1" * 299])
def test_numbers_of_any_size_are_refused_beside_other_problems(number):
    text = CAMPAIGN.replace("0.5 um", number).replace("velocity: {", "velocity: {linear: [1, 2, 3], ")
    with pytest.raises(CampaignError, match="expected exactly one of the keys"):
        loads(text, "study.yaml", ".")


QUOTED = ("seed: 1", "realisations: 2", "points: 500", "hurst: 0.7")
COUNT = "1 m/s, 4]"


def test_numbers_in_quotes_are_numbers_everywhere():
    text = CAMPAIGN
    for entry in QUOTED:
        name, _, number = entry.partition(": ")
        text = text.replace(entry, f"{name}: '{number}'")
    text = text.replace(COUNT, "1 m/s, '4']")
    quoted, plain = (loads(each, "study.yaml", ".") for each in (text, CAMPAIGN))
    assert quoted.series == plain.series
    assert (quoted.seed, quoted.replication) == (plain.seed, plain.replication)


@pytest.mark.parametrize("text", ["\ufeff" + CAMPAIGN, CAMPAIGN.replace("\n", "\r\n")], ids=["mark", "line ends"])
def test_marks_of_other_editors_do_not_matter(text, tmp_path):
    (tmp_path / "study.yaml").write_bytes(text.encode())
    assert load(tmp_path / "study.yaml").series == loads(CAMPAIGN, "study.yaml", ".").series


@pytest.mark.parametrize("unit", COMMON.split())
def test_a_unit_that_is_proposed_is_known(unit):
    assert is_unit(unit)
