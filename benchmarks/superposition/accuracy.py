"""Coverage of the bars of shift factors, and processor time: ``python -m benchmarks superposition accuracy [10]``

Families of ten curves of thirty points on one curve, two decades wide, 0.2 to 0.6 decades apart, and the time that one
of them takes with its laws; then families that run into a plateau, with short overlaps, for which intervals of 95 % are
judged.
"""

import sys
import time

import numpy as np

from mdr_dask.errors import DataError
from mdr_dask.physics.superposition.laws import fit_arrhenius, fit_wlf
from mdr_dask.physics.superposition.master_curve import superpose

SHAPES = {
    "sigmoid": lambda x: 2 * np.tanh(x / 2),
    "nearly straight": lambda x: 0.5 * x + 0.02 * x**2,
    "bump": lambda x: np.exp(-(x**2) / 2),
    "power law": lambda x: 0.3 * x,
    "flat plateau": lambda x: -0.2 * np.logaddexp(0, -3 * x),
}
ON_PLATEAUS = {
    "sigmoid": lambda x: np.tanh(x / 5),
    "steep": lambda x: 2 + 1.5 * np.tanh(x / 2),
    "decay": lambda x: -np.log10(1 + 10**x),
}
PLATEAUS = (
    ("decay", 15, 10, 0.02, 0.3),
    ("decay", 15, 20, 0.005, 0.3),
    ("decay", 15, 20, 0.02, 0.6),
    ("decay", 8, 20, 0.02, 0.3),
    ("decay", 3, 20, 0.02, 0.3),
    ("steep", 15, 10, 0.02, 0.3),
    ("steep", 15, 20, 0.005, 0.3),
    ("steep", 15, 20, 0.02, 0.6),
    ("steep", 5, 20, 0.01, 0.4),
    ("sigmoid", 15, 10, 0.02, 0.3),
    ("sigmoid", 8, 20, 0.005, 0.5),
    ("sigmoid", 3, 10, 0.02, 0.3),
)
"""Shape, curves, points, relative scatter of the ordinate, and overlap of neighbours."""

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
            result = superpose(groups, pieces, "free" if vertical else "none", reference=5.0)
        except DataError:
            refused += 1
            continue
        finally:
            times.append(time.process_time() - start)
        bars = np.array([result.horizontal_error, result.vertical_error])
        found = np.abs([result.horizontal - shifts, result.vertical - heights]) <= bars
        inside.append(np.delete(found[: 1 + vertical], 5, axis=1).mean())
    return float(np.mean(inside)), times, refused


def plateau_family(shape, curves, points, noise, overlap, seed):
    """Return groups, curves two decades wide, and true factors, zero for the middle one; overlaps vary by an eighth."""
    random = np.random.default_rng(seed)
    steps = 2 * (1 - overlap) * (1 + 0.25 * random.uniform(-0.5, 0.5, curves - 1))
    shifts = np.append(0, np.cumsum(steps))
    shifts -= shifts[curves // 2]
    x = np.linspace(-1, 1, points)
    scatter = np.log10(1 + noise * random.standard_normal((curves, points)))
    pieces = [(x, ON_PLATEAUS[shape](x + shift) + each) for shift, each in zip(shifts, scatter, strict=True)]
    return np.arange(curves, dtype=float), pieces, shifts


def on_plateau(setting, seed, vertical=False):
    """Return errors of horizontal (and vertical) factors over half widths of 95 %, the first errors, and the time."""
    groups, pieces, shifts = plateau_family(*setting, seed)
    heights = RISE * vertical * (groups - groups[groups.size // 2])
    pieces = [(x, y - height) for (x, y), height in zip(pieces, heights, strict=True)]
    start = time.process_time()
    result = superpose(groups, pieces, "free" if vertical else "none")
    spent = time.process_time() - start
    errors = np.abs([result.horizontal - shifts, result.vertical - heights][: 1 + vertical])
    low, high = result.interval()
    widths = ((high - low) / 2).reshape(2, -1)[: 1 + vertical]
    others = np.arange(shifts.size) != shifts.size // 2
    ratios = errors[:, others] / widths[:, others]
    return ratios, errors[0, others], spent


def on_plateaus(families=10, first=900_000, vertical=False):
    """Print for each setting how many intervals of 95 % hold, the largest error, its half width, and processor time."""
    beside = ", those of vertical factors" if vertical else ""
    print(f"intervals of 95 % on plateaus: held{beside}; median largest error, its half width, families beyond three")
    for setting in PLATEAUS:
        found, refused = [], 0
        for seed in range(first, first + families):
            try:
                found.append(on_plateau(setting, seed, vertical))
            except DataError:
                refused += 1
        ratios, errors, times = zip(*found, strict=True)
        held = " ".join(f"{share:.3f}" for share in np.mean(np.array(ratios) <= 1, axis=(0, 2)))
        most = [
            (error.max(), error.max() / ratio[0, error.argmax()]) for ratio, error in zip(ratios, errors, strict=True)
        ]
        beyond = sum(bool(np.any(ratio[0] > 3)) for ratio in ratios)
        largest, half = np.median(most, axis=0)
        numbers = f"{held}; {largest:.3f} {half:.3f} {beyond}/{len(found)} {1e3 * np.median(times):.1f} ms"
        print(f"{setting!s:34s} {numbers}, refused {refused}")


def with_laws(families=10):
    """Print median processor times of a merge of ten temperatures, thirty points each, and of its laws."""
    laws, times = (fit_arrhenius, fit_wlf), []
    for seed in range(families + 1):
        numbers, pieces, *_ = family(FIRST_SEED[False] + seed, 0.01, "sigmoid", False)
        moments = [time.process_time()]
        merged = superpose(300.0 + 10 * numbers, pieces)
        moments.append(time.process_time())
        for law in laws:
            law(merged.groups, merged.horizontal, merged.covariance[:10, :10], 5, merged.reference)
            moments.append(time.process_time())
        times.append(np.diff(moments))
    each = dict(zip(["merge", *(law.__name__ for law in laws)], 1e3 * np.median(times[1:], axis=0), strict=True))
    whole = 1e3 * np.median(np.sum(times[1:], axis=1))
    print(f"merge with laws {whole:.1f} ms:", ", ".join(f"{name} {spent:.1f}" for name, spent in each.items()))


def main(families=10):
    with_laws(families)
    for vertical in (False, True):
        print("vertical factors too" if vertical else "horizontal factors", "at scatter", *SCATTER)
        for shape in SHAPES:
            found = [judged(shape, scatter, vertical, families) for scatter in SCATTER]
            shares = " / ".join(f"{share:.2f}" for share, _, _ in found)
            median, most = (" / ".join(f"{1e3 * of(times):.1f}" for _, times, _ in found) for of in (np.median, np.max))
            refused = sum(number for *_, number in found)
            print(f"{shape:16s} covered {shares}, median time {median} ms, longest {most} ms, refused {refused}")
    for vertical in (False, True):
        on_plateaus(families, vertical=vertical)


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
