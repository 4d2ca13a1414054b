"""A rough circular punch that slides over a Kelvin half-space at constant speed, and the lines that replace it.

``python -m benchmarks validity`` computes the rows that are missing in docs/evidence/sliding_punch.csv.
"""

import itertools
import sys
import tempfile
from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import fft
from scipy.sparse.linalg import LinearOperator, gmres

from benchmarks.solvers.solver import one_case
from benchmarks.surfaces.punches import append, areal_surface, free_half_space, spectrum
from mdr_dask.models.parts.surface import Surface
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction
from mdr_dask.physics.surfaces.maps import wavenumbers

TABLE = Path(__file__).parents[2] / "docs/evidence/sliding_punch.csv"
HEADING = "q [rad/m],C2D [m^4]"
HURST, SEED = 0.8, 15
DEBORAH = (0.01, 0.1)  # v tau / L; at higher values, periodic images of the punch interact
DEPTHS = (-1.5, -0.5, 0.5)  # depths over the rms height
LINES = 40


@lru_cache(maxsize=8)
def response(points, deborah):
    """Return the displacement response to forces for unit modulus E* = 4 G, in the frame of the punch.

    For a Kelvin half-space u + v tau du/dx = u_el, where u_el is the displacement of an elastic half-space.
    """
    q_x, _ = wavenumbers((2 * points, 2 * points), (2.0, 2.0))
    return free_half_space(points).response / (1 + 1j * deborah * q_x)[:, None]


def slide(height, depth, deborah):
    """Return the forces on the points of a punch that slides along x at a given depth."""
    points = height.shape[0]
    place = (np.arange(points) + 0.5) / points - 0.5
    punch = np.hypot(place[:, None], place) < 0.5
    kernel = response(points, deborah)

    def displacement(force):
        padded = np.zeros((2 * points, 2 * points))
        padded[:points, :points] = force
        return fft.irfft2(fft.rfft2(padded) * -kernel, padded.shape)[:points, :points]

    wanted = height + depth
    touching, force = punch & (wanted > 0), np.zeros_like(height)
    for _ in range(200):
        where = np.flatnonzero(touching)

        def product(x, where=where):
            full = np.zeros(height.size)
            full[where] = x
            return displacement(full.reshape(height.shape)).ravel()[where]

        operator = LinearOperator((where.size, where.size), product)
        start = force.ravel()[where]
        found, _ = gmres(operator, wanted.ravel()[where], start, rtol=1e-7, restart=60, maxiter=20)
        force = np.zeros(height.size)
        force[where] = found
        force = force.reshape(height.shape)
        gap = displacement(force) - wanted
        after = punch & (((force > 0) & touching) | (~touching & (gap < -1e-7 * np.abs(wanted).max())))
        if np.array_equal(after, touching):
            return force
        touching, force = after, np.maximum(force, 0)
    raise RuntimeError("the contact did not settle")


def lines(points, load, deborah, count=LINES):
    """Return the mean friction of the lines over h / L, their contact fraction, and the standard error of friction."""
    surface = Surface.model_validate({"spectrum": table(points)})
    parameters = SlidingFriction(
        length=1.0,
        points=2 * points,
        surface=surface,
        shear_modulus=0.25,
        relaxation_time=1.0,
        velocity=deborah,
        normal_force=load,
    )
    found = [one_case(MODEL, parameters, ("friction_coefficient", "contact_fraction"), k, SEED) for k in range(count)]
    friction, fraction = (np.array([float(one[name]) for one in found]) for name in found[0])
    return friction.mean(), fraction.mean(), friction.std(ddof=1) / np.sqrt(count)


@lru_cache(maxsize=4)
def table(points):
    """Write the spectrum of the punch for unit rms height to a file, and return its name."""
    one = spectrum(HURST, points)
    with tempfile.NamedTemporaryFile("w", suffix=".csv", delete=False) as file:
        np.savetxt(file, np.column_stack([one.wavenumber, one.density]), "%.17g", ",", header=HEADING, comments="")
    return file.name


def case(points, surfaces, deborah, depth):
    """Return load over E* L h, friction over h / L of punch and lines with standard errors, contact area and length."""
    found = []
    for index in range(surfaces):
        height = areal_surface(spectrum(HURST, points), (points, points), (1.0, 1.0), SEED, index)
        force = slide(height, depth, deborah)
        q_x, _ = wavenumbers(height.shape, (1.0, 1.0))
        slope = fft.irfft2(1j * q_x[:, None] * fft.rfft2(height), height.shape)
        friction = abs(float(np.sum(force * slope))) / force.sum()
        found.append((force.sum(), friction, np.count_nonzero(force > 0) / (np.pi / 4 * height.size)))
    load, friction, area = np.array(found).T
    spread = friction.std(ddof=1) / np.sqrt(surfaces)
    mean, length, error = lines(points, float(load.mean()), deborah)
    return load.mean(), friction.mean(), spread, mean, error, area.mean(), length


def compute(points=128, surfaces=2):
    """Compute the missing rows, and append them to the table after each case."""
    known = set(pd.read_csv(TABLE)[["points", "surfaces", "deborah", "depth"]].itertuples(index=False, name=None))
    for deborah, depth in itertools.product(DEBORAH, DEPTHS):
        given = points, surfaces, deborah, depth
        if given not in known:
            try:
                append(TABLE, [(*given, *map(float, case(*given)))])
            except RuntimeError as problem:
                print(f"v tau / L = {deborah}, depth {depth}: {problem}", file=sys.stderr)


def table_of_cases():
    """Yield the rows of the table in docs/validity.md."""
    for row in pd.read_csv(TABLE).sort_values(["points", "deborah", "load"]).to_dict("records"):
        yield (
            *(f"{row[name]:g}" for name in ("points", "surfaces", "deborah")),
            f"{row['load']:.3g}",
            f"{row['friction']:.3g} ± {row['friction_error']:.1g}",
            f"{row['line']:.3g} ± {row['line_error']:.1g}",
            f"{row['line'] / row['friction']:.2f}",
            *(f"{row[name]:.3g}" for name in ("area", "length")),
        )


HEAD = ("points", "surfaces", "v tau / L", "F / (E* L h)", "μL/h, half-space", "μL/h, lines", "ratio", "area", "length")
