"""A block is one task and one file of each array."""

from dataclasses import replace
from pathlib import Path

from mdr_dask.execute import Resources, run


def test_a_block_is_one_task_and_one_file_of_every_array(toy, url):
    """Six blocks of two cases and three realisations; a second run computes nothing."""
    study = toy.campaign(toy.axis("position", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))
    progress = run(replace(study, blocks={"position": 2, "realisation": 3}), url, Resources(), lambda _: None)
    assert progress.blocks == 6
    assert len(toy.COMPUTED) == progress.solves == 36
    assert sum(path.is_file() for path in Path(url, "height", "c").rglob("*")) == 6
    assert run(study, url, Resources(), lambda _: None).blocks == 0
    assert len(toy.COMPUTED) == 36
