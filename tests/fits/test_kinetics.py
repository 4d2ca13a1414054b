import numpy as np
import pytest
import xarray as xr

from mdr_dask.errors import FitError
from mdr_dask.fits import available
from mdr_dask.fits.jumps import jump_law

FIT = available("velocity_jump")
TIMES = np.geomspace(1e-4, 20, 60)
SLOPE = 0.07
POINTS, LENGTH, TAU = 5000, 0.01, 1e-3


def store(
    speeds: np.ndarray, hurst: float, power: float, realisations: int = 12, noise: float = 0.02, shape: float = 1.0
) -> xr.Dataset:
    """Return a store that relaxes as exp(-(b t')^shape), with b = (v_1 tau q_max)^power and d_mu_0 by eq. 4.11."""
    rng = np.random.default_rng(1)
    x = speeds * TAU * np.pi * POINTS / LENGTH
    before = np.minimum(0.05 * x**0.7, 1.3)[:, None] * (1 + 0.1 * rng.standard_normal((speeds.size, realisations)))
    jump = 0.2 * jump_law(before, 0.42)
    relaxing = 0.2 * jump.mean(axis=1, keepdims=True) * (1 + noise * rng.standard_normal((speeds.size, realisations)))
    after = before + jump - relaxing
    decay = np.exp(-((x[:, None] ** power * TIMES) ** shape))
    trace = after[..., None] + relaxing[..., None] * decay[:, None, :]
    cases = ("velocity", "realisation")
    coords = {"velocity": speeds, "relaxation_times": TIMES, "hurst": hurst, "points": POINTS, "length": LENGTH}
    return xr.Dataset(
        {
            "friction_coefficient_before": (cases, before * SLOPE),
            "friction_coefficient_jump": (cases, jump * SLOPE),
            "friction_coefficient_after": (cases, after * SLOPE),
            "friction_coefficient": ((*cases, "relaxation_times"), trace * SLOPE),
            "rms_slope": (cases, np.full(before.shape, SLOPE)),
        },
        coords=coords | {"relaxation_time": TAU, "velocity_change": 0.2},
    )


ABOVE = np.geomspace(1e-3, 1, 7)


def axes(data: xr.Dataset, name: str, values: list[float]) -> xr.Dataset:
    """Return copies of a store along an additional axis."""
    return xr.concat([data.assign_coords({name: value}) for value in values], name, coords="minimal", compat="override")


def test_jump_and_relaxing_part() -> None:
    data = store(ABOVE, 0.7, 0.3)
    found = FIT["kinetics"].results({"one": data})["one"]
    mean = data.mean("realisation")
    assert found["zeta"].dims == ("velocity",)
    expected = mean["friction_coefficient_jump"] / mean["friction_coefficient_before"] / 0.2
    assert np.allclose(found["zeta"], expected, rtol=1e-12)
    assert np.allclose(found["zeta"] - found["xi"], found["relaxing_over_slope"] / found["before_over_slope"] / 0.2)
    assert np.all((found["zeta_low"] < found["zeta"]) & (found["zeta"] < found["zeta_high"]))


def test_rate_of_an_exponential_is_found() -> None:
    found = FIT["relaxation"].compute({"": store(ABOVE, 0.7, 0.3)})
    assert np.allclose(found["rate"], found["passing_number"] ** 0.3, rtol=1e-3)
    assert np.all(found["rate_low"] <= found["rate"] + 1e-9)
    assert np.all(found["fitted_law_holds"].str.startswith("yes: "))
    # the error of the trapezoidal rule with 12 moments per decade is 2 %
    assert np.allclose(found["integral_rate"], found["rate"], rtol=0.02)
    assert np.allclose(found["relaxation_duration"], TAU / found["rate"])
    assert np.allclose(found["relaxation_length"], 1.2 * found["velocity"] * found["relaxation_duration"])


def test_a_stretched_decay_is_no_exponential_and_its_rate_has_a_wide_interval() -> None:
    found = FIT["relaxation"].compute({"": store(ABOVE[3:4], 0.7, 0.3, shape=0.5)}).squeeze()
    assert not found["fitted_law_holds"].item().startswith("yes")
    assert found["rate_low"] <= found["integral_rate"] <= found["rate_high"]


def test_the_closed_law_is_tested_with_its_own_jump_and_rate() -> None:
    """The planted jump has the constant 0.42 instead of 0.4, and a fifth of it relaxes."""
    found = FIT["relaxation"].compute({"": store(ABOVE, 0.7, 0.3)})
    assert np.all(found["law_holds"].str.startswith("yes"))
    assert np.all(found["rms_error"] < 0.05)
    other = FIT["relaxation"].compute({"": store(ABOVE, 0.2, 0.3)})  # the planted power is 0.3, that of the law is 0.8
    assert np.all(other["rms_error"][2:] > found["rms_error"][2:])


def test_a_measured_surface_has_a_rate_but_above_one_no_law() -> None:
    data = store(np.array([1e-5, 1e-2]), 0.7, 0.3).drop_vars("hurst")
    found = FIT["relaxation"].compute({"": data})
    assert found["passing_number"].values.tolist() == pytest.approx([0.0157, 15.7], rel=1e-2)
    assert found["rate"].notnull().all()
    assert found["law_rate"].isnull().values.tolist() == [False, True]
    assert found["law_holds"].values[1].startswith("not tested: eq. 4.12 needs the Hurst exponent")


