"""Make the data of campaigns/road.yaml: three maps of a generated asphalt, and their spectrum from `mdr-dask surface`.

``python -m benchmarks road [FOLDER]``: C2D ~ q^(-2 - 2 H) with H = 0.8 for wavelengths from 2.5 mm to 10 um, constant
above, and an rms height of 50 um. White noise of 20 nm is added. The maps have 1024 x 1024 points at distances of 5 um;
they are cut out of a larger periodic surface and tilted.
"""

import sys
from pathlib import Path

import numpy as np

from mdr_dask import cli
from mdr_dask.physics.surfaces.spectrum import self_affine

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from references.areal import areal_surface

SPACING, POINTS, SEED = 5e-6, 1024, 2026
SPECTRUM = self_affine(0.8, 8e-3, 1e-5, 5e-5, 2.5e-3)


def main(folder=str(Path(__file__).parents[2] / "campaigns/data/road")):
    """Write the maps, their spectrum and the figure into a folder."""
    folder = Path(folder)
    side = POINTS * 3 // 2
    names = []
    for k in range(3):
        whole = areal_surface(SPECTRUM, (side, side), (side * SPACING,) * 2, SEED, k)
        noise = 2e-8 * np.random.default_rng(k).standard_normal((POINTS, POINTS))
        tilt = 1e-7 * np.arange(POINTS)
        names.append(str(folder / f"road{k}.npy"))
        np.save(names[-1], 1e6 * (whole[:POINTS, :POINTS] + noise + tilt).astype(np.float32))
    files = ["-o", str(folder / "road.csv"), "--plot", str(folder / "road-spectrum.png")]
    cli.main(["surface", *names, "--spacing", "5um", "--unit", "um", *files])
