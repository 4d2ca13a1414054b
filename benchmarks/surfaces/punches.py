"""Rough circular punches on an elastic half-space (by ContactMechanics), and the lines that replace them.

``python -m benchmarks validity`` computes the rows that are missing in docs/evidence/punches.csv.
"""

import csv
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import fft

from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.spectrum import self_affine
from mdr_dask.physics.surfaces.waves import series

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from references.areal import areal_surface

TABLE = Path(__file__).parents[2] / "docs/evidence/punches.csv"
HURST = (0.3, 0.5, 0.8)
LOADS = np.geomspace(1e-4, 1, 9)  # F / (E* L h)
HEIGHT = 1e-3  # h / L; its value does not matter, because the problem is linear
TOLERANCE = 3e-5  # largest allowed penetration over h
LINES, SEED = 200, 14
LONGEST, RESOLVED = 2, 8  # longest waves per diameter; points per shortest wave


def spectrum(hurst, points):
    """Return the spectrum of a punch of diameter 1 and rms height 1."""
    return self_affine(hurst, 1 / LONGEST, RESOLVED / points)


def line(hurst, points, index):
    """Return approach over h, contact length over L, and mean gap over h, of one line at every load."""
    modes = points // RESOLVED
    amplitude = spectrum(hurst, points).line(1.0, modes)
    height = np.sort(series(0.5 * amplitude * np.exp(1j * roughness.phases(SEED, index, modes)), points))[::-1]
    touching = np.arange(1, points + 1)
    carried = (np.cumsum(height) - touching * height) / points  # F / (E* L h) at which each point comes into contact
    count = np.searchsorted(carried, LOADS, side="right")
    depth = (LOADS * points - np.cumsum(height)[count - 1]) / count
    gap = [np.mean(np.maximum(-d - height, 0)) for d in depth]
    return depth, count / points, gap


@lru_cache(maxsize=1)
def free_half_space(points):
    """Return the half-space of ContactMechanics with unit size and modulus, with faster transforms of padded arrays."""
    from ContactMechanics import FreeFFTElasticHalfSpace

    class HalfSpace(FreeFFTElasticHalfSpace):
        def __init__(self, points):
            self._comp_nb_grid_pts = (2 * points, 2 * points)
            super().__init__((points, points), 1.0, (1.0, 1.0))
            impulse = np.zeros(self._comp_nb_grid_pts)
            impulse[0, 0] = 1
            self.response = fft.rfft2(super().evaluate_disp(impulse))

        def evaluate_disp(self, forces, bIncludePadding=False):
            n = forces.shape[0] // 2
            waves = fft.fft(fft.rfft(forces[:n, :n], 2 * n, axis=1), 2 * n, axis=0, overwrite_x=True)
            waves *= self.response
            displacement = np.zeros_like(forces)
            inner = fft.ifft(waves, axis=0, overwrite_x=True)[:n]
            displacement[:n, :n] = fft.irfft(inner, 2 * n, axis=1, overwrite_x=True)[:, :n]
            return displacement

    return HalfSpace(points)


def half_space(hurst, points, index):
    """Return approach over h, contact area over punch area, and mean gap over h, of one surface at every load."""
    from ContactMechanics.Systems import NonSmoothContactSystem
    from SurfaceTopography import Topography

    place = (np.arange(points) + 0.5) / points - 0.5
    punch = np.hypot(place[:, None], place) < 0.5
    height = HEIGHT * areal_surface(spectrum(hurst, points), (points, points), (1.0, 1.0), SEED, index)
    surface = Topography(np.ma.masked_array(height, ~punch), (1.0, 1.0))
    system = NonSmoothContactSystem(free_half_space(points), surface)
    rows = []
    for load in LOADS:
        found = system.minimize_proxy(external_force=load * HEIGHT, pentol=TOLERANCE * HEIGHT, maxiter=2000)
        if not found.success:
            raise RuntimeError(f"H = {hurst}, surface {index}, load {load:.2g}: {found.message}")
        gap = found.x[:points, :points] - height - found.offset
        rows.append((found.offset / HEIGHT, np.mean(found.jac[punch] > 0), np.mean(gap[punch]) / HEIGHT))
    return tuple(np.array(rows).T)


def rows():
    """Read the table of results."""
    return pd.read_csv(TABLE)


def append(table, values):
    """Append rows of numbers and texts to a table."""
    with table.open("a", newline="") as stream:
        texts = ([f"{x:.6g}" if isinstance(x, float) else x for x in row] for row in values)
        csv.writer(stream, lineterminator="\n").writerows(texts)


def compute(surfaces=20, points=512):
    """Compute the missing rows, and append them to the table after each surface or line."""
    known = set(rows()[["body", "hurst", "points", "index"]].itertuples(index=False, name=None))
    for body, function, count in (("line", line, LINES), ("half-space", half_space, surfaces)):
        for index in range(count):
            for hurst in HURST:
                if (body, hurst, points, index) not in known:
                    numbers = np.transpose([LOADS, *function(hurst, points, index)])
                    append(TABLE, [(body, hurst, points, index, *row) for row in numbers.tolist()])
