"""The page of a study as a file: what it holds, what it lets in, and where its numbers come from."""

import base64
import io
import re
import zipfile
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pandas as pd
import planted
import pytest
import toy as toy_model
import xarray as xr

from mdr_dask import aggregation, fits, plots, store
from mdr_dask.campaign import loads
from mdr_dask.cli import main
from mdr_dask.execute import Resources, run
from mdr_dask.models.base import Output
from mdr_dask.plots import labels
from mdr_dask.report.page import page

FRICTION = """\
# rubber & glass: <b>bold</b>
name: small
model: sliding_friction
seed: 7
realisations: 4
parameters:
  length: 20 mm
  points: 100
  hurst: 0.7
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  normal_force: [0.1 N, 1 N, 10 N]
  velocity: {geometric: [1 mm/s, 10 m/s, 5]}
outputs: [friction_coefficient, contact_fraction, rms_slope]
"""
#: Text that would run a script if it were inserted as markup.
HOSTILE = "</script><script>window.ran = 1</script><img src=x onerror='window.ran = 2'><b>$x_1$"
#: Numbers of the page have nine digits.
DIGITS = 6e-9
PICTURE = re.compile(r'<img src="data:image/svg\+xml;base64,([^"]+)" alt="([^"]+)">')
TABLES = re.compile(r'href="data:application/zip;base64,([^"]+)" download="figures.zip"')


def rows(html, title):
    """Return the rows of the first table whose title begins with a text."""
    found = re.search(rf"<h4>{re.escape(title)}.*?<tbody>(.*?)</tbody>", html, flags=re.S)[1]
    return [[unescape(cell) for cell in re.findall(r"<td>(.*?)</td>", row)] for row in found.split("<tr>")[1:]]


def hostile(url, monkeypatch):
    """Run a study whose names, descriptions and messages contain markup; half of its cases fail."""

    def compute(block):
        result = toy_model.compute(block)
        return replace(result, messages=dict.fromkeys(result.messages, HOSTILE))

    output = Output("height", "m", f"height {HOSTILE}")
    model = replace(toy_model.MODEL, outputs=(output,), compute=compute, summary=HOSTILE)
    monkeypatch.setattr(toy_model, "MODEL", model)
    toy_model.register(monkeypatch)
    axes = (toy_model.axis("position", [1.0, 2.0, 3.0, 4.0]), toy_model.axis("slope", [1.0, 2.0]))
    made = toy_model.campaign(*axes, fail_above=2.5)
    run(replace(made, name=HOSTILE, text=f"# {HOSTILE}"), url, Resources(threads=1), lambda _: None)


@pytest.fixture(scope="module")
def url(tmp_path_factory):
    place = str(tmp_path_factory.mktemp("report") / "small.zarr")
    run(loads(FRICTION, "small.yaml", "."), place, Resources(threads=2), lambda _: None)
    return place


@pytest.fixture(scope="module")
def html(url):
    return page([url])


def test_a_page_is_one_file_without_scripts(html):
    """Pictures and the zip are part of the page, and all other links lead to places on the page."""
    assert "default-src 'none'; style-src 'unsafe-inline'; img-src data:;" in html
    assert PICTURE.search(html)
    rest = TABLES.sub("", PICTURE.sub("", html))
    assert not re.search(r"<(script|img|link|iframe|object|embed|base)\b|\bon\w+=|@import|url\(", rest)
    assert all(target.startswith("#") for target in re.findall(r'(?:href|src)="([^"]*)"', rest))
    assert len(html.encode()) < 1e6


def test_figures_are_pictures_with_the_tables_of_plot(html, url):
    groups, drawn = store.datasets(url), []
    with zipfile.ZipFile(io.BytesIO(base64.b64decode(TABLES.search(html)[1]))) as packed:
        for name, summary in (alt.split(": ", 1) for _, alt in PICTURE.findall(html)):
            name = name.replace(" ", "_")
            figure = plots.available("sliding_friction")[name]
            assert figure.summary == unescape(summary)
            shown = pd.read_csv(packed.open(f"{name}.csv"), comment="#")
            table = pd.read_csv(io.StringIO(figure.figure(groups).csv()), comment="#")
            pd.testing.assert_frame_equal(shown, table, rtol=DIGITS)
            drawn.append(name)
    assert {"velocity", "force"} <= set(drawn)
    for picture, _ in PICTURE.findall(html):
        assert b"<svg" in base64.b64decode(picture)


