"""Fit to measured probabilities: planted truths are found, intervals cover, bad tables are named."""

import hashlib
import json

import numpy as np
import pytest
import xarray as xr

from mdr_dask.errors import DataError, FitError
from mdr_dask.fits.mixed import FITS, estimate
from mdr_dask.models.base import DataFile

(FIT,) = FITS
UNKNOWN = np.geomspace(1e-9, 2e-8, 9)
STEEPNESS = np.array([0.5, 1.0, 1.5, 2.0, 2.5])


def truth(unknown, steepness):
    """Probabilities that rise with the unknown, other cases otherwise."""
    return 1 / (1 + np.exp(-(np.log(unknown / 5e-9) * 0.8 + steepness - 1.5)))


def planted(value, noise, generator):
    measured = truth(value, STEEPNESS) + noise * generator.normal(size=STEEPNESS.size)
    simulated = truth(UNKNOWN[None, :], STEEPNESS[:, None])
    return UNKNOWN, simulated, np.zeros_like(simulated), measured, np.full(STEEPNESS.size, noise)


def test_exact_data_give_the_planted_value():
    """Monotone interpolation of nine values over a factor of twenty is right to half a per cent."""
    *data, _ = planted(7e-9, 0.0, np.random.default_rng(0))
    found = estimate(*data, np.full(STEEPNESS.size, 0.01))
    assert found.value == pytest.approx(7e-9, rel=5e-3)
    assert found.low < 7e-9 < found.high
    assert found.rms_residual < 1e-3


def test_intervals_cover_the_truth_at_their_level():
    """200 noisy tables: 95 % of the intervals hold the truth; a binomial of 200 scatters by 1.5 points."""
    generator = np.random.default_rng(1)
    found = [estimate(*planted(7e-9, 0.02, generator)) for _ in range(200)]
    covered = np.mean([each.low <= 7e-9 <= each.high for each in found])
    # chi squared above its expectation widens some intervals, so only too few would be wrong
    assert covered > 0.95 - 4 * 0.0154


def test_errors_of_the_simulation_count_as_much_as_those_of_the_measurement():
    """200 tables of exact measurements against scattered simulations: chi squared is about its degrees of freedom."""
    generator = np.random.default_rng(5)
    found = []
    for _ in range(200):
        unknown, simulated, error, measured, noise = planted(7e-9, 0.002, generator)
        scattered = simulated + 0.02 * generator.normal(size=simulated.shape)
        found.append(estimate(unknown, scattered, error + 0.02, measured, noise))
    covered = np.mean([not (each.low > 7e-9 or each.high < 7e-9) for each in found])
    assert covered > 0.95 - 4 * 0.0154
    assert 2.0 < np.mean([each.chi_squared for each in found]) < 5.0  # of 4 degrees, less by the interpolation


@pytest.mark.parametrize("cases", [5, 20])
def test_intervals_without_errors_cover_the_truth_at_their_level(cases):
    """300 tables without standard errors, of few cases and of many."""
    generator = np.random.default_rng(6)
    steepness = np.linspace(0.5, 2.5, cases)
    simulated = truth(UNKNOWN[None, :], steepness[:, None])
    held = 0
    for _ in range(300):
        measured = truth(7e-9, steepness) + 0.02 * generator.normal(size=cases)
        found = estimate(UNKNOWN, simulated, np.zeros_like(simulated), measured, np.full(cases, np.nan))
        assert found.law_holds.startswith("not tested")
        held += found.low <= 7e-9 <= found.high
    assert held / 300 > 0.95 - 4 * 0.0126


def test_a_law_that_does_not_hold_is_named_and_its_interval_is_wide():
    *data, errors = planted(7e-9, 0.01, np.random.default_rng(7))
    holds = estimate(*data, errors)
    assert holds.law_holds.startswith("yes: the errors explain residuals of")
    data[3] = data[3] + 0.15 * np.array([1, -1, 1, -1, 1])
    broken = estimate(*data, errors)
    assert broken.law_holds.startswith("no: the errors do not explain residuals of")
    assert np.nan_to_num(broken.high, nan=1.0) - np.nan_to_num(broken.low) > 5 * (holds.high - holds.low)


def test_unknown_errors_are_taken_from_the_scatter():
    generator = np.random.default_rng(2)
    *data, _ = planted(7e-9, 0.02, generator)
    found = estimate(*data, np.full(STEEPNESS.size, np.nan))
    assert found.low < found.value < found.high
    assert np.isnan(found.chi_squared)


