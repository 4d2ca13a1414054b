"""Relaxation moduli measured at 21 temperatures: most of our intervals contain the published shift factors.

The published factors follow from straight lines in double-logarithmic axes. A power of the frequency is fitted to each
curve by least squares of the modulus itself. Neighbouring curves are then shifted so that their lines meet at one
modulus, half way between the lowest modulus of the curve nearer to the reference and the highest of the other curve.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import curve_fit

from mdr_dask.fits.curve_tables import read_table
from mdr_dask.physics.superposition.master_curve import superpose

DATA = Path(__file__).parents[2] / "data" / "dma"
#: Index of the curve at 3 degC, counted from the coldest; its published factor is zero.
REFERENCE = 7


def measured():
    """Return the measured temperature (degC) and (log10 time, log10 modulus) of each curve, coldest first."""
    table = read_table(DATA / "time_user_raw.csv").to_numpy()
    parts = [table[table[:, 3] == number] for number in np.unique(table[:, 3])]
    return np.array([part[:, 2].mean() for part in parts]), [tuple(np.log10(part[:, :2]).T) for part in parts]


def by_straight_lines(curves):
    """Return log10 of the factors by the method of the published ones."""
    factors = np.zeros(len(curves))
    for other in range(REFERENCE - 1, -1, -1):
        factors[other] = factors[other + 1] + met_by_lines(curves[other + 1], curves[other])
    for other in range(REFERENCE + 1, len(curves)):
        factors[other] = factors[other - 1] + met_by_lines(curves[other - 1], curves[other])
    return factors


def power(frequency, modulus, exponent):
    return modulus * frequency**exponent


def met_by_lines(near, far):
    constants = [curve_fit(power, 10**-x, 10**y)[0] for x, y in (near, far)]
    lowest, highest = power(10 ** -near[0], *constants[0]).min(), power(10 ** -far[0], *constants[1]).max()
    at = [np.log10((lowest + highest) / 2 / modulus) / exponent for modulus, exponent in constants]
    return at[0] - at[1]


@pytest.mark.slow
def test_most_published_factors_lie_in_the_intervals():
    temperatures, curves = measured()
    theirs = read_table(DATA / "time_user_raw__shift_factors.csv").to_numpy()[::-1, 1]
    np.testing.assert_allclose(by_straight_lines(curves), theirs, atol=1e-6)
    found = superpose(temperatures, curves, "modulus", temperatures[REFERENCE], kelvin=temperatures + 273.15)
    low, high = -found.interval()[::-1, : temperatures.size]
    inside = (low <= theirs) & (theirs <= high)
    assert inside.mean() > 0.75  # 0.81 to 1 for different seeds: the factors of the cold curves are not determined
    assert found.noise[0] < 0.005
