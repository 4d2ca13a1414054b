"""Wear, films, jumps, loading histories, breakthrough and transforms: what their own benchmarks measure, as points."""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.special import j0

from benchmarks.accuracy.points import Point, neighbours
from benchmarks.measures import timed, timed_in_turns
from mdr_dask.physics.lubrication import line_contact
from mdr_dask.physics.mdr import transforms
from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.mdr.uniform_grid import uniform_grid
from mdr_dask.physics.wear.exact import exact, limit_under_force
from mdr_dask.physics.wear.history import LoadBlock, history
from mdr_dask.physics.wear.rules import fast, limit
from mdr_dask.physics.wear.worn import virgin_load

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from references.literal_wear import literal

FILMS = Path(__file__).parents[2] / "tests/references/heavy_line_contacts.csv"
KNOWN = 5e-6  # relative error of those films


class Worn(NamedTuple):
    """A body r^n, its c / a0 (0 is gross slip), amount of wear, and whether the force is held."""

    exponent: float
    border: float
    amount: float
    held: bool = False

    @property
    def profile(self) -> PowerProfile:
        return PowerProfile(self.exponent)

    @property
    def scale(self) -> float:
        """What can wear, over d0."""
        return 1 - float(self.profile.image(np.array(self.border)))

    def evolved(self, accuracy: float):
        return exact(self.profile, self.border, [self.amount], accuracy, constant_force=self.held)[0]

    def otherwise(self, short: bool) -> Iterator[tuple[str, str, Callable]]:
        """Yield the other rules that serve here: method, setting, and what solves."""
        profile, border, amount = self.profile, self.border, self.amount
        kept = {"force": 2 * virgin_load(profile, 1.0)} if self.held else {"depth": 1.0}
        block = LoadBlock(amount, self.scale if border > 0 else np.inf, **kept)
        for cells in (40,) if short else (50, 100, 200, 400):
            yield "blocks of load", f"{cells} cells", partial(_last, profile, block, cells)
        if border == 0:
            return
        if not self.held:
            yield "fast rule, ξ = 0.8", "", partial(fast, profile, border, amount, 0.8)
        limit_rule = limit_under_force if self.held else limit
        yield "limit rule", "", partial(limit_rule, profile, border)
        for cells in () if amount > FEW else (40,) if short else (50, 100, 200):
            simulated = partial(literal, profile, border, amount, cells=cells, constant_force=self.held)
            yield "cycle by cycle (thesis)", f"{cells} cells", simulated


WORN = {
    "easy: parabola, N = 2": Worn(2.0, 0.455, 2.0),
    "easy: gross slip": Worn(2.0, 0.0, 1.0),
    "typical: parabola, N = 8": Worn(2.0, 0.455, 8.0),
    "typical: cone, force held": Worn(1.0, 0.3, 4.0, held=True),
    "hard: flat, n = 8, c = 0.1": Worn(8.0, 0.1, 4.0),
    "hard: N = 300": Worn(2.0, 0.455, 300.0),
    "hard: gross slip, force held": Worn(1.0, 0.0, 2.0, held=True),
}
CLOSED = 2e-6  # relative error of the limit, which is the truth after many cycles
FEW = 20.0  # cycles beyond which they are not followed one by one


def _last(profile: PowerProfile, block: LoadBlock, cells: int):
    return history(profile, [block], cells=cells)[0]


def wear(short: bool) -> Iterator[Point]:
    """Yield the worn profile of ten bodies by every rule; cycles one by one share nothing with them but matrices.

    The truth is the exact evolution at 1e-5, which those cycles tend to, or the limit after many. Errors are over what
    can wear, as `accuracy` is: the largest of the profile at any radius.
    """
    for case, worn in list(WORN.items())[: 1 if short else None]:
        for like, rounder, more in neighbours(short):
            body = worn._replace(exponent=worn.exponent * 1.1**rounder, amount=worn.amount * 1.5**more)
            truth = body.evolved(1e-3 if short else 1e-5)
            radii = np.linspace(0, 1.2 * truth.contact_radius, 400)

            def error(found, truth=truth, radii=radii, scale=body.scale):
                return max(float(np.max(np.abs(found.height(radii) - truth.height(radii)))) / scale, CLOSED)

            asked = (0.1, 0.01) if short else (0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4)
            solved = timed_in_turns([partial(body.evolved, accuracy) for accuracy in asked], 2 if short else 3)
            for accuracy, (found, seconds) in zip(asked, solved, strict=True):
                stated = float(np.nanmax(found.error("worn_profile", radii))) / body.scale
                yield Point("wear", case, "exact evolution", f"accuracy {accuracy:g}", seconds, error(found), stated)
            for method, setting, solve in () if like else body.otherwise(short):
                found, seconds = timed(solve, calls=2)
                yield Point("wear", case, method, setting, seconds, error(found))