def test_an_open_interval_has_no_end():
    *data, _ = planted(7e-9, 0.0, np.random.default_rng(0))
    found = estimate(*data, np.full(STEEPNESS.size, 0.8))
    assert np.isnan(found.low)
    assert np.isnan(found.high)


def test_a_best_value_at_the_end_is_refused():
    with pytest.raises(FitError, match="at the end of the range simulated, 2e-08; widen the range"):
        estimate(*planted(2e-7, 0.01, np.random.default_rng(3)))


def test_too_few_values_are_refused():
    with pytest.raises(FitError, match="at least four values of the unknown and two measured cases, got 3 and 5"):
        estimate(UNKNOWN[:3], np.zeros((5, 3)), np.zeros((5, 3)), np.zeros(5), np.ones(5))


TEMPERATURES = np.array([313.15, 323.15, 333.15, 343.15, 353.15])


def store(tmp_path, text, varied="layer_thickness"):
    path = tmp_path / "measured.csv"
    path.write_text(text)
    file = DataFile(name="measured.csv", path=str(path), sha256=hashlib.sha256(path.read_bytes()).hexdigest())
    noise = 0.005 * np.random.default_rng(4).normal(size=(5, 9, 6))
    values = truth(UNKNOWN[None, :, None], STEEPNESS[:, None, None]) + noise
    return {
        "fit": xr.Dataset(
            {"breakthrough_probability": (("temperature", varied, "realisation"), values)},
            {
                "temperature": ("temperature", TEMPERATURES, {"units": "K"}),
                varied: (varied, UNKNOWN, {"units": "m", "long_name": "thickness"}),
                "realisation": np.arange(6),
            },
            {"parameters": json.dumps({"measured": json.loads(file.model_dump_json())})},
        )
    }


def table(unit="degC", offset=273.15):
    rows = zip(TEMPERATURES - offset, truth(7e-9, STEEPNESS) * 100, strict=True)
    lines = [f"{t:.2f}, {p:.4f}, 1" for t, p in rows]
    return "\n".join([f"temperature [{unit}], breakthrough_probability [%], standard_error [%]", "# a remark", *lines])


def test_a_store_and_a_table_give_the_planted_value(tmp_path):
    found = FIT.compute(store(tmp_path, table()))
    # five cases with errors of one point, of about 20 points a factor e: half a per cent each
    assert float(found["layer_thickness_low"]) < 7e-9 < float(found["layer_thickness_high"])
    assert float(found["layer_thickness"]) == pytest.approx(7e-9, rel=0.05)
    assert found["layer_thickness"].attrs["units"] == "m"
    assert int(found["layer_thickness_degrees_of_freedom"]) == 4
    assert str(found["law_holds"].item()).startswith("yes")
    again = FIT.compute(store(tmp_path, table("K", 0.0)))
    assert float(again["layer_thickness"]) == float(found["layer_thickness"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("speed, breakthrough_probability\n1, 0.5", r"measured.csv:1:1: unknown column 'speed' \(known: temperature"),
        ("temperature [degC]\n40\n", "breakthrough_probability"),
        ("temperature, breakthrough_probability\n40, 0.5", r"measured\.csv:1:1: .*temperature"),
        ("temperature [degC], breakthrough_probability\n40, -0.5", r"measured\.csv:2:5: "),
        (
            "temperature [degC], breakthrough_probability\n40, much",
            r"measured\.csv:2:5: ",
        ),
        ("temperature [degC], breakthrough_probability\n41, 0.5\n50, 0.6", "the store has no temperature of 314.15"),
        ("breakthrough_probability\n0.5\n0.6", "expected a column temperature in the measured table"),
        ("", r"measured\.csv:1:1: "),
    ],
)
def test_bad_tables_are_named(tmp_path, text, message):
    with pytest.raises(DataError, match=message):
        FIT.compute(store(tmp_path, text))


def test_a_changed_table_is_refused(tmp_path):
    groups = store(tmp_path, table())
    (tmp_path / "measured.csv").write_text(table() + "\n")
    with pytest.raises(DataError, match="changed since the campaign was read"):
        FIT.compute(groups)


def test_a_store_without_table_or_unknown_says_so(tmp_path):
    groups = store(tmp_path, table())
    groups["fit"].attrs["parameters"] = "{}"
    with pytest.raises(DataError, match="names no table of measured probabilities"):
        FIT.compute(groups)
    with pytest.raises(FitError, match="varies exactly one of layer_shear_strength"):
        FIT.compute(store(tmp_path, table(), varied="hurst"))