def test_a_law_has_its_verdict(html, url):
    (result,) = fits.available("sliding_friction")["plateau"].results(store.datasets(url)).values()
    held = {cell for row in rows(html, "plateau: ") for cell in row}
    assert {str(text) for text in np.ravel(result["law_holds"])} <= held


def test_the_page_holds_the_campaign_the_counts_and_the_errors(html, url):
    assert "rubber &amp; glass: &lt;b&gt;bold&lt;/b&gt;" in html  # the campaign as written
    assert "<dd>60 of 60 (100%)</dd>" in html
    assert "Physical Review Letters 111" in html
    assert rows(html, "Results in each state")[0][1:3] == ["60", "0"]
    data = xr.open_zarr(url).load()
    mean, lines = data.friction_coefficient.mean("realisation"), aggregation.standard_error(data.friction_coefficient)
    grid = aggregation.grid_error(data.friction_coefficient_error)
    shares = [lines / mean, lines / mean, grid / mean, grid / mean, grid / (lines + grid)]
    reduced = zip(shares, ("median", "max", "median", "max", "median"), strict=True)
    (row,) = (row for row in rows(html, "Outputs") if row[0] == "friction_coefficient")
    assert ", ".join(row[2:]).split(", ") == [f"{100 * float(getattr(share, name)()):.2g} %" for share, name in reduced]


def test_large_studies_are_drawn_from_a_part_of_their_cases(url, monkeypatch):
    monkeypatch.setattr("mdr_dask.report.page.MOST_CASES", 8)
    html = page([url])
    assert html.count("spread evenly") >= len(PICTURE.findall(html)) > 0
    assert f"use mdr-dask fit {url} NAME" in html
    assert "60 of 60" in html
    with zipfile.ZipFile(io.BytesIO(base64.b64decode(TABLES.search(html)[1]))) as packed:
        shown = pd.read_csv(packed.open("velocity.csv"), comment="#")
    assert len(np.unique(shown["velocity"])) < 5


def test_differences_of_temperatures_are_in_kelvin_and_temperatures_as_written(tmp_path):
    material = "material: {standard_solid: {static_modulus: 3 MPa, glass_modulus: 1 GPa, relaxation_time: 1 us}"
    material += ", wlf: {c1: 8.86, c2: 101.6 K, reference: 20 degC}, temperature: [20 degC, 40 degC]}"
    text = planted.SLIDING.replace("  shear_modulus: 10 MPa\n  relaxation_time: 1 ms\n", f"  {material}\n")
    planted.make(tmp_path, text + "  normal_force: 1 N\n  velocity: [1 mm/s, 10 mm/s]\n")
    values = {row[0]: row[2] for row in rows(page([str(tmp_path / "study.zarr")]), "Parameters")}
    assert values["material_wlf_c2"] == "101.6 K"
    assert values["material_temperature"] == "20 degC, 40 degC"
    assert values["velocity"] == "1 mm/s, 10 mm/s"


def test_texts_of_a_store_stay_texts(tmp_path, monkeypatch):
    place = str(tmp_path / "hostile.zarr")
    hostile(place, monkeypatch)
    html = page([place])
    assert PICTURE.search(html)
    rest = PICTURE.sub("", html)
    assert "<script" not in rest
    assert "<img" not in rest
    assert rest.count("&lt;img src=x") >= 4  # title, campaign, summary, message
    assert labels.plain(HOSTILE) in unescape(rest)


def test_a_page_is_made_while_half_of_the_study_is_missing(tmp_path, toy):
    place = str(tmp_path / "half.zarr")
    made = toy.campaign(toy.axis("position", [1.0, 2.0, 3.0]), outputs=("height", "width", "width_error"))
    run(made, place, Resources(threads=1), lambda _: None)
    next(file for file in Path(place, "status/c").rglob("0") if file.is_file()).unlink()
    assert "are missing" in page([place])


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
