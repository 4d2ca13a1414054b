"""The page in a real browser without a network: what is drawn, said and chosen, and who can read it."""

import math
import re
import time

import pytest
from browser import PATIENCE, Browser, program
from report_stores import friction, hostile

from mdr_dask import aggregation, store
from mdr_dask.report import page, read_study

pytestmark = [pytest.mark.slow, pytest.mark.skipif(program() is None, reason="no Chromium (apt-get install chromium)")]
VELOCITY = "report.figures.find((figure) => figure.spec.name === 'velocity')"


@pytest.fixture(scope="module")
def browser():
    started = Browser()
    yield started
    started.close()


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("browser")
    friction(str(folder / "small.zarr"))
    (folder / "page.html").write_text(page([read_study(str(folder / "small.zarr"))]), encoding="utf-8")
    return folder


@pytest.fixture
def opened(browser, place):
    browser.size(1200)
    browser.media()
    browser.open((place / "page.html").as_uri())
    browser.until("report.figures.length > 3")
    return browser


def draw_all(browser):
    browser.js("report.figures.forEach((figure) => figure.come())")
    browser.until("document.querySelectorAll('.panel .main-svg').length >= 3 * report.figures.length")


def test_all_figures_are_drawn_without_a_complaint_or_a_request(opened, place):
    draw_all(opened)
    assert opened.told == []
    assert opened.requests == [(place / "page.html").as_uri()]
    assert opened.js(f"{VELOCITY}.plots[0].querySelectorAll('.scatterlayer .trace').length") >= 3


def test_hover_shows_the_numbers_of_the_store(opened, place):
    opened.js("document.querySelector('[data-choose]').scrollIntoView({ behavior: 'instant' })")
    opened.until("!!document.querySelector('[data-choose] .points path')")
    said, end = None, time.monotonic() + PATIENCE
    while not said:  # figures above are drawn meanwhile, and move the point
        assert time.monotonic() < end, "no hover"
        x, y = opened.js(
            "(() => { const box = document.querySelector('[data-choose] .points path').getBoundingClientRect();"
            " return [box.x + box.width / 2, box.y + box.height / 2]; })()"
        )
        opened.mouse(x + 60, y)
        opened.mouse(x, y)
        time.sleep(0.2)
        said = opened.js("document.querySelector('[data-choose] .hoverlayer .hovertext')?.textContent")
    (data,) = store.datasets(str(place / "small.zarr")).values()
    means = aggregation.mean(data["friction_coefficient"])
    shown = [float(number) for number in re.findall(r"friction: (\S+) \[", said)]
    assert len(shown) == 1
    assert any(math.isclose(shown[0], mean, rel_tol=1e-4) for mean in means.to_numpy().ravel())
    assert "normal force" in said
    assert "velocity" in said


def test_a_choice_changes_the_figure(opened):
    choose = "report.figures.at(-1)"
    opened.until(f"{choose}.spec.panels.length === 1")
    before = opened.js(f"JSON.stringify({choose}.spec.traces.map((trace) => trace.x))")
    opened.js(
        "(() => { const field = document.querySelector('[data-field=Against]'); field.value = 'normal_force';"
        " field.dispatchEvent(new Event('change')); })()"
    )
    assert opened.js(f"JSON.stringify({choose}.spec.traces.map((trace) => trace.x))") != before
    draw_all(opened)
    shown = f"{VELOCITY}.plots[0].data.length"
    all_curves = opened.js(shown)
    opened.js(f"{VELOCITY}.host.querySelector('.curves input').click()")
    assert opened.js(shown) < all_curves
    opened.js(f"{VELOCITY}.host.querySelector('[data-field=\"log y\"]').click()")
    assert opened.js(f"{VELOCITY}.plots[0].layout.yaxis.type") == "log"
    text = opened.js(f"{VELOCITY}.csv()")
    assert text.splitlines()[0].startswith("# mdr_dask: ")
    assert opened.js(f"{VELOCITY}.svg().then((made) => made.text.includes('<svg x='))")


def test_the_keyboard_reaches_what_the_mouse_reaches(opened):
    opened.press("Tab")
    assert opened.js("document.activeElement.className") == "skip"
    opened.js(f"{VELOCITY}.host.querySelector('.curves input').focus()")
    before = opened.js(f"{VELOCITY}.state.hidden.size")
    opened.press(" ", " ")
    assert opened.js(f"{VELOCITY}.state.hidden.size") == before + 1
    opened.js(f"{VELOCITY}.host.querySelector('summary').focus()")
    opened.press("Enter", "\r")
    rows = opened.until(f"{VELOCITY}.host.querySelectorAll('tbody tr').length")
    assert rows == min(500, opened.js(f"[...{VELOCITY}.rows()].length"))


def test_paper_has_every_figure_in_black_on_white(opened, tmp_path):
    opened.media(scheme="dark")
    opened.pdf(tmp_path / "page.pdf")
    assert opened.js("report.figures.every((figure) => figure.here)")
    assert (tmp_path / "page.pdf").stat().st_size > 50_000


def test_no_script_of_a_store_runs(browser, tmp_path, monkeypatch):
    hostile(str(tmp_path / "hostile.zarr"), monkeypatch)
    (tmp_path / "page.html").write_text(page([read_study(str(tmp_path / "hostile.zarr"))]), encoding="utf-8")
    browser.open((tmp_path / "page.html").as_uri())
    browser.until("report.figures.length")
    draw_all(browser)
    browser.js("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    assert browser.js("window.ran ?? null") is None
    assert browser.js("document.images.length") == 0
    assert "<script>window.ran" in browser.js("document.querySelector('h1').textContent")
    assert browser.told == []
