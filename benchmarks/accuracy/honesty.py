"""Whether stated errors hold, for every solver: ``python -m benchmarks accuracy honesty [CASES [SEED [SOLVER...]]]``.

Random cases on seeds that no factor was chosen on, each against a much finer solution or a closed form.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.special import j0
from scipy.stats import t as student

from benchmarks.accuracy.points import FILE
from benchmarks.ehl import honesty as ehl
from benchmarks.friction import honesty as planes
from benchmarks.friction import honesty_bodies as bodies
from benchmarks.kinetics import honesty as kinetics
from benchmarks.measures import alone
from benchmarks.protocols import honesty as protocols
from benchmarks.superposition.accuracy import SHAPES, family
from mdr_dask.models.mixed_lubrication import MODEL, declaration
from mdr_dask.physics.lubrication.line_contact import solve_film
from mdr_dask.physics.mdr import transforms
from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.superposition.master_curve import superpose
from mdr_dask.physics.wear.exact import exact

TABLE = FILE.with_name("honesty.csv")
SEED = 31_000
ROUNDING = 1e-12


class Honest(NamedTuple):
    """Of random cases: how many, the share whose error is below the stated one, and the median of stated over error."""

    solver: str
    what: str
    cases: int
    covered: float
    over: float


def judged(solver: str, what: str, errors, stated) -> Honest:
    """Return the judgement of errors and what was stated for them."""
    errors, stated = np.ravel(errors), np.ravel(stated)
    over = float(np.median(stated / np.maximum(errors, ROUNDING)))
    return Honest(solver, what, errors.size, float(np.mean(errors <= stated + ROUNDING)), over)


def friction(cases: int, seed: int) -> Iterator[Honest]:
    for accuracy in (0.05, 0.01):
        yield Honest("steady friction", f"planes, accuracy {accuracy:g}", cases, *planes.honesty(cases, accuracy, seed))
    (pair,) = planes.light_planes(cases, (0.01,), seed)
    yield judged("steady friction", "light, slow planes, accuracy 0.01", *pair)


def on_bodies(cases: int, seed: int) -> Iterator[Honest]:
    kinds = {
        "indenters": bodies.indenters(cases, seed, (0.01,)),
        "general solids": bodies.materials(cases, seed, ()),
        "measured lines": bodies.measured(cases, seed, ()),
    }
    for solver, found in kinds.items():
        for what, (covered, over, number) in found:
            yield Honest(solver, what.replace(", 0.01", ", accuracy 0.01"), number, covered, over)


def jumps(cases: int, seed: int) -> Iterator[Honest]:
    rows = kinetics.honesty(cases, seed, outputs=kinetics.TRACE)
    ratios = rows[np.isfinite(rows[:, 0, 0]), :, 0]
    for place, name in enumerate(kinetics.TRACE):
        yield judged("velocity jump", name, ratios[:, place], np.ones(len(ratios)))


def histories(cases: int, seed: int) -> Iterator[Honest]:
    errors, stated = protocols.judged(cases, seed)
    yield judged("loading histories", "courses, bodies, solids", errors, np.maximum(stated, protocols.FLOOR))


def revolution(cases: int, seed: int) -> Iterator[Honest]:
    random, errors, stated = np.random.default_rng(seed), [], []
    for wave in 10 ** random.uniform(0, 2, cases):
        radii = random.uniform(0, 2, 20)
        found = transforms.inverse_transform(lambda x, wave=wave: np.cos(wave * x), radii, tolerance=1e-4)
        errors.append(np.max(np.abs(found.value - j0(wave * radii))))
        stated.append(np.max(found.error))
    yield judged("transforms", "waves of 1 to 100 radians, tolerance 1e-4", errors, stated)


def wear(cases: int, seed: int) -> Iterator[Honest]:
    random, errors, stated = np.random.default_rng(seed), [], []
    for number in range(cases):
        body = PowerProfile(float(random.uniform(1, 6)))
        stick, cycles, held = random.uniform(0.1, 0.9), [10 ** random.uniform(-1, 1)], number % 3 == 0
        (found,), (truth,) = (exact(body, stick, cycles, each, constant_force=held) for each in (1e-2, 1e-4))
        errors.append(abs(found.wear_volume - truth.wear_volume))
        stated.append(float(found.error("wear_volume", np.zeros(1)) + truth.error("wear_volume", np.zeros(1))))
    yield judged("wear", "worn volume, accuracy 0.01", errors, stated)


def films(cases: int, seed: int) -> Iterator[Honest]:
    for box in ehl.BOXES:
        pairs = [
            (ehl.films(solve_film(case, 1e-3)), ehl.films(solve_film(case, ehl.REFERENCE)))
            for case in ehl.cases(box, cases, seed)
        ]
        errors, stated = np.array(
            [(abs(one[:, 0] - true[:, 0]), one[:, 1] + true[:, 1]) for one, true in pairs]
        ).swapaxes(0, 1)
        yield judged("line contact (EHL)", f"both films, {box}, accuracy 0.001", errors, stated)


def rollers(cases: int, seed: int) -> Iterator[Honest]:
    """Yield the breakthrough of the same waves on an eighth of the points."""
    random, rows = np.random.default_rng(seed), []
    names = "breakthrough_probability", "breakthrough_probability_error"
    for number in range(cases):
        case = declaration.MixedLubrication(
            normal_force=random.uniform(200, 1200),
            rotation_speed=10 ** random.uniform(-1, 1),
            temperature=random.uniform(315, 370),
            rms_roughness=2e-7,
            points=50_000,
            shortest_wavelength=7e-5,
        )
        coarse, fine = (
            alone(MODEL, case.model_copy(update={"points": points}), number, names, seed)
            for points in (50_000, 400_000)
        )
        if coarse and fine and 0 < fine[names[0]] < 1:
            rows.append((abs(coarse[names[0]] - fine[names[0]]), coarse[names[1]] + fine[names[1]]))
    yield judged("mixed lubrication", "breakthrough, 50 000 points", *np.array(rows).T)


def curves(cases: int, seed: int) -> Iterator[Honest]:
    for shape in SHAPES:
        errors, stated = [], []
        for number in range(cases):
            groups, pieces, shifts, _ = family(seed + number, 0.01, shape, False)
            found = superpose(groups, pieces, reference=5.0)
            errors.append(np.delete(np.abs(found.horizontal - shifts), 5))
            stated.append(np.delete(student.ppf(0.975, found.freedom) * found.horizontal_error, 5))
        yield judged("master curves", f"{shape}, intervals of 95 %", errors, stated)


JUDGES: dict[str, Callable[[int, int], Iterator[Honest]]] = {
    "friction": friction,
    "bodies": on_bodies,
    "jumps": jumps,
    "histories": histories,
    "transforms": revolution,
    "wear": wear,
    "films": films,
    "rollers": rollers,
    "master_curves": curves,
}


def read() -> list[Honest]:
    """Return what was judged."""
    with TABLE.open() as stream:
        return [Honest(*row[:2], int(row[2]), *map(float, row[3:])) for row in list(csv.reader(stream))[1:]]


def write(rows: list[Honest]) -> None:
    """Write judgements in place of those of the same solvers."""
    judged_now = {row.solver for row in rows}
    kept = [row for row in read() if row.solver not in judged_now] if TABLE.exists() else []
    with TABLE.open("w") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(Honest._fields)
        writer.writerows([*row[:3], f"{row.covered:.4f}", f"{row.over:.3g}"] for row in [*kept, *rows])


def main(cases: str = "40", seed: str = str(SEED), *names: str) -> None:
    for name in names or JUDGES:
        write(list(JUDGES[name](int(cases), int(seed))))
        print(name, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
