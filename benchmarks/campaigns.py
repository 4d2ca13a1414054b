"""Measure error and processor time of whole campaigns that request an accuracy.

python -m benchmarks campaigns             all models, four campaigns for each accuracy; prints a table
python -m benchmarks campaigns wear 1      one model, one campaign for each accuracy

Each campaign is computed into a store on disk, on one thread. The campaign requests an accuracy and, if its lines are
random, a relative standard error of the same size. The error is due to the grid and to the scatter of the lines. It is
the rms over cases and campaigns, relative to a reference campaign with finer settings and other lines.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.rows import number, seconds, table, timed
from mdr_dask import execute, store
from mdr_dask.campaign import loads

SEED_OF_TRUTH = 99


@dataclass(frozen=True)
class Study:
    """A campaign that is computed with several accuracies.

    `text` is the campaign without an accuracy. The lines `asked[accuracy]` or, for the reference, `truth` are added to
    it. Errors of `output` are relative to the reference, or to `least` if the reference is smaller.
    """

    text: str
    output: str
    asked: dict[float, str]
    truth: str
    least: float = 0.0

    def run(self, folder: str, rest: str, seed: int) -> tuple[np.ndarray, float]:
        """Return the mean output of every case, and the processor time of the run."""
        text, url = f"name: benchmark\nseed: {seed}\n{self.text}\n{rest}\n", tempfile.mkdtemp(dir=folder) + "/a.zarr"
        campaign, resources = loads(text, "campaign.yaml", "."), execute.Resources(threads=1)
        progress, spent = timed(execute.run, campaign, url, resources, lambda _: None)
        assert progress.failed == 0
        return store.datasets(url)[""][self.output].mean("realisation").to_numpy(), spent

    def measure(self, campaigns: int, accuracies: list[float]) -> Iterator[tuple[float, float, float, float]]:
        """Yield accuracy, rms error, share of results within twice the accuracy, and mean processor time."""
        with tempfile.TemporaryDirectory() as folder:
            truth, _ = self.run(folder, self.truth, SEED_OF_TRUTH)
            scale = np.maximum(np.abs(truth), self.least)
            for accuracy in accuracies:
                runs = [self.run(folder, self.asked[accuracy], seed) for seed in range(campaigns)]
                errors = np.array([np.abs(found - truth) / scale for found, _ in runs])
                inside = np.mean(errors <= 2 * accuracy)
                yield accuracy, float(np.sqrt(np.mean(errors**2))), float(inside), np.mean([spent for _, spent in runs])


def until(accuracy: float, output: str) -> str:
    """Return the lines of a campaign that request an accuracy and the same standard error."""
    return f"accuracy: {accuracy:g}\nrealisations: {{at_least: 10, at_most: 4096, until: {{{output}: {accuracy:g}}}}}"


STUDIES = {
    "friction": Study(
        """
model: sliding_friction
outputs: [friction_coefficient]
parameters:
  length: 20 mm
  points: 2000
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  hurst: 0.7
  normal_force: {geometric: [0.3 N, 3 N, 4]}
  velocity: {geometric: [10 mm/s, 1 m/s, 4]}
""",
        "friction_coefficient",
        {accuracy: until(accuracy, "friction_coefficient") for accuracy in (0.1, 0.05, 0.02)},
        "accuracy: 0.005\nrealisations: 1000",
    ),
    "jumps": Study(
        """
model: velocity_jump
outputs: [friction_coefficient_jump]
parameters:
  length: 10 mm
  points: 500
  hurst: 0.7
  rms_roughness: 10 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  velocity: {geometric: [20 mm/s, 1 m/s, 4]}
  normal_force: {geometric: [1 N, 3 N, 2]}
""",
        "friction_coefficient_jump",
        {accuracy: until(accuracy, "friction_coefficient_jump") for accuracy in (0.1, 0.05, 0.02)},
        "accuracy: 0.005\nrealisations: 1000",
    ),
    "rollers": Study(
        """
model: mixed_lubrication
outputs: [breakthrough_probability]
parameters:
  normal_force: [200 N, 800 N]
  rotation_speed: {geometric: [1 rpm, 30 rpm, 4]}
  temperature: 60 degC
  rms_roughness: 0.2 um
  shortest_wavelength: 3.14 um
""",
        "breakthrough_probability",
        {
            accuracy: f"accuracy: {accuracy:g}\nrealisations: {{at_least: 4, at_most: 60, until: "
            f"{{breakthrough_probability: {{relative: {accuracy:g}, absolute: {accuracy / 4:g}}}}}}}"
            for accuracy in (0.1, 0.05, 0.02)
        },
        "accuracy: 0.005\nrealisations: 100",
        least=0.25,
    ),
    "films": Study(
        """
model: ehl_line
outputs: [minimum_film]
parameters:
  load_parameter: 1e-4
  speed_parameter: {geometric: [1e-12, 1e-10, 3]}
  material_parameter: [2504, 5007, 10014]
""",
        "minimum_film",
        {accuracy: f"accuracy: {accuracy:g}" for accuracy in (0.1, 0.01, 1e-3)},
        "accuracy: 2e-5",
    ),
    "wear": Study(
        """
model: fretting_wear
outputs: [wear_volume]
parameters:
  indenter: {shape: cone}
  stick_radius: [0.3, 0.55, 0.8]
  cycles: [0.5, 2, 8]
  hold: force
""",
        "wear_volume",
        {accuracy: f"accuracy: {accuracy:g}" for accuracy in (0.1, 0.01, 1e-3)},
        "accuracy: 1e-5",
    ),
}


def main(*arguments: str) -> None:
    """Print a table for the named models (default: all), with a number of campaigns for each accuracy."""
    names = [name for name in arguments if not name.isdigit()] or list(STUDIES)
    if unknown := set(names) - set(STUDIES):
        raise SystemExit(f"no campaign {', '.join(sorted(unknown))}; known: {', '.join(STUDIES)}")
    campaigns = next((int(argument) for argument in arguments if argument.isdigit()), 4)
    rows = []
    for name in names:
        for accuracy, error, inside, spent in STUDIES[name].measure(campaigns, list(STUDIES[name].asked)):
            rows.append((name, f"{accuracy:g}", number(error), number(100 * inside, " %"), seconds(spent)))
    print(table(("campaign", "accuracy", "rms error", "within twice the accuracy", "processor time"), rows))
