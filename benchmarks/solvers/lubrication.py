"""Benchmarks of films of line contacts (against another solver) and breakthrough of rollers (against finer lines)."""

from __future__ import annotations

import csv
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np

from benchmarks.solvers.sliding import power
from benchmarks.solvers.solver import Found, Solver, Truth, one_case
from mdr_dask.models.mixed_lubrication import MODEL, declaration
from mdr_dask.physics.lubrication import breakthrough, film_formulas, grids, line_contact
from mdr_dask.physics.lubrication.clusters import find_clusters
from mdr_dask.physics.lubrication.newton import Grid, newton
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.splines import closest
from mdr_dask.physics.surfaces.waves import series

E_STAR = 115.385e9
HEAVY = Path(__file__).parents[2] / "tests/references/heavy_line_contacts.csv"
KNOWN = 5e-6  # relative error of the films in HEAVY
BOX = ((2e-6, 5e-4), (1e-13, 1e-9), (500.0, 8000.0))  # ranges of W, U, G
OPTIONS = (
    {},
    {"compressible": False},
    {"viscosity_law": "roelands", "viscosity": 0.08},
    {"viscosity_law": "roelands", "viscosity": 0.5},
    {"inlet": -1.2},
)


def films(case: line_contact.LineContact, accuracy: float) -> Found | None:
    """Return central and minimum film to an accuracy."""
    found = line_contact.solve_film(case, accuracy)
    if found.outcome != Outcome.CONVERGED:
        return None
    both = found.central_film, found.minimum_film
    return Found([float(film.value) for film in both], [float(film.error) for film in both])


def uniform(case: line_contact.LineContact, count: int) -> Found | None:
    """Return both films by Newton's method on equal cells, starting from a Hertzian pressure, as in the literature."""
    guess = 1.5 * film_formulas.expected_film(case.M, case.L)
    start = max(grids.inlet_position(guess), -20 * np.sqrt(2 * guess) - 1)
    grid = Grid.of(np.linspace(start, 1.5, count))
    pressure = np.sqrt(np.maximum(1 - grid.nodes**2, 0))
    found = newton(grid, case.liquid, case.film_number, pressure, guess, 0.12)
    return Found([found.central, float(found.film.min())]) if found.outcome == Outcome.CONVERGED else None


def any_contact(random: np.random.Generator) -> tuple[line_contact.LineContact, Truth] | None:
    """Draw a contact in the whole range, with its films to 1e-6."""
    numbers = (float(np.exp(random.uniform(np.log(low), np.log(high)))) for low, high in BOX)
    case = line_contact.line_contact(numbers, E_STAR, **OPTIONS[random.integers(len(OPTIONS))])
    exact = films(case, 1e-6)
    return exact and (case, Truth(exact.values, exact.stated, exact.values))


@cache
def heavy_contacts() -> list[dict[str, str]]:
    """Return the heavily loaded contacts with films by another solver."""
    with HEAVY.open() as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def heavy_contact(random: np.random.Generator) -> tuple[line_contact.LineContact, Truth]:
    """Draw one of the heavily loaded contacts, with the films of the other solver."""
    row = heavy_contacts()[random.integers(len(heavy_contacts()))]
    law = {"viscosity_law": row["viscosity_law"], "compressible": row["compressible"] == "true"}
    law |= {"viscosity": float(row["viscosity"])} if row["viscosity"] else {}
    case = line_contact.line_contact([float(row[name]) for name in ("W", "U", "G")], E_STAR, **law)
    exact = np.array([float(row["central_film"]), float(row["minimum_film"])])
    return case, Truth(exact, KNOWN * exact, exact)


OUTPUTS = ("breakthrough_probability", "breakthrough_probability_error")
PERIMETER, FINER = 2 * np.pi * 0.05, 8


def rollers(random: np.random.Generator) -> tuple[declaration.MixedLubrication, Truth] | None:
    """Draw rollers with a layer, and sometimes with creep; the truth is on 1.6 million points."""
    case = declaration.MixedLubrication(
        normal_force=random.uniform(200, 1200),
        rotation_speed=power(random, -1, 1),
        temperature=random.uniform(315, 370),
        rms_roughness=2e-7,
        layer_thickness=power(random, -9, -7.5),
        slide_roll_ratio=random.choice([0.0, 0.0, 0.0, 0.0, 0.03]),
        points=50_000,
        shortest_wavelength=2.5 * 8 ** random.uniform() * PERIMETER / 50_000,
    )
    exact = revolution(case, points=200_000 * FINER)
    if exact is None or not 0 < exact.values < 1:
        return None
    return case, Truth(exact.values, exact.stated)


