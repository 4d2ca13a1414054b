"""Whole campaigns of every model: error of discretisation and statistics together, against their processor time.

Each goes through the runner into a store on disk, on one thread: with fixed grids and numbers of lines, and told no
more than what is wanted. That is promised for every case: the error is the largest of the cases, each over its truth,
which a finer setting and other lines give. Ten seeds are ten points; where nothing is random, ten like campaigns.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.accuracy.points import LIKE, Point, neighbours
from benchmarks.friction import campaigns as friction
from benchmarks.measures import timed
from mdr_dask import execute, store
from mdr_dask.campaign import loads

SEED_OF_TRUTH = 99
ROUNDS = 2  # in turns, where nothing is random: the first prepares what all settings share
TOLD = "accuracy and until"


@dataclass(frozen=True)
class Study:
    """A campaign, with words in capitals for what differs.

    Parameters
    ----------
    text, output
        The campaign without realisations, and what is judged.
    scenes : dict
        What is put for the words, easy to hard.
    fixed, wanted, truth
        By method and setting, for each accuracy wanted, and for the truth: what is put for SETTING and REST.
    short : pair
        Of a rough setting, and of another that it is judged by where there is little time.
    like : function, optional
        Where nothing is random: what is put for words of a scene in campaigns that lie about it, by two coordinates.
    least : float
        What errors are over where the truth is less.
    """

    text: str
    output: str
    scenes: dict[str, dict[str, str]]
    fixed: dict[tuple[str, str], tuple[str, str]]
    wanted: dict[float, tuple[str, str]]
    truth: tuple[str, str]
    short: tuple[tuple[str, str], tuple[str, str]]
    like: Callable[[dict[str, str], float, float], dict[str, str]] | None = None
    least: float = 0.0

    def run(self, folder: Path, words: dict[str, str], setting: tuple[str, str], seed: int) -> tuple[np.ndarray, float]:
        """Return the mean output of every case, and the processor time of the run."""
        text = f"{self.text}seed: {seed}\n"
        for word, value in (words | dict(zip(("SETTING", "REST"), setting, strict=True))).items():
            text = text.replace(word, value)
        study, url = loads(text, "campaign.yaml", "."), tempfile.mkdtemp(dir=folder) + "/store.zarr"
        progress, seconds = timed(lambda: execute.run(study, url, execute.Resources(threads=1), lambda _: None))
        assert progress.failed == 0
        return store.datasets(url)[""][self.output].mean("realisation").to_numpy(), seconds

    def points(self, solver: str, short: bool) -> Iterator[Point]:
        """Yield all settings of all scenes, or a rough one of the first against another."""
        wanted = {(TOLD, f"asked {accuracy:g}"): each for accuracy, each in self.wanted.items()}
        settings = {(TOLD, "short"): self.short[0]} if short else self.fixed | wanted
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for scene in list(self.scenes)[: 1 if short else None]:
                for seed, words, truth in self._campaigns(folder, self.scenes[scene], short):
                    solved: dict[tuple[str, str], tuple[np.ndarray, float]] = {}
                    for _ in range(1 if short or self.like is None else ROUNDS):
                        for key, each in settings.items():
                            found, seconds = self.run(folder, words, each, seed)
                            solved[key] = found, min(seconds, solved.get(key, (found, np.inf))[1])
                    for (method, setting), (found, seconds) in solved.items():
                        error = np.max(np.abs(found - truth) / np.maximum(np.abs(truth), self.least))
                        yield Point(solver, scene, method, setting, seconds, float(error))

    def _campaigns(
        self, folder: Path, scene: dict[str, str], short: bool
    ) -> Iterator[tuple[int, dict[str, str], np.ndarray]]:
        """Yield the seed, the words, and the truth of like campaigns."""
        finest = self.short[1] if short else self.truth
        if self.like is None:
            truth, _ = self.run(folder, scene, finest, SEED_OF_TRUTH)
            for seed in range(1 if short else LIKE):
                yield seed, scene, truth
        else:
            for number, first, second in neighbours(short):
                words = self.like(scene, first, second)
                yield number, words, self.run(folder, words, finest, SEED_OF_TRUTH)[0]


def told(accuracy: float, output: str, rest: str = "") -> str:
    """Return what a campaign is told that wants a standard error."""
    return f"realisations: {{at_least: 7, at_most: 4096, until: {{{output}: {accuracy:g}}}}}\n{rest}"


FRICTION = Study(
    """
name: friction
model: sliding_friction
parameters:
  length: 20 mm
  points: 2000
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  hurst: HURST
  normal_force: {geometric: [FORCES, 4]}
  velocity: {geometric: [10 mm/s, 1 m/s, 4]}
  SETTING
outputs: [friction_coefficient]
REST
""",
    "friction_coefficient",
    {scene: {"HURST": f"{hurst:g}", "FORCES": forces} for scene, (hurst, forces) in friction.SCENES.items()},
    {
        (method, f"{lines} lines"): (
            f"scheme: {scheme}\n  oversampling: {grid}",
            f"realisations: {lines}\naccuracy: 0.05\n",
        )
        for method, (scheme, grid) in friction.GRIDS.items()
        for lines in friction.LINES
    },
    {a: ("", told(a, "friction_coefficient", f"accuracy: {a:g}\n")) for a in friction.WANTED},
    ("", f"realisations: {friction.TRUTH}\naccuracy: 0.005\n"),
    (("", "realisations: 8\naccuracy: 0.05\n"), ("", "realisations: 20\naccuracy: 0.005\n")),
)
JUMPS = Study(
    """
