"""Shift factors of measured moduli beside published ones: ``python -m benchmarks superposition published_factors``

The published factors are those of straight lines: to each curve a power of the frequency is fitted by least squares of
the modulus itself, and neighbours are brought together at one modulus, half way between the lowest of the curve
nearer to the reference and the highest of the other.
"""

from pathlib import Path

import numpy as np
from scipy.optimize import curve_fit
from scipy.stats import t as student

from mdr_dask.fits.curve_tables import read_table
from mdr_dask.physics.superposition.master_curve import superpose

DATA = Path(__file__).parents[2] / "tests" / "data" / "dma"
REFERENCE = 7
"""Number of the curve at 3 C, counted from the coldest, at which the published factors are zero."""


def measured():
    """Return temperatures (C) and (log10 of time, log10 of modulus) of each curve, coldest first, as measured."""
    table = read_table(DATA / "time_user_raw.csv").to_numpy()
    parts = [table[table[:, 3] == number] for number in np.unique(table[:, 3])]
    return np.array([part[:, 2].mean() for part in parts]), [tuple(np.log10(part[:, :2]).T) for part in parts]


def published():
    """Return log10 of the published factors, coldest first."""
    return read_table(DATA / "time_user_raw__shift_factors.csv").to_numpy()[::-1, 1]


def by_straight_lines(curves):
    """Return log10 of the factors as they were published: see above."""
    return _chained(curves, _met_by_lines)


def by_parabolas(curves):
    """Return log10 of the factors with parabolas instead of lines, at the mean distance over the moduli shared."""
    return _chained(curves, _met_by_parabolas)


def _chained(curves, meet):
    factors = np.zeros(len(curves))
    for other in range(REFERENCE - 1, -1, -1):
        factors[other] = factors[other + 1] + meet(curves[other + 1], curves[other])
    for other in range(REFERENCE + 1, len(curves)):
        factors[other] = factors[other - 1] + meet(curves[other - 1], curves[other])
    return factors


def _power(frequency, modulus, exponent):
    return modulus * frequency**exponent


def _met_by_lines(near, far):
    constants = [curve_fit(_power, 10**-x, 10**y)[0] for x, y in (near, far)]
    lowest, highest = _power(10 ** -near[0], *constants[0]).min(), _power(10 ** -far[0], *constants[1]).max()
    at = [np.log10((lowest + highest) / 2 / modulus) / exponent for modulus, exponent in constants]
    return at[0] - at[1]


def _met_by_parabolas(near, far):
    grid = np.linspace(-1.5, 2.5, 4001)
    parabolas = [np.polyfit(-x, y, 2) for x, y in (near, far)]
    ends = [np.sort(np.polyval(parabola, -x)) for parabola, (x, _) in zip(parabolas, (near, far), strict=True)]
    shared = np.linspace(max(end[0] for end in ends), min(end[-1] for end in ends), 9)
    at = [np.interp(shared, np.polyval(parabola, grid), grid) for parabola in parabolas]
    return float(np.mean(at[0] - at[1]))


def without_scatter(curves, result):
    """Return the curves as the merged one would have them."""
    return [
        (x, np.interp(x + shift, result.curve_x, result.curve_y))
        for (x, _), shift in zip(curves, result.horizontal, strict=True)
    ]


def scatter_of_lines(curves, noise, times=200):
    """Return the standard deviations of factors by straight lines where log10 of the modulus scatters by `noise`."""
    random = np.random.default_rng(1)
    again = [[(x, y + noise * random.standard_normal(x.size)) for x, y in curves] for _ in range(times)]
    return np.std([by_straight_lines(each) for each in again], axis=0)


def joint(temperatures, curves):
    """Return the joint fit, log10 of its factors, and the half widths of their intervals of 95 %."""
    result = superpose(temperatures, curves, reference=temperatures[REFERENCE])
    return result, -result.horizontal, student.ppf(0.975, result.freedom) * result.horizontal_error


def main():
    temperatures, curves = measured()
    result, ours, half = joint(temperatures, curves)
    later = joint(temperatures, [(x[1:], y[1:]) for x, y in curves])[1]
    smooth, theirs = without_scatter(curves, result), published()
    lines, scatter = by_straight_lines(smooth), scatter_of_lines(smooth, result.noise)
    print(f"published less straight lines: {np.abs(theirs - by_straight_lines(curves)).max():.1e}")
    print(f"scatter {result.noise:.4f} decades of modulus")
    print("T, ours, 95 %, published, difference, inside, lines through our curve, their scatter, ours without 10 s")
    for row in zip(temperatures, ours, half, theirs, theirs - ours, lines - ours, scatter, later, strict=True):
        inside = "yes" if abs(row[4]) <= row[2] else "no"
        print("{:6.1f} {:8.3f} {:6.3f} {:8.3f} {:7.3f} {} {:7.3f} {:6.3f} {:8.3f}".format(*row[:5], inside, *row[5:]))
    print("steps from, ours, 95 %, published, parabolas, most that the line misses, decades of modulus shared")
    bent = by_parabolas(curves)
    for k in range(temperatures.size - 1):
        pair = [result.covariance[i, j] for i, j in ((k, k), (k + 1, k + 1), (k, k + 1))]
        width = student.ppf(0.975, result.freedom) * np.sqrt(pair[0] + pair[1] - 2 * pair[2])
        steps = [float(factors[k + 1] - factors[k]) for factors in (ours, theirs, bent)]
        misses = [np.abs(y - np.polyval(np.polyfit(x, y, 1), x)).max() for x, y in curves[k : k + 2]]
        shared = curves[k + 1][1].max() - curves[k][1].min()
        numbers = (temperatures[k], steps[0], width, *steps[1:], max(misses), shared)
        print("{:6.1f} {:7.3f} {:.3f} {:7.3f} {:7.3f} {:.4f} {:.3f}".format(*numbers))


if __name__ == "__main__":
    main()
