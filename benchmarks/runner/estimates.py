"""How right the estimates of time are: ``python -m benchmarks runner estimates [BLOCKS] [CAMPAIGN...]``.

Of every series of a campaign some blocks are computed, drawn with a chance in proportion to their estimate, so that the
mean of measured over estimated is the ratio of the whole series. Long blocks are tried with fewer realisations.
Processor time is used because it does not count what other programs took meanwhile.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mdr_dask import models
from mdr_dask.campaign import load
from mdr_dask.models.base import Block, Model
from mdr_dask.plan import Template, templates
from mdr_dask.task import _one_blas_thread

LONGEST = 4.0  # seconds by the estimate: longer blocks lose realisations


def shortened(model: Model[Any], block: Block[Any]) -> Block[Any]:
    while model.seconds(block) > LONGEST and len(block.realisations) > 1:
        block = replace(block, realisations=block.realisations[: len(block.realisations) // 2])
    return block


def ratios(template: Template, blocks: int) -> tuple[float, list[float]]:
    """Return the estimate of a series in seconds, and measured over estimated of some of its blocks."""
    model = models.load(template.campaign.model)
    indices = [(*index, 0) for index in np.ndindex(template.grid[:-1])]
    seconds = np.array([template.seconds(index) for index in indices])
    total = float(seconds.sum()) * max(template.sizes["realisation"] / template.chunks["realisation"], 1.0)
    draw = np.random.default_rng(1).choice(len(indices), min(blocks, len(indices)), p=seconds / seconds.sum())
    model.compute(template.block(indices[draw[0]]).part(0, 0))  # compiled and loaded
    found = []
    for position in draw:
        block = shortened(model, template.block(indices[position]))
        start = time.thread_time()
        model.compute(block)
        found.append((time.thread_time() - start) / model.seconds(block))
    return total, found


def main(blocks: int, paths: list[str]) -> None:
    _one_blas_thread()
    print(f"{'campaign':26s} {'series':14s} {'estimate':>10s} {'measured':>10s} {'ratio':>7s}  least, largest")
    for path in paths or sorted(map(str, Path("campaigns").glob("*.yaml"))):
        campaign = load(path)
        estimated = measured = 0.0
        for template in templates(campaign, campaign.replication.at_least):
            total, found = ratios(template, blocks)
            estimated, measured = estimated + total, measured + total * float(np.mean(found))
            name = template.series.name or "-"
            print(
                f"{campaign.name:26s} {name:14s} {total:10.3g} {total * np.mean(found):10.3g} {np.mean(found):7.2f}  "
                f"{min(found):.2f}, {max(found):.2f}",
                flush=True,
            )
        print(f"{campaign.name:26s} {'all':14s} {estimated:10.3g} {measured:10.3g} {measured / estimated:7.2f}\n")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3, sys.argv[2:])
