"""Compare shift factors of measured moduli with published ones: ``python -m benchmarks published_factors``.

The published factors follow from straight lines in double-logarithmic axes. A power of the frequency is fitted to each
curve by least squares of the modulus itself. Neighbouring curves are then shifted so that their lines meet at one
modulus, half way between the lowest modulus of the curve nearer to the reference and the highest of the other curve.
"""

from pathlib import Path

import numpy as np
from scipy.optimize import curve_fit

from mdr_dask.fits.curve_tables import read_table
from mdr_dask.physics.superposition.master_curve import superpose

DATA = Path(__file__).parents[1] / "tests" / "data" / "dma"
REFERENCE = 7
"""Index of the curve at 3 degC, counted from the coldest; its published factor is zero."""


def measured():
    """Return the measured temperature (degC) and (log10 time, log10 modulus) of each curve, coldest first."""
    table = read_table(DATA / "time_user_raw.csv").to_numpy()
    parts = [table[table[:, 3] == number] for number in np.unique(table[:, 3])]
    return np.array([part[:, 2].mean() for part in parts]), [tuple(np.log10(part[:, :2]).T) for part in parts]


def published():
    """Return log10 of the published factors, coldest first."""
    return read_table(DATA / "time_user_raw__shift_factors.csv").to_numpy()[::-1, 1]


def by_straight_lines(curves):
    """Return log10 of the factors by the method of the published ones (straight lines, see above)."""
    factors = np.zeros(len(curves))
    for other in range(REFERENCE - 1, -1, -1):
        factors[other] = factors[other + 1] + _met_by_lines(curves[other + 1], curves[other])
    for other in range(REFERENCE + 1, len(curves)):
        factors[other] = factors[other - 1] + _met_by_lines(curves[other - 1], curves[other])
    return factors


def _power(frequency, modulus, exponent):
    return modulus * frequency**exponent


def _met_by_lines(near, far):
    constants = [curve_fit(_power, 10**-x, 10**y)[0] for x, y in (near, far)]
    lowest, highest = _power(10 ** -near[0], *constants[0]).min(), _power(10 ** -far[0], *constants[1]).max()
    at = [np.log10((lowest + highest) / 2 / modulus) / exponent for modulus, exponent in constants]
    return at[0] - at[1]


def joint(temperatures, curves, vertical="modulus"):
    """Return the superposition, log10 of its factors, and the ends of their 95 % intervals."""
    found = superpose(temperatures, curves, vertical, temperatures[REFERENCE], kelvin=temperatures + 273.15)
    low, high = -found.interval()[::-1, : temperatures.size]
    return found, -found.horizontal, low, high


def main():
    temperatures, curves = measured()
    found, ours, low, high = joint(temperatures, curves)
    theirs = published()
    print(f"published less straight lines: {np.abs(theirs - by_straight_lines(curves)).max():.1e}")
    print(f"scatter {found.noise[0]:.4f} decades of modulus; not determined: {found.undetermined}")
    print("T, ours, 95 %, published, inside")
    for row in zip(temperatures, ours, low, high, theirs, strict=True):
        inside = "yes" if row[2] <= row[4] <= row[3] else "no"
        print("{:6.1f} {:8.3f} {:8.3f} {:8.3f} {:8.3f} {}".format(*row, inside))
