"""The closed courses of eqs. 4.13 to 4.15 and the proportion of eq. 4.8, planted and wrong."""

import numpy as np
import pytest
import xarray as xr

from mdr_dask.errors import FitError
from mdr_dask.fits.jumps import jump_law
from mdr_dask.fits.kinetic_courses import FITS

FIT = {fit.name: fit for fit in FITS}
TIMES = np.geomspace(1e-3, 20, 30)
POINTS, LENGTH, TAU, SLOPE, HURST = 5000, 0.01, 1e-3, 0.07, 0.6
WAVENUMBER = np.pi * POINTS / LENGTH
LEAST = 0.92
LINES = pytest.mark.parametrize("lines", [5, 10, 30])


def studies(lines, stores=200, speeds=(2e-4, 0.02), change=0.2, wrong=1.0, jump=1.0, zeta=None):
    """Return studies of the closed law, jump and rate multiplied by factors, that lines scatter about."""
    rng = np.random.default_rng(8)
    speeds, change = np.array(speeds), np.atleast_1d(change)
    shape = (speeds.size, change.size, stores, lines)
    first, second, third = rng.standard_normal((3, 1, 1, stores, lines)) + 0.3 * rng.standard_normal((3, *shape))
    x = (speeds * TAU * WAVENUMBER)[:, None, None, None]
    before = np.minimum(0.3 * x**0.3, 1.2)
    step = change[:, None, None]
    size = jump * jump_law(before, 0.4) * step if zeta is None else zeta(step) * before * step
    after = (before + 0.6 * size) * (1 + 0.02 * first)
    before, size = before * (1 + 0.02 * first), size * (1 + 0.05 * second)
    rate = np.where(x < 1, x, x ** (1 - HURST)) * wrong
    decay = np.exp(-rate[..., None] * TIMES) * (1 + 0.1 * third[..., None] * rate[..., None] * TIMES)
    trace = after[..., None] + (before + size - after)[..., None] * decay
    dims = ("velocity", "velocity_change", "normal_force", "realisation")
    outputs = {"before": before, "jump": size, "after": after}
    data = {f"friction_coefficient_{name}": (dims, SLOPE * value) for name, value in outputs.items()}
    data["friction_coefficient"] = ((*dims, "relaxation_times"), SLOPE * trace)
    data["rms_slope"] = (dims, np.full(shape, SLOPE))
    fixed = {"hurst": HURST, "points": POINTS, "length": LENGTH, "relaxation_time": TAU}
    axes = {"velocity": speeds, "velocity_change": change, "normal_force": np.arange(1.0, stores + 1)}
    return xr.Dataset(data, coords=axes | fixed | {"relaxation_times": TIMES})


def judged(found, verdict):
    return float(found["law_holds"].str.startswith(verdict).mean())


def coverage(found, name, truth):
    return float(((found[f"{name}_low"] <= truth) & (truth <= found[f"{name}_high"])).mean())


@LINES
def test_a_course_by_the_closed_law(lines):
    found = FIT["relaxation_course"].compute({"": studies(lines)})
    assert judged(found, "yes") >= LEAST
    # law less course at the start is the error of the jump: none
    assert coverage(found, "start_error", 0.0) >= LEAST
    assert found["rms_error_of_rate"].max() < 0.1


@LINES
def test_a_course_with_another_jump_or_another_rate_is_named(lines):
    found = FIT["relaxation_course"].compute({"": studies(lines, 40, jump=2.0)})
    assert judged(found, "no: departs") == 1
    assert coverage(found, "start_error", -0.5) >= LEAST
    found = FIT["relaxation_course"].compute({"": studies(lines, 40, wrong=6.0)})
    assert judged(found, "no: departs") == 1
    assert np.all(found["rms_error_of_rate"] > 0.05)
    assert coverage(found, "start_error", 0.0) >= LEAST


SIZES = (-0.2, -0.1, 0.1, 0.2, 0.3)


@LINES
def test_jumps_in_proportion_to_the_change_of_velocity(lines):
    found = FIT["jump_linearity"].compute({"": studies(lines, change=SIZES, zeta=lambda _: 0.5)})
    assert found["zeta"].dims == ("velocity", "normal_force")
    assert coverage(found, "zeta", 0.5) >= LEAST
    assert coverage(found, "zeta_trend", 0.0) >= LEAST
    assert coverage(found, "xi", 0.3) >= LEAST
    assert judged(found, "yes") >= LEAST
    curved = FIT["jump_linearity"].compute({"": studies(lines, 40, change=SIZES, zeta=lambda dv: 0.5 * (1 + 2 * dv))})
    assert judged(curved, "no: departs") == 1
    assert coverage(curved, "zeta_trend", 2.0) >= LEAST
    # each interval is as wide as the departures of its own level: xi is 0.6 zeta
    zeta, xi = ((curved[f"{name}_high"] - curved[f"{name}_low"]).median().item() for name in ("zeta", "xi"))
    assert xi / zeta == pytest.approx(0.6, rel=0.3)


def test_one_size_of_jump_says_so():
    with pytest.raises(FitError, match="jumps dv / v_1 of three sizes"):
        FIT["jump_linearity"].compute({"": studies(5, 2)})