def test_nothing_relaxes_in_full_contact() -> None:
    data = store(ABOVE[:1], 0.7, 0.3)
    still = data["friction_coefficient_before"] + data["friction_coefficient_jump"]
    flat = still.expand_dims(relaxation_times=TIMES, axis=-1)
    found = FIT["relaxation"].compute({"": data.assign(friction_coefficient_after=still, friction_coefficient=flat)})
    assert found["fitted_law_holds"].values.tolist() == ["not tested: too few realisations, or nothing relaxes"]
    assert np.all(np.isnan(found["rate"]))


def test_constant_of_the_jump_law_is_found() -> None:
    found = FIT["jump_law"].compute({"": store(ABOVE, 0.7, 0.3)}).squeeze()
    # the law is curved, so that its mean over realisations differs from the law of the mean values
    assert found["constant"].item() == pytest.approx(0.42, rel=0.02)
    assert found["constant_low"].item() < found["constant"].item() < found["constant_high"].item()
    both = FIT["jump_law"].compute({"": axes(store(ABOVE, 0.7, 0.3), "hurst", [0.7, 0.8])})
    assert both["constant"].item() == pytest.approx(found["constant"].item(), rel=1e-12)


def test_two_cases_are_enough_for_the_jump_law_and_one_is_not() -> None:
    data = store(ABOVE, 0.7, 0.3)
    found = FIT["jump_law"].compute({"": data.isel(velocity=slice(-4, -2))}).squeeze()
    assert found["constant"].item() == pytest.approx(0.42, rel=0.1)
    with pytest.raises(FitError, match="two or more cases"):
        FIT["jump_law"].compute({"": data.isel(velocity=slice(-4, -3))})


def test_limits_of_the_jump() -> None:
    data = store(np.geomspace(1e-6, 1e3, 10), 0.7, 0.3, noise=0.0)
    found = FIT["jump_law"].compute({"": data}).squeeze()
    before = data["friction_coefficient_before"].mean("realisation").values / SLOPE
    low = before[before < 0.1]  # the store follows eq. 4.11 with the constant 0.42
    assert found["zeta"].item() == pytest.approx(np.mean(jump_law(low, 0.42) / low), rel=0.01)
    assert found["plateau_jump"].item() == pytest.approx(np.mean(jump_law(before[before > 1.1], 0.42)), rel=0.01)
    assert found["zeta_holds"].item().startswith("yes")
    assert found["plateau_holds"].item().startswith("yes")
    only = FIT["jump_law"].compute({"": store(np.array([2e-3, 3e-3]), 0.7, 0.3)}).squeeze()
    assert only["plateau_holds"].item() == "not tested: no case in this region"


def test_power_of_the_rate_in_both_regimes() -> None:
    below = np.geomspace(1e-5, 5e-4, 5)
    powers = FIT["rate_power"].results(
        {"slow": store(below, 0.3, 1.0), "fast": store(ABOVE, 0.3, 0.7), "one": store(ABOVE[:1], 0.3, 0.7)}
    )
    assert set(powers) == {"slow", "fast"}
    # the slow traces end before friction has relaxed
    assert powers["slow"]["power"].sel(regime="below").item() == pytest.approx(1.0, abs=0.05)
    assert np.isnan(powers["slow"]["power"].sel(regime="above").item())
    assert powers["fast"]["power"].sel(regime="above").item() == pytest.approx(0.7, abs=1e-3)
    assert powers["fast"]["power_stated"].sel(regime="above").item() == pytest.approx(0.7)
    rows = FIT["rate_power"].compute({"": axes(store(ABOVE, 0.8, 0.2), "normal_force", [1.0, 2.0])})
    assert rows["power"].dims == ("normal_force", "regime")
    assert np.allclose(rows["power"].sel(regime="above"), 0.2, atol=1e-3)
    with pytest.raises(FitError, match="three or more rates"):
        FIT["rate_power"].compute({"": store(ABOVE[:1], 0.3, 0.7)})


def test_rate_and_state_terms_give_the_trace_back() -> None:
    data = store(ABOVE, 0.0, 1.0)
    found = FIT["kinetics"].compute({"": data})
    length = FIT["relaxation"].compute({"": data})["relaxation_length"].values[:, None]
    step, mean = np.log(1.2), data.mean("realisation")
    slip = 1.2 * ABOVE[:, None] * TAU * TIMES
    a, b = (found[f"{which}_effect"].values[:, None] for which in ("direct", "evolution"))
    trace = mean["friction_coefficient_before"].values[:, None] + step * (a - b * (1 - np.exp(-slip / length)))
    np.testing.assert_allclose(trace, mean["friction_coefficient"], rtol=1e-4)
    np.testing.assert_allclose(a - b, found["velocity_dependence"].values[:, None])


def test_failed_realisations_are_left_out() -> None:
    data = store(ABOVE, 0.7, 0.3)
    whole = FIT["relaxation"].compute({"": data.isel(realisation=slice(1, None))})
    first = data["realisation"] if "realisation" in data.coords else xr.DataArray(np.arange(12), dims="realisation")
    found = FIT["relaxation"].compute({"": data.where(first > 0)})
    assert np.allclose(found["rate"], whole["rate"])


def test_a_limit_is_not_tested_with_one_realisation() -> None:
    data = store(np.array([1e-6, 2e-6]), 0.7, 0.3, realisations=5)
    levels = [name for name in data.data_vars if name.startswith("friction_coefficient")]
    for name in levels:
        data[name][1, 1:] = np.nan
    data["friction_coefficient_jump"] = 2 * data["friction_coefficient_jump"]
    found = FIT["jump_law"].results({"one": data})["one"]
    assert found["zeta_holds"].item().startswith("not tested: too few realisations")
