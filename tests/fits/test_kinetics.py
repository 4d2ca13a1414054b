import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from scipy.stats import norm, t

from mdr_dask.errors import FitError
from mdr_dask.fits import available, kinetics
from mdr_dask.fits.jumps import jump_law
from mdr_dask.fits.kinetics import relaxation_curves
from mdr_dask.fits.relaxation import exponential, widths
from mdr_dask.plots import available as drawn
from mdr_dask.plots.kinetics import over_slope, relaxing

FIT = available("velocity_jump")
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
    """Return the same store along one more axis."""
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
    assert np.allclose(found["rate"], found["passing_number"] ** 0.3, rtol=1e-6)
    assert np.allclose(found["rate_unweighted"], found["rate"], rtol=1e-6)
    assert np.all(found["rate_low"] <= found["rate"] + 1e-9)
    assert np.all(found["unexplained"] < 1e-9)
    assert np.all(found["law_holds"].str.startswith("yes: one exponential"))
    # the trapezoidal rule on 12 moments a decade
    assert np.allclose(found["integral_rate"], found["rate"], rtol=0.02)
    assert np.allclose(found["relaxation_duration"], TAU / found["rate"])
    assert np.allclose(found["relaxation_length"], 1.2 * found["velocity"] * found["relaxation_duration"])
    assert np.allclose(found["length_times_wavenumber"], 1.2 * found["passing_number"] / found["rate"])
    assert found.attrs["window"].startswith("one exponential over")
    with pytest.raises(FitError, match="one exponential is enough"):
        FIT["relaxation_shape"].compute({"": store(ABOVE, 0.7, 0.3)})


def test_two_more_laws_where_one_exponential_is_not_enough() -> None:
    series = {"": store(ABOVE[3:4], 0.7, 0.3, shape=0.5)}
    rates = FIT["relaxation"].compute(series).squeeze()
    assert rates["law_holds"].item().startswith("no: one exponential")
    assert rates["unexplained"].item() > 0.01
    assert rates["probability"].item() < 0.05
    found = FIT["relaxation_shape"].compute(series).squeeze()
    assert found.attrs["window"].startswith("one exponential over")
    assert found["stretched_exponent"].item() == pytest.approx(0.5, rel=1e-3)
    assert found["stretched_rate"].item() == pytest.approx(float(rates["passing_number"]) ** 0.3, rel=1e-3)
    assert found["two_unexplained"].item() < 0.3 * found["unexplained"].item()
    assert found["fast_rate"].item() > found["slow_rate"].item()


def test_nothing_relaxes_in_full_contact() -> None:
    data = store(ABOVE[:1], 0.7, 0.3)
    still = data["friction_coefficient_before"] + data["friction_coefficient_jump"]
    flat = still.expand_dims(relaxation_times=TIMES, axis=-1)
    found = FIT["relaxation"].compute({"": data.assign(friction_coefficient_after=still, friction_coefficient=flat)})
    assert found["law_holds"].values.tolist() == ["not tested: nothing relaxes"]
    assert np.all(np.isnan(found["rate"]))


def test_constant_of_the_jump_law_is_found() -> None:
    found = FIT["jump_law"].compute({"": store(ABOVE, 0.7, 0.3)}).squeeze()
    # the mean over realisations of a curved law differs from the law of the mean by the square of the scatter
    assert found["constant"].item() == pytest.approx(0.42, rel=0.02)
    assert found["constant_low"].item() < found["constant"].item() < found["constant_high"].item()
    both = axes(store(ABOVE, 0.7, 0.3), "hurst", [0.7, 0.8])
    found = FIT["jump_law"].compute({"": both})
    assert found["hurst"].values.tolist() == ["0.7", "0.8", "all"]
    assert found["constant"].values[2] == pytest.approx(found["constant"].values[0], rel=1e-12)


def test_two_cases_are_enough_for_the_jump_law_and_one_is_not() -> None:
    data = store(ABOVE, 0.7, 0.3)
    found = FIT["jump_law"].compute({"": data.isel(velocity=slice(-4, -2))}).squeeze()
    assert found["constant"].item() == pytest.approx(0.42, rel=0.1)
    with pytest.raises(FitError, match="two or more cases"):
        FIT["jump_law"].compute({"": data.isel(velocity=slice(-4, -3))})


def test_friction_is_drawn_as_it_is_where_no_slope_is_stored() -> None:
    data = store(ABOVE, 0.7, 0.3)
    divided, label = over_slope(data.drop_vars("rms_slope"))
    assert (float(divided), label) == (1.0, r"$\mu$")
    np.testing.assert_allclose(relaxing(data.drop_vars("rms_slope")), SLOPE * relaxing(data))


