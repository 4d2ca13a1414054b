"""The likeliest mistakes in a campaign: each is one sentence that says where it is and what to do."""

import pytest

from mdr_dask.campaign import load, loads
from mdr_dask.errors import CampaignError
from mdr_dask.plan import estimate
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
LENGTH = "expected a length (such as '20 mm'), got"
VELOCITIES = "13:13: parameters.velocity: expected a velocity (such as '1 mm/s'), got"
SEVERAL = "(several values are [a, b, c], a range {linear: [a, b, n]} or {geometric: [a, b, n]})"

#: What is changed into what, and the sentence: line and column, key, what was expected, what to do.
MISTAKES = [
    # words
    ("normal_force", "normal_forse", "12:3: parameters.normal_forse: unknown key (did you mean 'normal_force'?)"),
    ("normal_force", "load", "12:3: parameters.load: unknown key (did you mean 'normal_force'?)"),
    ("velocity", "speed", "13:3: parameters.speed: unknown key (did you mean 'velocity'?)"),
    ("shear_modulus", "youngs_modulus", "10:3: parameters.youngs_modulus: unknown key (did you mean 'shear_modulus'?)"),
    ("realisations", "repeats", "4:1: repeats: unknown key (did you mean 'realisations'?)"),
    ("parameters:", "parameter:", "5:1: parameter: unknown key (did you mean 'parameters'?)"),
    ("sliding_friction", "friction", "2:8: model: unknown model 'friction' (did you mean 'sliding_friction'?)"),
    ("sliding_friction", "json:MODEL", "'json' has no attribute 'MODEL' (expected module:NAME of a Model)"),
    ("accuracy: 1 %", "outputs: [mu]", "outputs[0]: unknown output 'mu' (did you mean 'friction_coefficient'?)"),
    ("accuracy: 1 %", "outputs: film", "14:10: outputs: expected a list, got 'film' (write [film])"),
    ("accuracy: 1 %", "output: [mu]", "14:1: output: unknown key (did you mean 'outputs'?)"),
    ("accuracy: 1 %", "store: a.zarr", "14:8: store: expected a mapping, got 'a.zarr' (write {path: a.zarr})"),
    ("accuracy: 1 %", "sampling: sobol", "expected 'grid' or 'zip', got 'sobol' (write {sobol: ...})"),
    ("name: study", "name: my study", "1:7: name: expected a file name of letters, digits, '-', '_' and '.', got"),
    (
        "realisations: 2",
        "realisations: {at_least: 4, at_most: 40, until: {zone_one.alpha: little}}",
        "4:66: realisations.until.zone_one.alpha: expected a number, got 'little'",
    ),
    ("name: study", f"name: {'a' * 101}", "1:7: name: expected a file name with at most 100 characters, got"),
    (
        "name: study",
        f"name: {'a' * 92}.partial",
        "name: expected a file name with another ending, got",
    ),
    # numbers
    ("hurst: 0.7", "hurst: 0,7", "8:10: parameters.hurst: expected a number, got '0,7' (write a decimal point: '0.7')"),
    ("0.5 um", "0,5 um", f"{LENGTH} '0,5 um' (write a decimal point: '0.5 um')"),
    ("points: 500", "points: 1,000", "got '1,000' (write '1000', or '1.000' with a decimal point)"),
    ("points: 500", "points: 5e2", "7:11: parameters.points: expected a whole number, got 500.0 (write 500)"),
    ("hurst: 0.7", "hurst: .nan", "8:10: parameters.hurst: expected a finite number, got nan"),
    (
        "hurst: 0.7",
        "hurst: 70",
        "parameters.hurst: expected a number of at most 1, got 70 (write '70 %' if you mean tha",
    ),
    (
        "accuracy: 1 %",
        "accuracy: 1",
        "14:11: accuracy: expected a number below 1, got 1 (write '1 %' if you mean that)",
    ),
    ("hurst: 0.7", "hurst: 70 %%", "8:10: parameters.hurst: expected a number, got '70 %%'"),
    ("[0.1 N, 1 N]", "[0.1 N, -1 N]", "12:25: parameters.normal_force: expected a number above 0, got '-1 N'"),
    # units
    ("20 mm", "20 milimeters", "unknown unit 'milimeters' (did you mean 'millimeter'?), got '20 milimeters'"),
    ("10 MPa", "10 Mpa", "10:18: parameters.shear_modulus: unknown unit 'Mpa' (did you mean 'MPa'?), got '10 Mpa'"),
    ("10 MPa", "10 N/mm2", "unknown unit 'mm2' (write mm^2), got '10 N/mm2'"),
    ("20 mm", "20 kg", f"6:11: parameters.length: {LENGTH} '20 kg'"),
    ("hurst: 0.7", "hurst: 0.7 mm", "8:10: parameters.hurst: expected a number, got '0.7 mm'"),
    ("1 ms", "1 Hz", "11:20: parameters.relaxation_time: expected a time (such as '1 ms'), got '1 Hz'"),
    ("[0.1 N, 1 N]", "[0.1 Newtn]", "unknown unit 'Newtn' (did you mean 'newton'?), got '0.1 Newtn'"),
    ("{geometric: [1 mm/s,", "{geometric: [1 kmh,", "unknown unit 'kmh' (did you mean 'km/h'?), got '1 kmh'"),
    (
        "10 MPa",
        "10 grad",
        "10:18: parameters.shear_modulus: unknown unit 'grad', expected a pressure (such as '10 MPa')",
    ),
    ("[0.1 N, 1 N]", "10 kg", "expected a force (such as '1 mN') (1 kg weighs 9.81 N), got '10 kg'"),
    # ranges
    (VELOCITY, "1 mm/s, 1 m/s", f"{VELOCITIES} '1 mm/s, 1 m/s' {SEVERAL}"),
    (VELOCITY, "1 mm/s to 1 m/s", f"{VELOCITIES} '1 mm/s to 1 m/s' {SEVERAL}"),
    (VELOCITY, "1 mm/s - 1 m/s", f"{VELOCITIES} '1 mm/s - 1 m/s' {SEVERAL}"),
    (VELOCITY, "{logspace: [1 mm/s, 1 m/s, 4]}", f"{VELOCITIES} a mapping (a range is {{linear: [a, b, n]}} or"),
    (VELOCITY, "{linear: [1 mm/s, 1 m/s]}", "expected [first, last, count], got ['1 mm/s', '1 m/s']"),
    (VELOCITY, "{geometric: [0, 1 m/s, 4]}", "expected an end above 0 for a geometric range, got 0"),
    # YAML
    ("hurst: 0.7", "hurst:0.7", "could not find expected ':' (a blank is missing after 'hurst:' in line 8)"),
    (
        "geometric: ",
        "geometric:",
        "expected ',' or '}', but got '[' (a blank is missing after 'geometric:' in line 13)",
    ),
    ("  points", "\tpoints", "(indent with blanks, not with tabs)"),
    ("  length", "   length", "(entries of one mapping begin in the same column)"),
    ("hurst: 0.7", "hurst: 0.7\n  hurst: 0.8", "9:3: parameters.hurst: this key was already given in line 8"),
    ("name: study", "name: my: study", "1:9: not YAML: mapping values are not allowed here (put quotation marks"),
    ("hurst: 0.7", "hurst: *h", "not YAML: found undefined alias 'h' (put quotation marks around a string that begins"),
    # files
    ("hurst: 0.7", "material: rubber.csv", "expected a mapping, got 'rubber.csv' (write {dma_table: rubber.csv})"),
    ("hurst: 0.7", "material: {dma: rubber.csv}", "dma: unknown key (did you mean 'dma_table'?)"),
    ("hurst: 0.7", "surface: road.txt", "expected a mapping, got 'road.txt' (write|{profile: road.txt}"),
    ("accuracy: 1 %", "measured: rig.csv", "measured: expected a mapping, got 'rig.csv' (write {table: rig.csv})"),
    ("hurst: 0.7", "surface: {profile: no.csv}", "no.csv (names begin at the folder of the campaign file)"),
    ("hurst: 0.7", "surface: {profile: README.ms}", "README.ms (did you mean 'README.md'?)"),
    # bodies
    ("hurst: 0.7", "indenter: {shape: sphere}", "8:21: parameters.indenter.shape: expected 'plane', 'cone', '"),
    ("hurst: 0.7", "indenter: ball", "expected a mapping with shape: 'plane', 'cone', "),
    ("hurst: 0.7", "indenter: cone", "got 'cone' (write {shape: cone, angle: ...})"),
    ("hurst: 0.7", "indenter: {shape: cone, angle: 30}", "below 1.57079632679 rad, got 30 (write '30 deg' if you mean"),
    ("hurst: 0.7", "material: {kelvin: {}}", "parameters.material.kelvin.shear_modulus: missing, expected a pressure"),
]