name: jumps
model: velocity_jump
parameters:
  length: 10 mm
  points: 500
  hurst: 0.7
  rms_roughness: 10 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  velocity: {geometric: [20 mm/s, 1 m/s, 4]}
  normal_force: {geometric: [FORCES, 2]}
  SETTING
outputs: [friction_coefficient_jump]
REST
""",
    "friction_coefficient_jump",
    {
        "easy: heavy": {"FORCES": "10 N, 100 N"},
        "typical": {"FORCES": "1 N, 3 N"},
        "hard: light": {"FORCES": "10 mN, 0.1 N"},
    },
    {
        (f"oversampling {grid}", f"{lines} lines"): (f"oversampling: {grid}", f"realisations: {lines}\n")
        for grid in (2, 4)
        for lines in (4, 16, 64, 256)
    },
    {a: ("", told(a, "friction_coefficient_jump", f"accuracy: {a:g}\n")) for a in (0.1, 0.05, 0.02)},
    ("", "realisations: 1000\naccuracy: 0.005\n"),
    (("", "realisations: 8\naccuracy: 0.1\n"), ("", "realisations: 16\naccuracy: 0.05\n")),
)
ROLLERS = Study(
    """
name: rollers
model: mixed_lubrication
parameters:
  normal_force: [200 N, 800 N]
  rotation_speed: {geometric: [1 rpm, 30 rpm, 4]}
  temperature: HEAT
  rms_roughness: 0.2 um
  shortest_wavelength: 3.14 um
  SETTING
outputs: [breakthrough_probability]
REST
""",
    "breakthrough_probability",
    {"easy: 80 C": {"HEAT": "80 degC"}, "typical: 60 C": {"HEAT": "60 degC"}, "hard: 40 C": {"HEAT": "40 degC"}},
    {
        (f"{points} points", f"{lines} lines"): (f"points: {points}", f"realisations: {lines}\n")
        for points in (250_000, 300_000, 500_000)
        for lines in (4, 10)
    },
    {
        a: (
            "points: auto",
            f"accuracy: {a:g}\nrealisations: {{at_least: 4, at_most: 60, until: {{breakthrough_probability: "
            f"{{relative: {a:g}, absolute: {a / 4:g}}}}}}}\n",
        )
        for a in (0.1, 0.05, 0.02)
    },
    ("points: 1000000", "realisations: 100\nerrors: false\n"),
    (("points: 220000", "realisations: 4\n"), ("points: 220000", "realisations: 8\n")),
    least=0.25,
)
FILMS = Study(
    """
name: films
model: ehl_line
parameters:
  load_parameter: LOAD
  speed_parameter: {geometric: [SPEEDS, 3]}
  material_parameter: [2504, 5007, 10014]
outputs: [minimum_film]
REST
""",
    "minimum_film",
    {
        scene: {"LOAD": load, "SPEEDS": "1e-12, 1e-10"}
        for scene, load in (("easy: light", "2e-5"), ("typical", "1e-4"), ("hard: heavy", "5e-4"))
    },
    {},
    {a: ("", f"accuracy: {a:g}\n") for a in (0.1, 0.01, 1e-3, 3e-4)},
    ("", "accuracy: 2e-5\n"),
    (("", "accuracy: 0.01\n"), ("", "accuracy: 1e-4\n")),  # three grids alone reach 1e-3
    lambda scene, heavier, faster: {
        "LOAD": f"{float(scene['LOAD']) * 1.1**heavier:g}",
        "SPEEDS": ", ".join(f"{speed * 1.5**faster:g}" for speed in (1e-12, 1e-10)),
    },
)
WEAR = Study(
    """
name: wear
model: fretting_wear
parameters:
  indenter: BODY
  stick_radius: [RADII]
  cycles: [CYCLES]
  hold: HELD
  SETTING
outputs: [wear_volume]
REST
""",
    "wear_volume",
    {
        scene: {"BODY": body, "HELD": held, "RADII": "0.3, 0.55, 0.8", "CYCLES": "0.5, 2, 8"}
        for scene, body, held in (
            ("easy: parabola", "{shape: parabola}", "depth"),
            ("typical: cone, force held", "{shape: cone}", "force"),
            ("hard: n = 8", "{shape: power, exponent: 8}", "depth"),
        )
    },
    {("fast rule", ""): ("wear_rule: fast", "")}
    | {
        ("exact rule", f"to {a:g} of the depth that wears"): (f"accuracy: {a:g}", "")
        for a in (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5)
    },
    {a: ("", f"accuracy: {a:g}\n") for a in (0.1, 0.01, 1e-3, 1e-4)},
    ("accuracy: 1e-5", ""),
    (("accuracy: 0.1", ""), ("accuracy: 1e-4", "")),
    lambda scene, wider, more: (
        scene
        | {
            "RADII": ", ".join(f"{radius + 0.05 * wider:g}" for radius in (0.3, 0.55, 0.8)),
            "CYCLES": ", ".join(f"{cycles * 1.5**more:g}" for cycles in (0.5, 2.0, 8.0)),
        }
    ),
)


CAMPAIGNS: dict[str, Callable[[bool], Iterator[Point]]] = {
    "campaigns_of_friction": partial(FRICTION.points, "campaigns of sliding friction"),
    "campaigns_of_jumps": partial(JUMPS.points, "campaigns of velocity jumps"),
    "campaigns_of_rollers": partial(ROLLERS.points, "campaigns of mixed lubrication"),
    "campaigns_of_films": partial(FILMS.points, "campaigns of line contacts"),
    "campaigns_of_wear": partial(WEAR.points, "campaigns of wear"),
}
