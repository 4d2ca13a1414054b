"""What the benchmarks of sliding friction say, on a few cases."""

import importlib
import sys
from pathlib import Path

import pytest


@pytest.fixture
def benchmark_script(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1]))
    yield lambda name: importlib.import_module(f"benchmarks.{name}")
    for name in [name for name in sys.modules if name.partition(".")[0] == "benchmarks"]:
        del sys.modules[name]


def test_error_estimates_beyond_cubic_cells_on_planes_are_honest(benchmark_script):
    """95 % of 500 cases are asked for and were measured; of 60 the part scatters by 3 %."""
    script = benchmark_script("friction.honesty_bodies")
    judged = dict(script.indenters(60, 3, (0.01,))) | dict(script.schemes(60, 3, (0.01,)))
    judged |= dict(script.materials(60, 3, (4, 16))) | dict(script.measured(60, 3, (4,)))
    assert len(judged) == 25
    for share, over, number in judged.values():
        assert number >= 55
        assert share >= 0.87
        assert over <= 14


def test_the_page_of_validity_is_what_its_evidence_says(benchmark_script):
    script = benchmark_script("surfaces.validity")
    assert script.text(512) == script.PAGE.read_text()


def test_a_campaign_finds_grid_and_lines_for_its_accuracy(benchmark_script, tmp_path):
    script = benchmark_script("friction.campaigns")
    scene = "typical: transition"
    truth, lines, _ = script.run(tmp_path, scene, "hermite", 4, 40, 1)
    assert truth.shape == (4, 4)
    assert lines.min() == 40
    error, lines, seconds = script.measured(tmp_path, scene, truth, 8, 1, "hermite", "auto", 0.05)
    assert error < 0.05
    assert lines == 8
    assert seconds > 0
    middle, most = script.picked(tmp_path, scene, 0.05)
    assert 0 < middle <= most <= 0.05