def revolution(case: declaration.MixedLubrication, points: int | str, accuracy: float | None = None) -> Found | None:
    """Return the probability of breakthrough in one revolution, on a number of points or to an accuracy."""
    found = one_case(MODEL, case.model_copy(update={"points": points}), OUTPUTS, accuracy=accuracy)
    return found and Found(*(float(found[name]) for name in OUTPUTS))


class Revolution(NamedTuple):
    """One revolution of two rollers.

    `waves` are those of both rollers together in m, `level` is the height in m above which they touch, and `window` is
    the contact width over the perimeter.
    """

    waves: np.ndarray
    level: float
    window: float


STRENGTH = float(breakthrough.layer_strength(1e6, E_STAR, 5e-9))
LEVELS = (1.0431e-6, 0.5317e-6, 0.3080e-6)  # films at 40, 60 and 80 C and 800 N, m
WINDOW = 945.4e-6  # contact width at 800 N as a share of the perimeter


def splines(case: Revolution, points: int) -> Found:
    """Return the probability by splines through points of the line; the time includes the Fourier transform."""
    clusters = find_clusters(closest(case.waves, points), case.level, PERIMETER / points, STRENGTH)
    return Found(float(np.mean(breakthrough.contact_lengths(clusters, case.window * points) > 0)))


def window_by_window(case: Revolution, points: int) -> Found:
    """Return the probability by the method of the thesis: window by window, with runs of points as clusters."""
    width, limit = round(case.window * points), STRENGTH * (PERIMETER / points) ** 2
    return Found(_breaking(series(case.waves, points) - case.level, width, limit) / points)


@numba.njit
def _breaking(overlap: np.ndarray, width: int, limit: float) -> int:
    """Return the number of windows with a cluster that breaks the layer."""
    points, found = overlap.size, 0
    for p in range(points):
        n, total, breaks = 0, 0.0, False
        for k in range(p, p + width):
            here = overlap[k if k < points else k - points]
            if here > 0:
                n, total = n + 1, total + here
            if n and (here <= 0 or k == p + width - 1):
                breaks = breaks or total > limit * n**3
                n, total = 0, 0.0
        found += breaks
    return found


def thesis_rollers(random: np.random.Generator) -> tuple[Revolution, Truth]:
    """Draw a revolution of the rollers of the thesis at 800 N; the truth is by splines on two million points."""
    amplitude = 0.2e-6 * roughness.amplitudes(100_000, 0.7, longest=748.0)
    phase = random.uniform(0, 2 * np.pi, (100_000, 2))
    waves = 0.5 * amplitude * np.exp(1j * phase).sum(axis=1)
    case = Revolution(waves, float(random.choice(LEVELS)), WINDOW)
    return case, Truth(splines(case, 2_000_000).values, 1e-6)


SOLVERS = (
    Solver(
        "line contact (EHL)",
        {"whole box": any_contact, "heavy": heavy_contact},
        {
            "accuracy": {f"{a:g}": partial(films, accuracy=a) for a in (1e-2, 1e-3, 3e-4, 1e-4)},
            "equal cells, Newton": {f"{count} nodes": partial(uniform, count=count) for count in (201, 401, 801)},
        },
    ),
    Solver(
        "mixed lubrication",
        {"random rollers": rollers},
        {
            "points": {f"{points}": partial(revolution, points=points) for points in (50_000, 200_000)},
            "accuracy": {f"{a:g}": partial(revolution, points="auto", accuracy=a) for a in (0.1, 0.02)},
        },
    ),
    Solver(
        "breakthrough of one revolution",
        {"800 N": thesis_rollers},
        {
            "splines": {f"{points}": partial(splines, points=points) for points in (250_000, 500_000)},
            "point by point (thesis)": {
                f"{points}": partial(window_by_window, points=points) for points in (250_000, 500_000, 1_000_000)
            },
        },
    ),
)
