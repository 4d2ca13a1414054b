"""How often the bars of shift factors cover the truth, and processor time: python -m benchmarks.superposition [40]

Families of ten curves of thirty points on one curve, two decades wide, 0.2 to 0.6 decades apart.
"""

import sys
import time

import numpy as np
from scipy.stats import t as student

from mdr_dask.errors import DataError
from mdr_dask.physics.superposition.master_curve import superpose

SHAPES = {
    "sigmoid": lambda x: 2 * np.tanh(x / 2),
    "nearly straight": lambda x: 0.5 * x + 0.02 * x**2,
    "bump": lambda x: np.exp(-(x**2) / 2),
    "power law": lambda x: 0.3 * x,
    "flat plateau": lambda x: -0.2 * np.logaddexp(0, -3 * x),
}
SCATTER = (0.003, 0.01, 0.03)
FIRST_SEED = {False: 500_000, True: 1_200_000}
RISE = 0.02


def family(seed, scatter, shape, vertical, curves=10, points=30):
    """Return groups, curves, and true horizontal and vertical factors, zero for the sixth curve."""
    random = np.random.default_rng(seed)
    shifts = np.append(0, np.cumsum(random.uniform(0.2, 0.6, curves - 1)))
    shifts -= shifts[5]
    heights = RISE * vertical * (np.arange(curves) - 5)
    x = np.linspace(-1, 1, points)
    pieces = [
        (x, SHAPES[shape](x + shift) - height + scatter * random.standard_normal(points))
        for shift, height in zip(shifts, heights, strict=True)
    ]
    return np.arange(curves, dtype=float), pieces, shifts, heights


def judged(shape, scatter, vertical, families):
    """Return the share of factors inside their bars of 68 %, processor times, and how many families were refused."""
    inside, times, refused = [], [], 0
    for seed in range(FIRST_SEED[vertical], FIRST_SEED[vertical] + families):
        groups, pieces, shifts, heights = family(seed, scatter, shape, vertical)
        start = time.process_time()
        try:
            result = superpose(groups, pieces, vertical, reference=5.0)
        except DataError:
            refused += 1
            continue
        finally:
            times.append(time.process_time() - start)
        bars = student.ppf(0.8413, result.freedom) * np.array([result.horizontal_error, result.vertical_error])
        found = np.abs([result.horizontal - shifts, result.vertical - heights]) <= bars
        inside.append(np.delete(found[: 1 + vertical], 5, axis=1).mean())
    return float(np.mean(inside)), times, refused


def main(families=40):
    for vertical in (False, True):
        superpose(*family(0, 0.01, "sigmoid", vertical)[:2], vertical)  # compiles
        print("vertical factors too" if vertical else "horizontal factors", "at scatter", *SCATTER)
        for shape in SHAPES:
            found = [judged(shape, scatter, vertical, families) for scatter in SCATTER]
            shares = " / ".join(f"{share:.2f}" for share, _, _ in found)
            median, most = (" / ".join(f"{1e3 * of(times):.1f}" for _, times, _ in found) for of in (np.median, np.max))
            refused = sum(number for *_, number in found)
            print(f"{shape:16s} covered {shares}, median time {median} ms, longest {most} ms, refused {refused}")


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