def films(short: bool) -> Iterator[Point]:
    """Yield the worse film of the lightest to the heaviest of 70 contacts, and of nine like each in load and speed.

    The truth of the first is that of another solver, known to 5e-6; of the others, the solution to 1e-6.
    """
    with FILMS.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    rows = [row for row in rows if row["viscosity_law"] == "barus"]
    rows.sort(key=lambda row: float(row["W"]) / float(row["U"]) ** 0.5)
    chosen = {"easy: M of 200": rows[0], "typical": rows[len(rows) // 2], "hard: heaviest of 70": rows[-1]}
    for name, row in list(chosen.items())[: 1 if short else None]:
        W, U, G = (float(row[key]) for key in ("W", "U", "G"))
        for like, heavier, faster in neighbours(short):
            groups = W * 1.2**heavier, U * 1.5**faster, G
            case = line_contact.line_contact(groups, 115.385e9, compressible=row["compressible"] == "true")
            given = float(row["central_film"]), float(row["minimum_film"])
            yield from _films(name, case, None if like else given, short)


def _films(name: str, case: line_contact.LineContact, truth, short: bool) -> Iterator[Point]:
    """Yield the worse film of a contact: to an accuracy, and on equal cells."""
    from benchmarks.ehl.work_precision import uniform

    if truth is None:
        truth = [float(film.value) for film in _both(line_contact.solve_film(case, 1e-6))]

    def point(method, setting, found, seconds):
        both = _both(found)
        error = max(abs(float(film.value) / true - 1) for film, true in zip(both, truth, strict=True))
        stated = max(float(film.error / film.value) for film in both)
        told = stated if stated > 3 * KNOWN else np.nan
        return Point("line contact (EHL)", name, method, setting, seconds, max(error, KNOWN), told)

    for accuracy in (1e-2, 1e-3) if short else (1e-2, 3e-3, 1e-3, 3e-4, 1e-4):
        found, seconds = timed(line_contact.solve_film, case, accuracy, calls=3)
        yield point("graded grids, extrapolated", f"accuracy {accuracy:g}", found, seconds)
    for cells in (101,) if short else (201, 401, 801):
        (central, minimum, _), seconds = timed(uniform, case, cells)
        error = max(abs(found / true - 1) for found, true in zip((central, minimum), truth, strict=True))
        yield Point("line contact (EHL)", name, "uniform grid", f"{cells} nodes", seconds, error)


def _both(found: line_contact.LineSolution):
    return found.central_film, found.minimum_film


def jumps(short: bool) -> Iterator[Point]:
    """Yield the course of friction after a jump against every element followed on two fine grids, extrapolated."""
    from benchmarks.kinetics import work_precision as own

    finest = 2 if short else 16
    for name, case in list(own.CASES.items())[: 1 if short else None]:
        own.march(case, 2, 8), own.papers(case, 1), own.followed(case, 1)
        ladder = {grid: timed(own.followed, case, grid) for grid in ((1, 2) if short else (2, 4, 8, 16))}
        truth = (4 * ladder[finest][0] - ladder[finest // 2][0]) / 3

        def point(method, setting, trace, seconds, stated=np.nan, name=name, truth=truth):
            return Point("velocity jump", name, method, setting, seconds, float(np.max(np.abs(trace - truth))), stated)

        for grid, steps in ((2, 8),) if short else ((2, 8), (4, 8), (4, 12), (8, 24), (16, 48)):
            (trace, errors), seconds = timed(own.march, case, grid, steps, calls=1 if short else 3)
            setting = f"oversampling {grid}, {steps} steps a decade"
            yield point("graded march", setting, trace, seconds, float(np.max(errors)))
        for grid, (trace, seconds) in ladder.items():
            yield point("every element followed", f"oversampling {grid}", trace, seconds)
        for grid in (1,) if short else (1, 4, 16):
            trace, seconds = timed(own.papers, case, grid)
            yield point("backward Euler (thesis)", f"oversampling {grid}", trace, seconds)


def histories(short: bool) -> Iterator[Point]:
    """Yield the drag of two speeds from rest; backward Euler tends to the same, to its first order."""
    from benchmarks.protocols import work_precision as own

    for name, solid in list(own.SOLIDS.items())[: 1 if short else None]:
        own.followed(own.line(2), solid, 1.0), own.backward_euler(own.line(2), solid)
        truth = own.followed(own.line(8 if short else 40), solid, 0.5 if short else 0.25)
        for grid, cells in ((2, 1.0),) if short else ((2, 1.0), (4, 1.0), (4, 0.5), (8, 0.5), (16, 0.5)):
            drag, seconds = timed(own.followed, own.line(grid), solid, cells)
            error = float(np.max(np.abs(drag - truth)) / truth.max())
            yield Point("loading histories", name, "events on patches", f"grid {grid}, {cells:g} cells", seconds, error)
        for grid in (4,) if short else (4, 16, 64):
            drag, seconds = timed(own.backward_euler, own.line(grid), solid)
            error = float(np.max(np.abs(drag - truth)) / truth.max())
            yield Point("loading histories", name, "backward Euler", f"grid {grid}", seconds, error)


def rollers(short: bool) -> Iterator[Point]:
    """Yield the probability of breakthrough of one turn on more and more points, by splines and as in the thesis."""
    from benchmarks.mixed import work_precision as own

    names = {own.splines: "splines", own.points_of_windows: "point by point, window by window (thesis)"}
    for case, contact in list(own.CASES.items())[-1 if short else 0 :]:
        truth = own.splines(2 * own.MILLION, *contact)
        for points in (220_000,) if short else (220_000, 250_000, 300_000, 400_000, 500_000, own.MILLION):
            for method, name in names.items():
                method(points, *contact)
                probability, seconds = timed(method, points, *contact)
                error = max(abs(probability - truth), 1e-6)
                yield Point("mixed lubrication", case, name, f"{points} points", seconds, error)


class Image(NamedTuple):
    """An image g(x), the profile f(r) that it belongs to in closed form, and where g has a kink."""

    image: Callable[[np.ndarray], np.ndarray]
    profile: Callable[[np.ndarray], np.ndarray]
    breaks: tuple[float, ...] = ()


def _behind_a_kink(radius):
    """Return f of g = max(x^2 - 1, 0)."""
    outside = np.maximum(radius, 1.0)
    return 2 / np.pi * ((0.5 * outside**2 - 1) * np.arccos(1 / outside) + 0.5 * np.sqrt(outside**2 - 1))


IMAGES = {
    "easy: cos 5x": Image(lambda x: np.cos(5 * x), lambda r: j0(5 * r)),
    "typical: a kink": Image(lambda x: np.maximum(x**2 - 1, 0), _behind_a_kink, (1.0,)),
    "hard: cos 200x": Image(lambda x: np.cos(200 * x), lambda r: j0(200 * r)),
}


def revolution(short: bool) -> Iterator[Point]:
    """Yield profiles of images in closed form, by Gauss sums and by the matrices of a uniform grid."""
    radii, whole = np.linspace(0.05, 2.0, 40), transforms.MOST_NODES
    for case, (image, profile, breaks) in list(IMAGES.items())[: 1 if short else None]:
        transformed = partial(transforms.inverse_transform, image, radii, breaks=breaks)
        try:
            for most in (16, 32) if short else (8, 16, 32, 64, 256):
                transforms.MOST_NODES = most
                found, seconds = timed(transformed, calls=5)
                error = max(float(np.max(np.abs(found.value - profile(radii)))), 1e-16)
                stated = float(found.error.max())
                yield Point("transforms", case, "Gauss sums", f"{most} nodes", seconds, error, stated)
        finally:
            transforms.MOST_NODES = whole
        for cells in (50,) if short else (50, 100, 200, 400, 800):
            grid, seconds = timed(uniform_grid.__wrapped__, cells, 2.0)
            flat = image(np.zeros(1))
            error = float(np.max(np.abs(grid.inverse @ (image(grid.nodes) - flat) + flat - profile(grid.nodes))))
            yield Point("transforms", case, "matrices of a uniform grid", f"{cells} cells", seconds, error)


def master_curves(short: bool) -> Iterator[Point]:
    """Yield factors of planted families: the median over families of the largest error, and of its half width."""
    from benchmarks.superposition.accuracy import SHAPES, family
    from mdr_dask.physics.superposition.master_curve import superpose

    for shape in list(SHAPES)[: 1 if short else None]:
        superpose(*family(0, 0.01, shape, False)[:2], reference=5.0)
        for scatter in (0.01,) if short else (0.003, 0.01, 0.03):
            errors, stated, times = [], [], []
            for seed in range(400_000, 400_000 + (2 if short else 20)):
                groups, pieces, shifts, _ = family(seed, scatter, shape, False)
                found, seconds = timed(superpose, groups, pieces, "none", 5.0)
                errors.append(np.max(np.abs(found.horizontal - shifts)))
                stated.append(2 * np.max(found.horizontal_error))
                times.append(seconds)
            middle = (float(np.median(column)) for column in (times, errors, stated))
            yield Point("master curves", shape, "least squares with a smooth curve", f"scatter {scatter:g}", *middle)
