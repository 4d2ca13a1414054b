"""Figures 3.5 and 3.12: the rough line, the elastomer above it, and where they are in contact.

The depth of the first case and realisation comes from the store; the line follows from the seed of the campaign.

python docs/examples/contact.py results/quickstart.zarr contact.png
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

from mdr_dask import models
from mdr_dask import store as stores
from mdr_dask.models.base import Block
from mdr_dask.models.parts.sliding_problem import sliding_problems
from mdr_dask.plots.curves import parameters_at

#: Number of drawn positions for each point of the line, and the fraction of the line that the lower panel shows.
OVERSAMPLING, PART = 8, 0.05


def displacement(penetration: np.ndarray, deborah: float) -> np.ndarray:
    """Return the displacements of a Kelvin body: the largest of all earlier penetrations, each reduced by recovery.

    `penetration` is depth + height at equidistant positions, and `deborah` is v tau divided by their distance.
    """
    place = np.arange(2 * penetration.size) / deborah
    with np.errstate(divide="ignore"):
        pressed = np.log(np.maximum(np.tile(penetration, 2), 0.0)) + place
    return np.exp(np.maximum.accumulate(pressed) - place)[-penetration.size :]


def main(store: str, target: str = "contact.png") -> None:
    """Draw the figure of a store into a file."""
    data = next(iter(stores.datasets(store).values()))
    case = data.isel(dict.fromkeys(data["status"].dims, 0))
    parameters = models.load(case.attrs["model"]).parameters.model_validate(parameters_at(case))
    problems = sliding_problems(Block(parameters, {}, 1, (0,), int(case.attrs["seed"]), ()))
    length, height, waves = problems.length[0], problems.height[0], problems.settings[0].roughness
    waves = waves.waves(int(case.attrs["seed"]), 0)
    count = OVERSAMPLING * waves.points
    line, place = waves.heights(count), np.arange(count) / count
    depth = float(case["indentation_depth"]) / height
    pushed = displacement(depth + line, float(problems.deborah[0]) * count)
    elastomer = np.maximum(pushed - depth, line)
    contact = np.where(elastomer - line < 1e-9 * np.ptp(line), line, np.nan)
    figure, panels = plt.subplots(2, 1, figsize=(9, 5), layout="constrained")
    start = int(np.clip(np.argmax(line) - PART * count / 2, 0, (1 - PART) * count))
    for axes, part in zip(panels, (slice(None), slice(start, start + int(PART * count))), strict=True):
        for values, look, name in (
            (line, "0.5", "rigid line"),
            (elastomer, "C0", "elastomer"),
            (contact, "C1", "contact"),
        ):
            axes.plot(1e3 * length * place[part], 1e6 * height * values[part], color=look, label=name)
        axes.set(xlabel="place [mm]", ylabel="height [µm]")
    panels[0].legend(ncols=3, loc="upper right")
    figure.savefig(target)


if __name__ == "__main__":
    main(*sys.argv[1:])
