"""Coverage of the 95 % intervals of the fits of velocity jumps, in synthetic stores with realistic scatter."""

import numpy as np
import pytest
import xarray as xr
from fit_studies import judged

from mdr_dask.fits import available
from mdr_dask.fits.jumps import REGION_ONE, jump_law

FIT = available("velocity_jump")
TIMES = np.geomspace(1e-3, 20, 40)
POINTS, LENGTH, TAU, SLOPE, CHANGE = 5000, 0.01, 1e-3, 0.07, 0.2
WAVENUMBER = np.pi * POINTS / LENGTH
SHARE = 0.25  # part of the jump that relaxes
LEAST = 0.9  # 95 % minus 2.3 standard deviations of a fraction of 100 stores
pytestmark = pytest.mark.slow
LINES = pytest.mark.parametrize("lines", [5, 30])


def studies(speeds: np.ndarray, stores: int, lines: int, power: float = 0.5, shape: float = 1.0) -> xr.Dataset:
    """Return many stores along the axis of the load, each with lines of its own that all its velocities share.

    The means follow eq. 4.11 with 0.42 and exp(-(x^power t')^shape); every line has its own height, and its own course
    about the mean, which errs for whole stretches of time.
    """
    rng = np.random.default_rng(5)
    x = speeds * TAU * WAVENUMBER
    shared = rng.standard_normal((5, 1, stores, lines))
    own = 0.5 * rng.standard_normal((5, speeds.size, stores, lines))
    first, second, third, fourth, fifth = shared + own
    mean_before = np.minimum(0.05 * x**0.5, 1.2)[:, None, None]
    mean_jump = CHANGE * jump_law(mean_before, 0.42)
    before, jump = mean_before * (1 + 0.1 * first), mean_jump * (1 + 0.07 * first + 0.03 * second)
    decay = np.exp(-((x[:, None] ** power * TIMES) ** shape))[:, None, None, :]
    run = (x[:, None] ** power * TIMES)[:, None, None, :]
    part = SHARE * mean_jump
    relaxing = part[..., None] * (
        (1 + 0.3 * third[..., None]) * decay
        + 0.3 * fourth[..., None] * run * np.exp(-run)
        + 0.2 * fifth[..., None] * np.exp(-3 * run)
    )
    start = part * (1 + 0.3 * third + 0.2 * fifth)
    after = before + jump - start
    dims = ("velocity", "normal_force", "realisation")
    levels = {"before": before, "jump": jump, "after": after}
    outputs = {f"friction_coefficient_{name}": (dims, SLOPE * level) for name, level in levels.items()}
    outputs["friction_coefficient"] = ((*dims, "relaxation_times"), SLOPE * (after[..., None] + relaxing))
    outputs["rms_slope"] = (dims, np.full(before.shape, SLOPE))
    fixed = {"hurst": 0.5, "points": POINTS, "length": LENGTH, "relaxation_time": TAU, "velocity_change": CHANGE}
    axes = {"velocity": speeds, "normal_force": np.arange(1.0, stores + 1), "relaxation_times": TIMES}
    return xr.Dataset(outputs, coords=axes | fixed)


def coverage(found: xr.Dataset, name: str, truth: object) -> float:
    """Return the fraction of the intervals with finite ends that contain the truth."""
    known = found[f"{name}_low"].notnull()
    held = (found[f"{name}_low"] <= truth) & (truth <= found[f"{name}_high"])
    return float(held.where(known).mean())


RATE, BEFORE = (0.05 * TAU * WAVENUMBER) ** 0.5, 0.05 * np.sqrt(0.01 * TAU * WAVENUMBER)
JUMP = CHANGE * jump_law(np.array(BEFORE), 0.42)


def of_each_store(data: xr.Dataset) -> xr.Dataset:
    """Fit the jump law to each store separately."""
    stores = [FIT["jump_law"].compute({"": data.isel(normal_force=k)}) for k in range(data.sizes["normal_force"])]
    return xr.concat(stores, "store")


@LINES
def test_jump_and_rate_and_state_terms(lines: int) -> None:
    data = studies(np.array([0.01]), 200, lines)
    found, lengths = (FIT[name].compute({"": data}) for name in ("kinetics", "relaxation"))
    truths = {
        "jump_over_slope": JUMP / CHANGE,
        "zeta": JUMP / BEFORE / CHANGE,
        "xi": (1 - SHARE) * JUMP / BEFORE / CHANGE,
        "relaxing_over_slope": SHARE * JUMP,
        "direct_effect": JUMP * SLOPE / np.log(1.2),
        "evolution_effect": SHARE * JUMP * SLOPE / np.log(1.2),
    }
    for name, truth in truths.items():
        assert coverage(found, name, truth) >= LEAST
    assert coverage(lengths, "relaxation_length", 1.2 * 0.01 * TAU / (0.01 * TAU * WAVENUMBER) ** 0.5) >= LEAST


@LINES
def test_rate_and_when_one_exponential_is_enough(lines: int) -> None:
    found = FIT["relaxation"].compute({"": studies(np.array([0.05]), 100, lines)})
    # the error of the trapezoidal rule with 9 moments per decade is 2 %
    for name, truth in (("rate", RATE), ("integral_rate", 0.98 * RATE)):
        assert coverage(found, name, truth) >= LEAST
    # the planted relaxation is one exponential, so that only chance gives another verdict
    assert judged(found, "no:") < 0.08


@LINES
def test_power_of_the_rate_of_lines_that_all_velocities_share(lines: int) -> None:
    found = FIT["rate_power"].compute({"": studies(np.geomspace(1e-3, 1, 3), 100, lines)}).sel(regime="above")
    assert coverage(found, "power", 0.5) >= LEAST
    # five lines do not determine every rate within a factor of 1.6
    unknown = found["power"].isnull()
    assert np.all(found["fitted_law_holds"].where(unknown, "not tested").str.startswith("not tested"))
    assert judged(found, "no:") < 0.08


@LINES
def test_constant_and_limits_of_the_jump(lines: int) -> None:
    speeds = np.geomspace(1e-4, 1, 6)
    found = of_each_store(studies(speeds, 100, lines))
    assert coverage(found, "constant", 0.42) >= LEAST
    assert judged(found, "no:") < 0.08
    before = 0.05 * np.sqrt(speeds * TAU * WAVENUMBER)
    before = before[before < REGION_ONE]
    assert coverage(found, "zeta", np.mean(jump_law(before, 0.42) / before)) >= LEAST


@LINES
def test_jumps_by_another_law_are_named(lines: int) -> None:
    """The planted jumps are proportional to the square of mu_1."""
    data = studies(np.geomspace(1e-4, 1, 6), 3, lines).isel(normal_force=0)
    before = data["friction_coefficient_before"]
    found = FIT["jump_law"].compute({"": data.assign(friction_coefficient_jump=before**2)})
    assert found["law_holds"].item().startswith("no: departs by")
    assert found["constant_high"] / found["constant_low"] > 3
    assert found["zeta_holds"].item().startswith("no: departs by")
