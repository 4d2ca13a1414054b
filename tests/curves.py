"""A model of smooth and awkward curves, y = f(x) + noise of the realisation, to test adaptive axes."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Literal

import numpy as np

from mdr_dask import models
from mdr_dask.models.base import Block, Model, Output, Parameters, Result, Status, quantity

Shape = Literal["smooth", "kink", "jump", "flat", "gap", "knee"]
FUNCTIONS = {
    "smooth": lambda x, shift: np.tanh(np.log10(x) - shift),
    "kink": lambda x, shift: np.abs(np.log10(x) - shift),
    "jump": lambda x, shift: np.where(np.log10(x) < shift, 1.0, 2.0),
    "flat": lambda x, shift: np.ones_like(x),
    "gap": lambda x, shift: np.tanh(np.log10(x) - shift),
    "knee": lambda x, shift: 1 / np.sqrt(1 + 10 ** (2 * (shift - np.log10(x)))),
}


class Curve(Parameters):
    x: float = quantity("m", "abscissa", default=1.0)
    shift: float = quantity("1", "place of the curve", default=0.3)
    noise: float = quantity("1", "scatter over realisations", default=0.0)
    shape: Shape = "smooth"


def compute(block: Block[Curve]) -> Result:
    x, shift, noise = block.column("x"), block.column("shift"), block.column("noise")
    shapes = block.column("shape")
    y = np.array([float(FUNCTIONS[shape](a, b)) for a, b, shape in zip(x, shift, shapes, strict=True)])
    values = np.repeat(y[:, None], len(block.realisations), axis=1)
    for case in range(block.cases):
        for column, number in enumerate(block.realisations):
            key = np.frombuffer(np.float64(x[case]).tobytes(), dtype=np.uint32).tolist()
            seed = np.random.SeedSequence([block.seed, *key], spawn_key=(number,))
            values[case, column] += noise[case] * np.random.Generator(np.random.Philox(seed)).standard_normal()
    failed = np.repeat(((shapes == "gap") & (x > 1.0) & (x < 20.0))[:, None], values.shape[1], axis=1)
    status = np.where(failed, Status.FAILED, Status.DONE).astype(np.int8)
    values[failed] = np.nan
    found = {"y": values, "half": values / 2}
    return Result({name: found[name] for name in block.outputs}, status, solves=values.size)


MODEL = Model(
    name="curves",
    version=1,
    summary="curves that interpolation finds easy and hard",
    parameters=Curve,
    outputs=(Output("y", "1", "height of the curve"), Output("half", "1", "half of it", default=False)),
    compute=compute,
    operations=lambda block: 1e3 * block.cases * len(block.realisations),
)


def register(monkeypatch) -> None:
    """Register ``model: curves`` for one test."""
    module = ModuleType("mdr_dask.models.curves")
    module.MODEL = MODEL
    monkeypatch.setitem(sys.modules, "mdr_dask.models.curves", module)
    monkeypatch.setattr(models, "NAMES", (*models.NAMES, "curves"))
