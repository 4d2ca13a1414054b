"""Families of measured lines that are difficult for a Fourier series; also used by tests."""

import numpy as np

from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.waves import series

EVEN, ODD, FEW = (64, 128, 200, 256), (63, 129, 201), (8, 9, 12, 16)


def rough(random, count, hurst=None):
    modes = count // 2
    amplitude = roughness.amplitudes(modes, random.uniform() if hurst is None else hurst)
    return series(0.5 * amplitude * np.exp(1j * random.uniform(0, 2 * np.pi, modes)), count)


def steps(random, count):
    if count < 16:
        return np.where(np.arange(count) < count // 2, 1.0, 0.0)
    return np.repeat(random.standard_normal(-(-count // 8)), 8)[:count]


def spikes(random, count):
    return np.where(random.uniform(size=count) < 0.1, random.exponential(10, count), 0.0) + 1e-3 * rough(random, count)


def peak(random, count):
    return np.where(np.arange(count) == random.integers(count), 1.0, 0.0)


def plateau(random, count):
    line = rough(random, count, 0.8)
    return np.minimum(line, 0.3 * line.max())


def clipped(random, count):
    return plateau(random, count) + random.choice([1e-3, 1e-2, 0.05]) * rough(random, count, 0.3)


def saw(random, count):
    period = int(random.choice([8, 16, 32]))
    return (np.arange(count) % period) / period


def pits(random, count):
    return 1e-2 * rough(random, count) - np.where(random.uniform(size=count) < 0.1, random.exponential(1, count), 0.0)


def needles(random, count):
    every = int(random.choice([7, 11, 16]))
    return np.where(np.arange(count) % every == 0, 1 + 0.1 * random.standard_normal(count), 0.0)


def noise(random, count):
    return random.standard_normal(count)


def smooth(random, count):
    modes = max(count // 8, 1)
    amplitude = roughness.amplitudes(modes, random.uniform())
    return series(0.5 * amplitude * np.exp(1j * random.uniform(0, 2 * np.pi, modes)), count)


def backwards(random, count):
    return random.choice([steps, saw, clipped])(random, count)[::-1].copy()


SHAPES = (steps, spikes, peak, plateau, clipped, saw, pits, needles, noise, smooth, backwards)
FAMILIES = (*(shape.__name__ for shape in SHAPES), "few", "odd")


def samples(family, random):
    """Return the samples of a random line of a family, with mean 0 and rms height 1."""
    counts = {"few": FEW, "odd": ODD}.get(family, EVEN)
    shapes = {shape.__name__: shape for shape in SHAPES}
    while True:
        shape = shapes.get(family) or random.choice(SHAPES)
        height = shape(random, int(random.choice(counts)))
        if np.ptp(height) > 0:
            height = height - height.mean()
            return height / height.std()
