"""Stores of many blocks: what is opened and decoded grows no faster than it must, and nothing is overlooked for it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import toy
import zarr

from mdr_dask import store
from mdr_dask.cli import main
from mdr_dask.execute import Resources, run
from mdr_dask.store import ledgers


@pytest.fixture
def url(tmp_path, monkeypatch):
    """A store of 7 x 3 blocks, the last ones cut, in which one case fails."""
    toy.register(monkeypatch)
    campaign = toy.campaign(toy.axis("position", np.arange(1.0, 14.0).tolist()), fail_above=12.5)
    url = str(tmp_path / "many.zarr")
    run(
        replace(campaign, blocks={"position": 2, "realisation": 2}, replication=toy.Replication(5, 5, {})),
        url,
        Resources(),
        lambda _: None,
    )
    return url


def plain(url):
    return zarr.open_group(url, mode="r")["status"][...]


def test_the_ledger_is_that_of_zarr_and_each_different_chunk_is_decoded_once(url, monkeypatch):
    shapes, array_of = [], ledgers.array_of
    monkeypatch.setattr(
        ledgers, "array_of", lambda shown, *more: shapes.append(shown["shape"]) or array_of(shown, *more)
    )
    expected = plain(url)
    assert np.array_equal(store.ledger(url, ""), expected)
    assert np.array_equal(store.ledger(url, "", (4, 2)), expected[:4, :2])
    grown = store.ledger(url, "", (15, 6))
    assert np.array_equal(grown[:13, :5], expected)
    assert not grown[13:].any()
    assert not grown[:, 5:].any()
    assert max(shape[0] for shape in shapes) <= 2 * 5 < 2 * 21  # nothing, whole, cut at the end of an axis, failed


def test_a_ledger_that_lacks_chunks_is_that_of_zarr(url):
    for place in ("0/0", "3/1", "6/2"):
        Path(url, "status/c", place).unlink()
    assert (plain(url) == 0).any()
    assert np.array_equal(store.ledger(url, "", (13, 5)), plain(url))


def test_a_missing_chunk_of_a_finished_block_is_named_before_anything_is_read(url, capsys):
    Path(url, "height/c/2/1").unlink()
    for command in ("status", "show"):
        assert main([command, url]) == 2
        assert "height/c/2/1 is missing" in capsys.readouterr().err
