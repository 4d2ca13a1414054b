"""A simple model for tests of the runner: y = a x + noise of the realisation; cases fail on request."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np

from mdr_dask import models
from mdr_dask.campaign import Axis, Campaign, Replication, Series, Tolerance
from mdr_dask.models.base import Block, Coordinate, Model, Output, Parameters, Result, Status, quantity


class ToyParameters(Parameters):
    slope: float = quantity("1", "slope of the line", default=2.0)
    position: float = quantity("m", "position", default=1.0)
    noise: float = quantity("1", "standard deviation over realisations", default=0.5, ge=0)
    fail_above: float = quantity("m", "positions above it fail", default=1e9)
    raise_above: float = quantity("m", "positions above it raise an exception", default=1e9)
    kill_above: float = quantity("m", "positions above it end the process", default=1e9)
    dies_once: str = ""


COMPUTED: list[tuple[float, int]] = []


def compute(block: Block[ToyParameters]) -> Result:
    position, slope = block.column("position"), block.column("slope")
    if (position > block.parameters.raise_above).any():
        raise RuntimeError("position too high")
    if (position > block.parameters.kill_above).any():
        os._exit(1)
    if block.parameters.dies_once and not Path(block.parameters.dies_once).exists():
        Path(block.parameters.dies_once).touch()
        os._exit(1)
    noise = np.array(
        [
            np.random.Generator(np.random.Philox(np.random.SeedSequence(block.seed, spawn_key=(r,)))).standard_normal()
            for r in block.realisations
        ]
    )
    COMPUTED.extend((float(x), r) for x in position for r in block.realisations)
    y = (slope * position)[:, None] + block.column("noise")[:, None] * noise * position[:, None]
    failed = np.broadcast_to((position > block.parameters.fail_above)[:, None], y.shape)
    status = np.where(failed, Status.FAILED, Status.DONE).astype(np.int8)
    height = np.where(failed, np.nan, y)
    values = {"height": height, "trace": height[..., None] * np.arange(3.0)}
    values |= {"width": 2 * height, "width_error": 0.01 * abs(height)}
    messages = {(int(i), int(j)): "position above fail_above" for i, j in zip(*np.nonzero(failed), strict=True)}
    return Result({name: values[name] for name in block.outputs}, status, messages, solves=y.size)


MODEL = Model(
    name="toy",
    version=1,
    summary="a straight line with noise",
    parameters=ToyParameters,
    outputs=(
        Output("height", "m", "height of the line"),
        Output("trace", "m", "multiples of the height", ("multiple",), default=False),
        Output("width", "m", "width of the line", default=False, has_error=True),
    ),
    compute=compute,
    operations=lambda block: 1e3 * block.cases * len(block.realisations),
    coordinates=lambda _: {"multiple": Coordinate(np.arange(3.0), "1", "factor")},
)


def _module() -> ModuleType:
    module = ModuleType("mdr_dask.models.toy")
    module.MODEL = MODEL
    return module


def register(monkeypatch) -> None:
    """Register ``model: toy`` for one test."""
    monkeypatch.setitem(sys.modules, "mdr_dask.models.toy", _module())
    monkeypatch.setattr(models, "NAMES", (*models.NAMES, "toy"))


def install(pause: float = 0.0) -> None:
    """Register ``model: toy`` in this process; every block takes `pause` seconds longer."""

    def slow(block: Block[ToyParameters]) -> Result:
        time.sleep(pause)
        return compute(block)

    module = _module()
    module.MODEL = replace(MODEL, compute=slow) if pause else MODEL
    sys.modules["mdr_dask.models.toy"] = module
    models.NAMES = (*models.NAMES, "toy")


#: Code that registers the model in a worker process.
PRELOAD = f"import sys; sys.path[:0] = [{str(Path(__file__).parent)!r}]; import toy; toy.install()\n"


def axis(path: str, values, dim: str | None = None) -> Axis:
    return Axis(path, path, dim or path, tuple(values), None, "m" if path == "position" else "1", path)


SIX = Replication(6, 6, {})


def campaign(*axes: Axis, name: str = "", realisations=SIX, outputs=("height",), **parameters) -> Campaign:
    first = {a.path: a.values[0] for a in axes}
    series = Series(name, ToyParameters(**{**parameters, **first}), axes)
    return Campaign("toy", "toy", 1, realisations, (series,), tuple(outputs), None, "", {}, "text", "toy.yaml")


__all__ = ["COMPUTED", "MODEL", "PRELOAD", "Replication", "Tolerance", "axis", "campaign", "install", "register"]
