"""Error of whole campaigns against core-seconds: ``python -m benchmarks friction campaigns [FIGURE.png]``.

Easy, typical and hard campaigns of sixteen cases go through the runner into stores on disk, on one thread. The error is
that of the mean friction, discretisation and statistics together: rms over cases and seeds, relative to the mean of
1000 other lines at an accuracy of 0.5 %. Time is the processor time of the run, runner and writing included.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.measures import print_table, timed
from mdr_dask import execute, store
from mdr_dask.campaign import load

CAMPAIGN = """
name: {name}
model: sliding_friction
seed: {seed}
realisations: {realisations}
parameters:
  length: 20 mm
  points: 2000
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  hurst: {hurst}
  normal_force: {{geometric: [{force}, 4]}}
  velocity: {{geometric: [10 mm/s, 1 m/s, 4]}}
  scheme: {scheme}
  oversampling: {grid}
accuracy: {accuracy}
outputs: [{outputs}]
"""
#: name: (Hurst exponent, forces)
SCENES = {
    "easy: full contact": (0.7, "20 N, 200 N"),
    "typical: transition": (0.7, "0.3 N, 3 N"),
    "hard: rough, low load": (0.2, "1 mN, 10 mN"),
}
#: legend: (scheme, oversampling)
GRIDS = {
    "thesis: backward Euler, grid 1": ("backward_euler", 1),
    "straight cells, grid 4": ("piecewise_linear", 4),
    "cubic cells, grid 1": ("hermite", 1),
    "cubic cells, grid 4": ("hermite", 4),
    "cubic cells, grid 16": ("hermite", 16),
    "accuracy 5 %": ("hermite", "auto"),
}
LINES, MOST_SEEDS, TRUTH = (4, 16, 64, 256), 4, 1000
WANTED = (0.1, 0.05, 0.02)
SEED_OF_TRUTH = 99
FLOOR = 1e-5  # of errors drawn: full contact is exact on any grid of cubic cells


def run(folder, scene, scheme, grid, realisations, seed, accuracy=0.05, output="friction_coefficient"):
    """Run a campaign of a scene; return its mean output of every case, lines of every case and processor seconds."""
    hurst, force = SCENES[scene]
    numbers = {"realisations": realisations, "seed": seed, "accuracy": accuracy, "hurst": hurst, "force": force}
    numbers["outputs"] = "friction_coefficient"
    path = Path(folder, "campaign.yaml")
    path.write_text(CAMPAIGN.format(name="benchmark", scheme=scheme, grid=grid, **numbers))
    url = tempfile.mkdtemp(dir=folder) + "/store.zarr"
    progress, seconds = timed(lambda: execute.run(load(path), url, execute.Resources(threads=1), lambda _: None))
    assert progress.failed == 0
    friction = store.datasets(url)[""][output].load()
    return friction.mean("realisation").values, friction.count("realisation").values, seconds


def measured(folder, scene, truth, realisations, seeds, scheme, grid, accuracy=0.05):
    """Return rms error over cases and seeds, mean number of lines and mean processor seconds."""
    runs = [run(folder, scene, scheme, grid, realisations, seed, accuracy) for seed in range(seeds)]
    errors, lines, seconds = (np.array(column) for column in zip(*runs, strict=True))
    return float(np.sqrt(np.mean((errors / truth - 1) ** 2))), float(lines.mean()), float(seconds.mean())


def fixed(folder, scene, truth):
    """Return {legend: [(error, lines, seconds)]} of campaigns with as many lines for every case."""
    return {
        legend: [
            measured(folder, scene, truth, lines, min(MOST_SEEDS, LINES[-1] // lines), scheme, grid) for lines in LINES
        ]
        for legend, (scheme, grid) in GRIDS.items()
    }


def chosen(folder, scene, truth):
    """Return [(accuracy, error estimates, error, lines, seconds)] of campaigns told nothing but their accuracy."""
    rows = []
    for accuracy in WANTED:
        until = f"{{at_least: 10, at_most: 4096, until: {{friction_coefficient: {accuracy}}}}}"
        result = measured(folder, scene, truth, until, MOST_SEEDS, "hermite", "auto", accuracy)
        rows.append((accuracy, picked(folder, scene, accuracy), *result))
    return rows


def picked(folder, scene, accuracy):
    """Return median and largest error estimate that `auto` stops at, in the first line of the cases."""
    friction, error = (
        run(folder, scene, "hermite", "auto", 1, 0, accuracy, output)[0]
        for output in ("friction_coefficient", "friction_coefficient_error")
    )
    estimate = error / friction
    return float(np.median(estimate)), float(estimate.max())


def draw(tables, path):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 4.4), layout="constrained")
    for axes, (scene, (grids, accuracies)) in zip(
        figure.subplots(1, len(tables), sharey=True), tables.items(), strict=True
    ):
        for legend, rows in grids.items():
            errors, _, seconds = zip(*rows, strict=True)
            axes.loglog(seconds, np.maximum(errors, FLOOR), "o-", ms=4, lw=1, label=legend)
        for place, (accuracy, _, error, lines, seconds) in enumerate(accuracies):
            axes.loglog([seconds], [max(error, FLOOR)], "k*", ms=10)
            axes.annotate(
                f"{accuracy:.0%}, {lines:.0f} lines",
                (seconds, max(error, FLOOR)),
                fontsize="x-small",
                xytext=(5, 5 + 9 * place),
                textcoords="offset points",
            )
        axes.set(title=scene, xlabel="processor time of the campaign (s)", xlim=(0.02, 3), ylim=(FLOOR, 1))
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel("rms relative error of mean μ")
    figure.axes[0].plot([], [], "k*", ms=10, label="accuracy and until: both chosen")
    figure.axes[2].legend(*figure.axes[0].get_legend_handles_labels(), fontsize="x-small", loc="lower left")
    figure.savefig(path, dpi=120)


def main(path=None):
    tables = {}
    with tempfile.TemporaryDirectory() as folder:
        for scene in SCENES:
            truth = run(folder, scene, "hermite", "auto", TRUTH, SEED_OF_TRUTH, 0.005)[0]
            tables[scene] = fixed(folder, scene, truth), chosen(folder, scene, truth)
    for scene, (grids, accuracies) in tables.items():
        print(f"\n{scene}")
        rows = [
            (legend, "", f"{lines:.0f}", f"{error:.2%}", f"{seconds:.2f}")
            for legend, measurements in grids.items()
            for error, lines, seconds in measurements
        ]
        for accuracy, solved_to, error, lines, seconds in accuracies:
            estimates = ", ".join(f"{estimate:.1e}" for estimate in solved_to)
            end = f"{lines:.0f}", f"{error:.2%}", f"{seconds:.2f}"
            rows.append((f"accuracy and until {accuracy:.0%}", estimates, *end))
        print_table(("campaign", "error estimates", "lines", "error of mean μ", "core-seconds"), rows)
    if path:
        draw(tables, path)


if __name__ == "__main__":
    main(*sys.argv[1:])
