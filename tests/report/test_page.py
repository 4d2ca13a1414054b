"""The page of a study as a file: what it holds, what it lets in, and where its numbers come from."""

import base64
import hashlib
import json
import re
from pathlib import Path

import numpy as np
import planted
import pytest
import xarray as xr
from report_stores import HOSTILE, friction, hostile

from mdr_dask import aggregation, fits, plots, store
from mdr_dask.cli import main
from mdr_dask.execute import Resources, run
from mdr_dask.report import cases, figures, page, read_study, words

#: Numbers of the page have nine digits.
DIGITS = 6e-9
SCRIPT = re.compile(r"<script(?P<type>[^>]*)>(?P<text>.*?)</script>", flags=re.S)


@pytest.fixture(scope="module")
def url(tmp_path_factory):
    place = str(tmp_path_factory.mktemp("report") / "small.zarr")
    friction(place)
    return place


@pytest.fixture(scope="module")
def study(url):
    return read_study(url)


@pytest.fixture(scope="module")
def html(study):
    return page([study])


def test_constants_stand_under_their_names_and_units(study):
    """Pure numbers have none; every law of the page is the table of its fit."""
    slow = ("collapse", "master_curve")  # are fitted as the others, and take ten times as long
    laws = [table for table in study.laws if not table.title.startswith(slow)]
    known = fits.available("sliding_friction")
    assert laws
    for table in laws:
        (found,) = known[table.title.split(":")[0].split(" ")[0]].results(store.datasets(study.url)).values()
        for heading in table.headings[len(found.sizes) :]:
            name, _, unit = heading.partition(" [")
            assert unit.removesuffix("]") == found[name].attrs.get("units", "1").replace("1", ""), heading


def test_a_page_is_one_file_that_names_no_other(html):
    without = SCRIPT.sub("", html)
    assert not re.search(
        r"(src|srcset|action|formaction|poster|data)=|<(link|iframe|object|embed|base)\b|@import|url\(", without
    )
    assert all(target.startswith("#") for target in re.findall(r'href="([^"]*)"', without))
    assert len(html.encode()) < 3e6