def test_limits_of_the_jump() -> None:
    data = store(np.geomspace(1e-6, 1e3, 10), 0.7, 0.3, noise=0.0)
    found = FIT["jump_limits"].compute({"": data}).squeeze()
    before = data["friction_coefficient_before"].mean("realisation").values / SLOPE
    # the store follows eq. 4.11 with 0.42
    low = before[before < 0.1]
    first = found.sel(limit="region I")
    assert first["found"].item() == pytest.approx(np.mean(jump_law(low, 0.42) / low), rel=0.01)
    assert first["interpolated"].item() == pytest.approx(np.mean(jump_law(low, 0.4) / low), rel=1e-12)
    assert first["cases"].item() == low.size
    plateau = found.sel(limit="plateau")
    assert plateau["found"].item() == pytest.approx(np.mean(jump_law(before[before > 1.1], 0.42)), rel=0.01)
    assert plateau["limit_of_law"].item() == 0.4
    with pytest.raises(FitError, match="rms_slope below"):
        FIT["jump_limits"].compute({"": store(np.array([3e-3]), 0.7, 0.3)})


def test_power_of_the_rate_in_both_regimes() -> None:
    below = np.geomspace(1e-5, 5e-4, 5)
    powers = FIT["rate_power"].results(
        {"slow": store(below, 0.3, 1.0), "fast": store(ABOVE, 0.3, 0.7), "one": store(ABOVE[:1], 0.3, 0.7)}
    )
    assert set(powers) == {"slow", "fast"}
    # slow traces end before they have relaxed
    assert powers["slow"]["power"].sel(regime="below").item() == pytest.approx(1.0, abs=0.05)
    assert np.isnan(powers["slow"]["power"].sel(regime="above").item())
    assert powers["fast"]["power"].sel(regime="above").item() == pytest.approx(0.7, abs=1e-5)
    assert powers["fast"]["law_power"].sel(regime="above").item() == pytest.approx(0.7)
    rows = FIT["rate_power"].compute({"": axes(store(ABOVE, 0.8, 0.2), "normal_force", [1.0, 2.0])})
    assert rows["power"].dims == ("normal_force", "regime")
    assert np.allclose(rows["power"].sel(regime="above"), 0.2, atol=1e-5)
    with pytest.raises(FitError, match="three or more rates"):
        FIT["rate_power"].compute({"": store(ABOVE[:1], 0.3, 0.7)})


def test_rate_and_state_terms() -> None:
    data = store(ABOVE, 0.0, 1.0)
    found = FIT["rate_and_state"].compute({"": data})
    step = np.log(1.2)
    mean = data.mean("realisation")
    assert np.allclose(found["direct_effect"], mean["friction_coefficient_jump"] / step)
    change = (mean["friction_coefficient_after"] - mean["friction_coefficient_before"]).values
    assert np.allclose(found["velocity_dependence"] * step, change)
    assert np.allclose(found["direct_effect"] - found["evolution_effect"], found["velocity_dependence"])
    # b = v_1 tau q_max: the slip length is v_2 / v_1 over q_max
    assert np.allclose(found["slip_length"], 1.2 * LENGTH / np.pi / POINTS, rtol=1e-6)
    assert np.allclose(found["slip_length_times_wavenumber"], 1.2, rtol=1e-6)
    # the law itself gives the trace back
    slip = 1.2 * ABOVE[:, None] * TAU * TIMES
    trace = mean["friction_coefficient_before"].values[:, None] + step * (
        found["direct_effect"].values[:, None]
        - found["evolution_effect"].values[:, None] * (1 - np.exp(-slip / found["slip_length"].values[:, None]))
    )
    assert np.allclose(trace, mean["friction_coefficient"], rtol=1e-6)


def test_failed_realisations_are_left_out() -> None:
    data = store(ABOVE, 0.7, 0.3)
    whole = FIT["relaxation"].compute({"": data.isel(realisation=slice(1, None))})
    first = data["realisation"] if "realisation" in data.coords else xr.DataArray(np.arange(12), dims="realisation")
    found = FIT["relaxation"].compute({"": data.where(first > 0)})
    assert np.allclose(found["rate"], whole["rate"])


def test_missing_outputs_are_named() -> None:
    with pytest.raises(FitError, match="rms_slope"):
        FIT["jump_law"].compute({"": store(ABOVE, 0.7, 0.3).drop_vars("rms_slope")})


