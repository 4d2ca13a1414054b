import numpy as np
import pytest
import xarray as xr

from mdr_dask.errors import FitError
from mdr_dask.fit.kinetics import FITS, jump_law
from mdr_dask.fit.relaxation import exponential, widths

FIT = {fit.name: fit for fit in FITS}
TIMES = np.geomspace(1e-4, 20, 60)
SLOPE = 0.07
POINTS, LENGTH, TAU = 5000, 0.01, 1e-3


def store(
    speeds: np.ndarray, hurst: float, power: float, realisations: int = 12, noise: float = 0.02, shape: float = 1.0
) -> xr.Dataset:
    """Return a store whose relaxation is exp(-(b t')^shape) with b = x^power, x = v_1 tau q_max, d_mu_0 by 4.11."""
    rng = np.random.default_rng(1)
    x = speeds * TAU * np.pi * POINTS / LENGTH
    before = np.minimum(0.05 * x**0.7, 1.3)[:, None] * (1 + 0.1 * rng.standard_normal((speeds.size, realisations)))
    jump = 0.2 * jump_law(before, 0.42)
    relaxing = 0.01 * (1 + noise * rng.standard_normal((speeds.size, realisations)))
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


def test_rate_of_an_exponential_is_found() -> None:
    found = FIT["kinetics"].compute({"": store(ABOVE, 0.7, 0.3)})
    # the weights of the trapezoidal rule on 12 moments a decade
    assert np.allclose(found["rate"], found["passing_number"] ** 0.3, rtol=1e-6)
    assert np.all(found["rate_low"] <= found["rate"] + 1e-9)
    assert np.all(found["unexplained"] < 1e-9)
    assert np.all(np.isnan(found["stretched_rate"]))
    assert np.allclose(found["integral_rate"], found["rate"], rtol=0.02)
    assert np.allclose(found["zeta"] - found["xi"], found["relaxing_over_slope"] / found["before_over_slope"] / 0.2)
    assert found.attrs["window"].startswith("one exponential over")


def test_two_more_laws_where_one_exponential_is_not_enough() -> None:
    found = FIT["kinetics"].compute({"": store(ABOVE[3:4], 0.7, 0.3, shape=0.5)})
    assert float(found["unexplained"][0]) > 0.02
    assert found["stretched_exponent"].item() == pytest.approx(0.5, rel=1e-3)
    assert found["stretched_rate"].item() == pytest.approx(float(found["passing_number"][0]) ** 0.3, rel=1e-3)
    assert found["two_unexplained"].item() < 0.3 * found["unexplained"].item()
    assert found["fast_rate"].item() > found["slow_rate"].item()


def test_constant_of_the_jump_law_is_found() -> None:
    found = FIT["jump_law"].compute({"": store(ABOVE, 0.7, 0.3)})
    # the mean over realisations of a curved law differs from the law of the mean by the square of the scatter
    assert found["constant_of_all"].item() == pytest.approx(0.42, rel=0.02)
    assert found["constant_low"].item() <= found["constant"].item() <= found["constant_high"].item()


def test_power_of_the_rate_in_both_regimes() -> None:
    below = np.geomspace(1e-5, 5e-4, 5)
    series = {
        "slow": store(below, 0.3, 1.0),
        "fast": store(ABOVE, 0.3, 0.7),
        "other": store(ABOVE, 0.8, 0.2),
    }
    found = FIT["rate_power"].compute(series)
    powers = found["power"].sel(hurst=0.3)
    # slow traces end before they have relaxed
    assert powers.sel(regime="below").item() == pytest.approx(1.0, abs=0.05)
    assert powers.sel(regime="above").item() == pytest.approx(0.7, abs=1e-5)
    assert found["power"].sel(hurst=0.8, regime="above").item() == pytest.approx(0.2, abs=1e-5)
    assert np.isnan(found["power"].sel(hurst=0.8, regime="below").item())
    assert found["law_power"].sel(hurst=0.8, regime="above").item() == pytest.approx(0.2)


def test_rate_and_state_terms() -> None:
    data = store(ABOVE, 0.0, 1.0)
    found = FIT["rate_and_state"].compute({"": data})
    step = np.log(1.2)
    mean = data.mean("realisation")
    assert np.allclose(found["direct_effect"], mean["friction_coefficient_jump"] / step)
    change = (mean["friction_coefficient_after"] - mean["friction_coefficient_before"]).values
    assert np.allclose((found["direct_effect"] - found["evolution_effect"]) * step, change)
    # b = v_1 tau q_max: the slip length is v_2 / v_1 over q_max
    assert np.allclose(found["slip_length"], 1.2 * LENGTH / np.pi / POINTS, rtol=1e-6)


def test_failed_realisations_are_left_out() -> None:
    data = store(ABOVE, 0.7, 0.3)
    whole = FIT["kinetics"].compute({"": data.isel(realisation=slice(1, None))})
    first = data["realisation"] if "realisation" in data.coords else xr.DataArray(np.arange(12), dims="realisation")
    found = FIT["kinetics"].compute({"": data.where(first > 0)})
    assert np.allclose(found["rate"], whole["rate"])


def test_missing_outputs_are_named() -> None:
    with pytest.raises(FitError, match="rms_slope"):
        FIT["jump_law"].compute({"": store(ABOVE, 0.7, 0.3).drop_vars("rms_slope")})


def test_weights_integrate() -> None:
    assert widths(TIMES) @ TIMES == pytest.approx((TIMES[-1] ** 2 - TIMES[0] ** 2) / 2, rel=1e-12)


def test_exponential_outside_its_first_grid() -> None:
    time = np.linspace(0, 1, 200)
    rate, amplitude, left = exponential(time, 3 * np.exp(-5 * time), widths(time))
    assert (rate, amplitude) == (pytest.approx(5, rel=1e-6), pytest.approx(3, rel=1e-6))
    assert left < 1e-12
