"""Do the 95 % intervals of the kinetic fits hold the truth, in synthetic stores whose lines scatter as real ones do?"""

import numpy as np
import xarray as xr

from mdr_dask.fit.kinetics import FITS, jump_law

FIT = {fit.name: fit for fit in FITS}
TIMES = np.geomspace(1e-3, 20, 40)
POINTS, LENGTH, TAU, SLOPE, CHANGE = 5000, 0.01, 1e-3, 0.07, 0.2
WAVENUMBER = np.pi * POINTS / LENGTH
LINES = 30
SHARE = 0.25  # of the jump that relaxes
# of 200 stores 95 % must hold the truth, give or take three binomial deviations and what 30 lines do to a bootstrap
LEAST, MOST = 0.88, 0.99


def studies(speeds: np.ndarray, stores: int, power: float = 0.5, shape: float = 1.0) -> xr.Dataset:
    """Return many stores along the axis of the load, each with lines of its own that all its velocities share.

    The means follow eq. 4.11 with 0.42 and exp(-(x^power t')^shape); every line has its own height, and its own course
    about the mean, which errs for whole stretches of time.
    """
    rng = np.random.default_rng(5)
    x = speeds * TAU * WAVENUMBER
    lines = rng.standard_normal((5, 1, stores, LINES))
    own = 0.5 * rng.standard_normal((5, speeds.size, stores, LINES))
    first, second, third, fourth, fifth = lines + own
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
    held = (found[f"{name}_low"] <= truth) & (truth <= found[f"{name}_high"])
    return float(held.mean())


def test_jump_and_rate_and_state_terms() -> None:
    data = studies(np.array([0.01]), 200)
    found = FIT["kinetics"].compute({"": data})
    before = 0.05 * np.sqrt(0.01 * TAU * WAVENUMBER)
    jump = CHANGE * jump_law(np.array(before), 0.42)
    assert LEAST < coverage(found, "jump_over_slope", jump / CHANGE) < MOST
    assert LEAST < coverage(found, "zeta", jump / before / CHANGE) < MOST
    assert LEAST < coverage(found, "xi", (1 - SHARE) * jump / before / CHANGE) < MOST
    assert LEAST < coverage(found, "relaxing_over_slope", SHARE * jump) < MOST
    terms = FIT["rate_and_state"].compute({"": data})
    rate = (0.01 * TAU * WAVENUMBER) ** 0.5
    assert LEAST < coverage(terms, "direct_effect", jump * SLOPE / np.log(1.2)) < MOST
    assert LEAST < coverage(terms, "evolution_effect", SHARE * jump * SLOPE / np.log(1.2)) < MOST
    assert LEAST < coverage(terms, "slip_length", 1.2 * 0.01 * TAU / rate) < MOST


def test_rate_and_when_one_exponential_is_enough() -> None:
    found = FIT["relaxation"].compute({"": studies(np.array([0.05]), 200)})
    rate = (0.05 * TAU * WAVENUMBER) ** 0.5
    assert LEAST < coverage(found, "rate", rate) < MOST
    assert LEAST < coverage(found, "rate_unweighted", rate) < MOST
    # the trapezoidal rule on 9 moments a decade adds 2 %
    assert LEAST < coverage(found, "integral_rate", 0.98 * rate) < MOST
    # the truth is one exponential, and is doubted by chance only
    assert float((found["one_is_enough"] == "no").mean()) < 0.12


def test_stretched_exponential() -> None:
    data = studies(np.array([0.05]), 80, shape=0.5)
    found = FIT["relaxation_shape"].compute({"": data})
    known = found.isel(normal_force=np.flatnonzero(np.isfinite(found["stretched_rate"].values[0])))
    assert known.sizes["normal_force"] > 70
    assert 0.85 < coverage(known, "stretched_exponent", 0.5) <= 1.0
    assert 0.85 < coverage(known, "stretched_rate", (0.05 * TAU * WAVENUMBER) ** 0.5) <= 1.0


def test_power_of_the_rate_of_lines_that_all_velocities_share() -> None:
    found = FIT["rate_power"].compute({"": studies(np.geomspace(1e-3, 1, 3), 100)}).sel(regime="above")
    assert np.all(found["cases"] == 3)
    assert LEAST < coverage(found, "power", 0.5) < MOST
    assert LEAST < coverage(found, "power_unweighted", 0.5) < MOST


def test_constant_and_limits_of_the_jump() -> None:
    speeds = np.geomspace(1e-4, 1, 6)
    data = studies(speeds, 200)
    results = [FIT["jump_law"].compute({"": data.isel(normal_force=k)}).squeeze() for k in range(200)]
    found = xr.concat(results, "store")
    assert LEAST < coverage(found, "constant", 0.42) < MOST
    limits = [FIT["jump_limits"].compute({"": data.isel(normal_force=k)}).squeeze() for k in range(200)]
    first = xr.concat(limits, "store").sel(limit="region I")
    x = speeds * TAU * WAVENUMBER
    # which cases lie in region I is a matter of their mean: two of them always, with the lines of all stores
    assert set(first["cases"].values) == {2}
    before = 0.05 * np.sqrt(x[:2])
    assert LEAST < coverage(first, "found", np.mean(jump_law(before, 0.42) / before)) < MOST
