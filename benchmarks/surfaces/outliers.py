"""How far points of roughness stick out of their neighbours: ``python -m benchmarks surfaces outliers [MAPS]``.

Maps of self-affine roughness without any outlier, with points as close along both axes or closer along one, and white
noise with and without long tails. The largest distance over its robust standard deviation is what `FAR` has to exceed.
"""

import sys

import numpy as np

from benchmarks.measures import print_table
from mdr_dask.physics.surfaces.maps import FAR, _off_neighbours

SIDE, CLOSER = 600, (1, 3, 10, 30)
NOISES = {"normal noise": "standard_normal", "noise with long tails": "laplace"}


def self_affine(hurst, closer, random):
    """Return heights with a spectrum of q^(-2 - 2 H), whose points lie so many times closer along the first axis."""
    down, right = np.meshgrid(np.fft.fftfreq(SIDE) * closer, np.fft.fftfreq(SIDE), indexing="ij")
    wave = np.hypot(down, right)
    wave[0, 0] = np.inf
    return np.fft.ifft2(np.fft.fft2(random.standard_normal((SIDE, SIDE))) * wave ** (-1 - hurst)).real


def largest(height):
    """Return the largest distance from the neighbours over the robust standard deviation of all."""
    away = _off_neighbours(height)
    return float(np.max(away) / (1.4826 * np.median(away)))


def main(maps="10"):
    random = np.random.default_rng(1906)
    scenes = {
        f"H = {hurst}, {closer} times closer along one axis": lambda h=hurst, c=closer: self_affine(h, c, random)
        for hurst in (0.0, 0.5, 1.0)
        for closer in CLOSER
    }
    scenes |= {name: lambda kind=kind: getattr(random, kind)(size=(SIDE, SIDE)) for name, kind in NOISES.items()}
    print_table(
        ["map", "largest of all maps, in standard deviations"],
        [(name, f"{max(largest(make()) for _ in range(int(maps))):.1f}") for name, make in scenes.items()],
    )
    print(f"FAR = {FAR:g}")


if __name__ == "__main__":
    main(*sys.argv[1:])