@pytest.mark.parametrize(("right", "wrong", "told"), MISTAKES, ids=[wrong for _, wrong, _ in MISTAKES])
def test_a_mistake_is_a_sentence_that_says_what_to_do(right, wrong, told):
    with pytest.raises(CampaignError) as caught:
        loads(CAMPAIGN.replace(right, wrong, 1), "study.yaml", ".")
    sentences = str(caught.value).splitlines()
    assert all(sentence.startswith("study.yaml:") for sentence in sentences)
    assert any(all(part in sentence for part in told.split("|")) for sentence in sentences), sentences


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


FILES = {
    "empty": (b"", "study.yaml:1:1: expected a mapping with the keys name, model and parameters, got nothing"),
    "UTF-16": (CAMPAIGN.encode("utf-16"), "study.yaml:1:1: expected UTF-8 text, got byte 0xff"),
    "Latin-1": (CAMPAIGN.replace("0.5 um", "0.5 µm").encode("latin-1"), "expected UTF-8 text, got byte 0xb5"),
}


@pytest.mark.parametrize("kind", FILES)
def test_a_file_that_is_no_campaign_is_named(kind, tmp_path, monkeypatch):
    content, told = FILES[kind]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.yaml").write_bytes(content)
    with pytest.raises(CampaignError) as caught:
        load("study.yaml")
    assert told in str(caught.value)


@pytest.mark.parametrize("text", ["\ufeff" + CAMPAIGN, CAMPAIGN.replace("\n", "\r\n")], ids=["mark", "line ends"])
def test_marks_of_other_editors_do_not_matter(text, tmp_path):
    (tmp_path / "study.yaml").write_bytes(text.encode())
    assert load(tmp_path / "study.yaml").series == loads(CAMPAIGN, "study.yaml", ".").series


def test_a_study_that_is_too_large_is_told_by_its_sizes():
    text = CAMPAIGN.replace("[0.1 N, 1 N]", "{linear: [1 N, 2 N, 100000]}").replace("1 m/s, 4]", "1 m/s, 10000]")
    with pytest.raises(
        CampaignError, match=r"at most 1e\+09 results, got 100000 normal_force x 10000 velocity x 2 real"
    ):
        estimate(loads(text, "study.yaml", "."))


@pytest.mark.parametrize("unit", COMMON.split())
def test_a_unit_that_is_proposed_is_known(unit):
    assert is_unit(unit)
