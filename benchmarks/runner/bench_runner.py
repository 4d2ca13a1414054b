"""What the runner itself costs: blocks that do next to nothing, and reading what they left."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

import toy

from mdr_dask import store
from mdr_dask.aggregation import aggregate
from mdr_dask.execute import Resources, run
from mdr_dask.store import datasets

BLOCKS = 500


@pytest.fixture
def study(monkeypatch):
    toy.register(monkeypatch)
    axis = toy.axis("position", np.linspace(1.0, 2.0, BLOCKS).tolist())
    return replace(toy.campaign(axis), blocks={"position": 1})


@pytest.fixture
def filled(study, tmp_path):
    url = str(tmp_path / "filled.zarr")
    run(study, url, Resources(), lambda _: None)
    return url


def test_blocks_in_threads(benchmark, study, tmp_path):
    urls = (str(tmp_path / f"{number}.zarr") for number in range(100))
    progress = benchmark.pedantic(lambda: run(study, next(urls), Resources(), lambda _: None), rounds=3)
    assert progress.blocks == BLOCKS
    benchmark.extra_info["ms_a_block"] = 1e3 * progress.wall_seconds / BLOCKS


def test_a_run_with_nothing_to_do(benchmark, study, filled):
    assert benchmark(lambda: run(study, filled, Resources(), lambda _: None)).done == 0


def test_reading_the_ledger(benchmark, filled):
    assert benchmark(lambda: store.ledger(filled, "", (BLOCKS, 6))).shape == (BLOCKS, 6)


def test_aggregating(benchmark, filled):
    reduced = benchmark(lambda: aggregate(datasets(filled)[""]).load())
    assert np.isfinite(reduced.height_mean).all()
