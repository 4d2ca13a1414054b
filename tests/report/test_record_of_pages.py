"""All that a page says of some studies, as on record: facts, tables, figures as data, cases, and the text itself."""

import hashlib
import re
from dataclasses import asdict, fields

import numpy as np
import planted
import pytest
import record
import toy as toy_model
from seen import MOST

from mdr_dask import execute
from mdr_dask.report import figures, page, read_study

V = "  velocity: {geometric: [0.01 mm/s, 1 m/s, 8]}\n"
STUDIES = {
    "grid": (
        planted.SLIDING + V + "  normal_force: {geometric: [100 mN, 3 N, 4]}\n",
        {"failed": True},
    ),
    "series": (
        planted.NUMBERS + "  load_parameter: 2e-5\n  material_parameter: 5000\n  inlet: [-4, -2, -1.3]\n"
        "series:\n  slow: {speed_parameter: 1e-12}\n  fast: {speed_parameter: [1e-11, 1e-10]}\n",
        {},
    ),
    "sampled": (
        planted.ROLLERS
        + "  normal_force: {linear: [200 N, 800 N]}\n  rotation_speed: {geometric: [10 rpm, 1000 rpm]}\n"
        "  temperature: {linear: [40 degC, 60 degC]}\nsampling: {latin_hypercube: 9}\n",
        {"realisations": 1},
    ),
    "wear": (
        planted.FRETTING + f"  {planted.RULE}: [exact, fast, limit]\n  stick_radius: 0.45\n  cycles: [0.5, 1, 2, 4]\n",
        {},
    ),
}
#: Letters of a text that stand in the record.
LETTERS = 500
#: What is another every time, or with every version.
PASSING = ("machines", "digests", "rerun", "url")
PASSING_FACTS = ("laid out", "time in the model", "computed by", "last block")


def leaves(tree):
    """Yield the names, words and numbers of nested lists and dictionaries."""
    match tree:
        case dict():
            for name, value in tree.items():
                yield str(name)
                yield from leaves(value)
        case list() | tuple():
            for value in tree:
                yield from leaves(value)
        case None | bool() | str():
            yield str(tree)
        case _:
            yield float(tree)


def rows(name, tree):
    """Words of a part of a page, the end of many as a digest, and its numbers."""
    found = list(leaves(tree))
    words = record.unversioned(" ".join(each for each in found if isinstance(each, str)).replace("\n", "|"))
    numbers = np.arcsinh(1e12 * np.array([each for each in found if not isinstance(each, str)]))
    end = words[LETTERS:] and f" ... {hashlib.sha256(words[LETTERS:].encode()).hexdigest()[:12]}"
    parts = np.array_split(numbers, min(-(-numbers.size // MOST), 4) or 1)
    return {f"{name} words": words[:LETTERS] + end} | {
        f"{name} numbers {k}": part for k, part in enumerate(parts) if part.size
    }


def told(study):
    found = {}
    for field in fields(study):
        value = getattr(study, field.name)
        if field.name in PASSING:
            continue
        if field.name == "facts":
            value = {name: fact for name, fact in value.items() if name not in PASSING_FACTS}
        if field.name == "failures":
            value = [asdict(group) if hasattr(group, "__dataclass_fields__") else tuple(group) for group in value]
        if field.name in ("figures", "laws", "understood"):
            for number, each in enumerate(value):
                each = {name: part for name, part in each.items() if name != "head"} if isinstance(each, dict) else each
                found |= rows(f"{field.name} {number}", each)
            continue
        found |= rows(field.name, value)
    return found


@pytest.mark.parametrize("name", STUDIES)
def test_pages_say_what_they_said(name, tmp_path, monkeypatch, dataframe_regression):
    monkeypatch.chdir(tmp_path)
    text, special = STUDIES[name]
    planted.make(tmp_path, text, **special)
    monkeypatch.setattr(figures, "MOST_POINTS", 700)
    record.check(dataframe_regression, told(read_study("study.zarr")))


def test_the_text_of_a_page_is_what_it_was(toy, tmp_path, monkeypatch, dataframe_regression):
    """Of a study in which some cases failed."""
    monkeypatch.chdir(tmp_path)
    axes = (toy_model.axis("position", [1.0, 2.5, 4.0, 6.5]), toy_model.axis("slope", [0.5, 2.0, 3.0]))
    made = toy_model.campaign(*axes, fail_above=3.0, outputs=("height", "trace", "width"))
    execute.run(made, "toy.zarr", execute.Resources(threads=1), lambda _: None)
    study = read_study("toy.zarr")
    html = re.sub(r"<(script|style)\b.*?</\1>", "", page([study]), flags=re.S)
    words = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", html))
    machines = " ".join(each for each in leaves(study.machines) if isinstance(each, str))
    assert re.search(r"blocks processes time in the model \S+ 1 1 ", machines)
    for passing in (
        r"\d{4}-\d\d-\d\dT[\d:+.]+",
        r"\b[0-9a-f]{64}\b",
        r"Machines .*?History",
        r"this page made .*?zarr",
        r"laid out on \S+",
    ):
        words = re.sub(passing, "...", words)
    words = record.unversioned(re.sub(r"[\d.]+ (ms|s|min)\b|\d+\.\d+\.\d+\S*", "...", words))
    parts = [words[start : start + 1000] for start in range(0, len(words), 1000)]
    record.check(dataframe_regression, told(study) | {f"text {k}": part for k, part in enumerate(parts)})