def test_weights_integrate() -> None:
    assert widths(TIMES) @ TIMES == pytest.approx((TIMES[-1] ** 2 - TIMES[0] ** 2) / 2, rel=1e-12)


def test_exponential_outside_its_first_grid() -> None:
    time = np.linspace(0, 1, 200)
    rate, amplitude, left = exponential(time, 3 * np.exp(-5 * time)[None], widths(time))
    assert (rate[0], amplitude[0]) == (pytest.approx(5, rel=1e-6), pytest.approx(3, rel=1e-6))
    assert left[0] < 1e-12


def test_curves_of_a_relaxation_are_those_of_its_constants():
    """What a figure draws of a stretched decay: each law by its formula, and two exponentials nearer than one."""
    data = store(np.array([0.05]), 0.7, 0.3, shape=0.5)
    found = relaxation_curves(data)
    relaxing = ((data["friction_coefficient"] - data["friction_coefficient_after"]) / SLOPE).mean("realisation")[0]
    inside = (found["t"] > TIMES[0]) & (found["t"] < found["window"])
    planted = np.interp(found["t"][inside], TIMES, relaxing)
    left = {name: np.abs(found[name][inside] - planted).max() for name in ("one", "two")}
    assert left["two"] < 0.5 * left["one"]
    rate = -np.polyfit(found["t"], np.log(found["one"]), 1)[0]
    assert rate == pytest.approx(found["rate"].item())
    alike = -np.polyfit(found["t"], np.log(found["alike"]), 1)[0]
    assert alike == pytest.approx(found["rate_unweighted"].item())
    assert np.all((found["one_low"] <= found["one"]) & (found["one"] <= found["one_high"]))
    # on an axis of logarithms they begin long before the first time, and close up to nothing
    assert found["t"][0] == 0.0
    assert 0.0 < found["t"][1] < 1e-3 * found["window"]


def test_rates_count_in_a_power_as_well_as_their_logarithms_are_known():
    """Half-widths of logarithms are those of a bootstrap of eight realisations; one rate is hardly known."""
    x, scatter = np.log([2.0, 5.0, 10.0, 20.0, 50.0]), np.array([0.02, 0.05, 0.1, 0.19, 0.6])
    random = np.random.default_rng(3)
    logs = 0.4 * x + np.append([[0.0, 0.02, -0.05, 0.05, 0.0]], scatter * random.standard_normal((400, 5)), axis=0)
    power, factor, deviation, number, _ = kinetics._power(x, np.exp(logs), np.full(5, 8))
    low, high = np.quantile(logs[1:], [0.025, 0.975], axis=0)
    half = np.sqrt(8 / 7) * t.ppf(0.975, 7) / norm.ppf(0.975) * (high - low) / 2
    good = half < 0.5
    assert good.tolist() == [True] * 4 + [False]
    weights = 1 / ((half[good] / 2) ** 2 + 0.1**2)
    slope, level = np.polyfit(x[good], logs[0, good], 1, w=np.sqrt(weights))
    assert number == 4
    assert power[0] == pytest.approx(slope, rel=1e-9)
    assert factor == pytest.approx(np.exp(level), rel=1e-9)
    assert deviation == pytest.approx(np.std(logs[0, good] - slope * x[good] - level), rel=0.5)


def test_a_figure_draws_each_exponential_that_was_fitted():
    data = store(np.array([0.05]), 0.7, 0.3, shape=0.5)
    figure = drawn("velocity_jump")["jump_fit"].figure({"": data.isel(velocity=0)})
    found = relaxation_curves(data)
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    for label, name in (("two exponentials", "two"), ("all times alike", "alike"), ("weights", "one")):
        (line,) = (line for words, line in lines.items() if label in words)
        np.testing.assert_allclose(np.sort(line.get_ydata()), np.sort(found[name].values))
    plt.close(figure)


def test_a_limit_is_not_tested_where_one_line_is_left() -> None:
    data = store(np.array([1e-6, 2e-6]), 0.7, 0.3, realisations=5)
    levels = [name for name in data.data_vars if name.startswith("friction_coefficient")]
    for name in levels:
        data[name][1, 1:] = np.nan
    data["friction_coefficient_jump"] = 2 * data["friction_coefficient_jump"]
    found = FIT["jump_limits"].results({"one": data})["one"].sel(limit="region I")
    assert found["cases"].item() == 2
    assert found["law_holds"].item().startswith("not tested: too few realisations")