def test_the_policy_names_every_script_of_the_page_and_nothing_else(html):
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', html)[1].replace("&#39;", "'")
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert rules["default-src"] == rules["connect-src"] == "'none'"
    run = [found["text"] for found in SCRIPT.finditer(html) if "application/json" not in found["type"]]
    digests = {f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'" for text in run}
    assert set(rules["script-src"].split()) == digests


def test_figures_of_the_page_hold_what_their_tables_hold(url, study):
    drawn = plots.available("sliding_friction")["velocity"].figure(store.datasets(url))
    table = drawn.table()
    shown = next(figure for figure in study.figures if figure["name"] == "velocity")
    for name in ("x", "y", "y_low", "y_high"):
        held = sorted(value for trace in shown["traces"] for value in trace.get(name, []) if value is not None)
        np.testing.assert_allclose(held, np.sort(table[name].dropna()), rtol=DIGITS)
    at = {name: unit for name, unit in table.attrs["units"].items() if name in shown["parameters"]}
    assert at["normal_force"] == shown["parameters"]["normal_force"]["unit"] == "N"


def test_cases_hold_the_means_and_both_errors_of_the_store(url):
    (data,) = store.datasets(url).values()
    (series,) = cases.cases_of(store.datasets(url), {"": []})
    mean = data["friction_coefficient"].mean("realisation")
    scatter = data["friction_coefficient"].std("realisation", ddof=1) / 2
    grid = data["friction_coefficient_error"].mean("realisation")
    held = series["values"]["friction_coefficient"]
    for name, expected in (("value", mean), ("lines", scatter), ("grid", grid)):
        np.testing.assert_allclose(held[name], expected.to_numpy().ravel(), rtol=DIGITS)
    assert np.all(np.array(held["low"]) <= held["value"])
    np.testing.assert_allclose(series["at"]["velocity"], np.tile(data["velocity"], 3), rtol=DIGITS)


def test_long_figures_are_thinned_out_and_say_so(url, monkeypatch):
    monkeypatch.setattr(figures, "MOST_POINTS", 9)
    drawn = plots.available("sliding_friction")["velocity"].describe(store.datasets(url))
    shown = figures.figure_data("velocity", "", drawn, {})
    assert sum(len(trace["x"]) for trace in shown["traces"]) < 20
    assert "points is on this page" in shown["left_out"]
    for full, thin in zip(drawn.panels[0].traces, shown["traces"], strict=True):
        assert thin["x"][-1] == pytest.approx(np.max(full.column("x")), rel=1e-8)


def test_pages_of_large_studies_are_made_from_a_part_of_their_results(url, monkeypatch):
    monkeypatch.setattr(cases, "MOST_CASES", 8)
    study = read_study(url)
    assert all("spread evenly" in figure["left_out"] for figure in study.figures)
    assert study.not_fitted == [("all laws", f"the study is large; use mdr-dask fit {url} NAME")]
    assert "60 of 60" in study.facts["results"]
    velocities = {value for trace in study.figures[0]["traces"] for value in np.ravel(trace["of"]["velocity"])}
    assert len(velocities) < 5


def test_differences_of_temperatures_are_in_kelvin_and_temperatures_as_written(tmp_path):
    material = "material: {standard_solid: {static_modulus: 3 MPa, glass_modulus: 1 GPa, relaxation_time: 1 us}"
    material += ", wlf: {c1: 8.86, c2: 101.6 K, reference: 20 degC}, temperature: [20 degC, 40 degC]}"
    text = planted.SLIDING.replace("  shear_modulus: 10 MPa\n  relaxation_time: 1 ms\n", f"  {material}\n")
    planted.make(tmp_path, text + "  normal_force: 1 N\n  velocity: [1 mm/s, 10 mm/s]\n")
    study = read_study(str(tmp_path / "study.zarr"))
    fixed = {row[0]: row[2] for table in study.understood for row in table.rows if table.title == "Fixed parameters"}
    assert fixed["material_wlf_c2"] == "101.6 K"
    axes = {row[0]: row[3] for table in study.understood for row in table.rows if table.title == "Axes"}
    assert axes["material_temperature"] == "20 degC, 40 degC"
    assert axes["velocity"] == "1 mm/s, 10 mm/s"
    assert study.cases[0]["axes"]["velocity"]["unit"] == "mm/s"


@pytest.mark.parametrize(
    ("label", "expected"),
    [
        ("normal force $F_N$ [N]", "normal force F<sub>N</sub> [N]"),
        (r"$\Delta\mu_{12}$ & <i>", "Δμ<sub>12</sub> &amp; &lt;i&gt;"),
        (r"$a^{1/(1+H)} \, b$", "a<sup>1/(1+H)</sup> b"),
        ("a price: 5 $ <b>", "a price: 5 $ &lt;b&gt;"),
        (r"$<script>_{<img>}$", "&lt;script&gt;<sub>&lt;img&gt;</sub>"),
    ],
)
def test_labels_become_markup_of_two_tags_only(label, expected):
    assert words.markup(label) == expected


def test_texts_of_a_store_stay_texts(tmp_path, monkeypatch):
    place = str(tmp_path / "hostile.zarr")
    hostile(place, monkeypatch)
    html = page([read_study(place)])
    assert html.count("<script") == len(list(SCRIPT.finditer(html))) == 6
    without = SCRIPT.sub("", html)
    assert "<img" not in without
    assert without.count("&lt;img src=x") >= 4  # title, campaign, summary, message
    held = json.loads(SCRIPT.findall(html)[0][1])
    assert HOSTILE in held[0]["title"]


def test_the_sections_hold_the_campaign_the_counts_and_the_errors(html, study, url):
    text = re.sub(r"<[^>]+>", " ", SCRIPT.sub("", html))
    assert "rubber &amp; glass: &lt;b&gt;bold&lt;/b&gt;" in text  # the campaign as written
    assert "60 of 60 (100%): 60 done" in text
    assert hashlib.sha256(store.attributes(url)["campaign"].encode()).hexdigest() in text
    assert html.count("<math") == len(study.subject.equations) > 0
    (errors,) = study.errors
    data = xr.open_zarr(url).load()
    mean, lines = data.friction_coefficient.mean("realisation"), aggregation.standard_error(data.friction_coefficient)
    grid = aggregation.grid_error(data.friction_coefficient_error)
    shares = [lines / mean, lines / mean, grid / mean, grid / mean, grid / (lines + grid)]
    reduced = zip(shares, ("median", "max", "median", "max", "median"), strict=True)
    (row,) = (row for row in errors.rows if row[0] == "friction_coefficient")
    assert row[1:] == [f"{100 * float(getattr(share, name)()):.2g} %" for share, name in reduced]


def test_a_page_is_made_while_half_of_the_study_is_missing(tmp_path, toy):
    place = str(tmp_path / "half.zarr")
    made = toy.campaign(toy.axis("position", [1.0, 2.0, 3.0]), outputs=("height", "width", "width_error"))
    run(made, place, Resources(threads=1), lambda _: None)
    next(file for file in Path(place, "status/c").rglob("0") if file.is_file()).unlink()
    study = read_study(place)
    assert "missing" in study.facts["results"]
    assert "toy" in page([study])


@pytest.mark.slow
def test_the_command_writes_a_page_of_several_studies(url, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["report", url, url, "-o", "both.html"]) == 0
    assert capsys.readouterr().out == "both.html\n"
    assert Path("both.html").read_text().count("<article") == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["nothing.zarr"], "nothing.zarr: no store here"), (["{url}", "-o", "page.pdf"], "ends in .html or .htm")],
)
def test_what_cannot_be_reported_is_refused_and_nothing_is_written(url, arguments, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["report", *(argument.format(url=url) for argument in arguments)]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
