"""Columns in other units: values with their zero, errors without it, and nothing else."""

import numpy as np
import pytest
import xarray as xr

from mdr_dask.aggregation import aggregate
from mdr_dask.campaign.written import written_units
from mdr_dask.errors import DataError
from mdr_dask.questions import progress
from mdr_dask.questions.units import in_units, parse_units


@pytest.fixture
def means():
    dims = ("velocity", "realisation")
    data = {
        name: (dims, np.array([[300.0, 310.0], [280.0, 300.0]]), {"units": unit})
        for name, unit in {"heat": "K", "heat_before": "K", "length": "m"}.items()
    }
    velocity = {"velocity": ("velocity", [1.0, 2.0], {"units": "m/s"})}
    return aggregate(xr.Dataset(data, velocity), ["mean", "standard_error", "interval", "count"])


def test_statistics_go_with_their_output_and_differences_have_no_zero(means):
    converted = in_units(means, parse_units(["heat=degC,velocity=km/h", "length=mm"]))
    np.testing.assert_allclose(converted.velocity, [3.6, 7.2])
    np.testing.assert_allclose(converted.heat_mean, means.heat_mean - 273.15)
    np.testing.assert_allclose(converted.heat_interval, means.heat_interval - 273.15)
    np.testing.assert_allclose(converted.length_standard_error, 1e3 * means.length_standard_error)
    np.testing.assert_array_equal(converted.heat_standard_error, means.heat_standard_error)
    assert converted.heat_standard_error.attrs["units"] == converted.heat_mean.attrs["units"] == "degC"
    for untouched in ("heat_count", "heat_before_mean"):
        np.testing.assert_array_equal(converted[untouched], means[untouched])


REFUSED = [
    ("velocity", "expected NAME=UNIT,NAME=UNIT, got 'velocity'"),
    ("velocity=N", "velocity: expected a velocity (such as '1 mm/s'), got 'N'"),
    ("velocity=kmh", "velocity: unknown unit 'kmh'"),
    ("het=K", "expected the name of a column, got 'het' with unit 'K' (did you mean 'heat'?)"),
]


@pytest.mark.parametrize(("text", "told"), REFUSED)
def test_what_cannot_be_converted_is_one_sentence(means, text, told):
    with pytest.raises(DataError) as refused:
        in_units(means, parse_units([text]))
    assert str(refused.value).startswith(told)


@pytest.mark.parametrize("text", ["-1", "text", "[1, 2]", "", "parameters: 3", "parameters: {length: 1 mm}\nseries: 4"])
def test_a_damaged_campaign_has_few_units_or_none(text):
    """A store may hold anything: its numbers are shown all the same."""
    assert written_units(text) == ({"length": "mm"} if "mm" in text else {})


def test_messages_have_the_units_of_the_campaign(tmp_path):
    campaign = "model: m\nparameters:\n  speed: [1 rpm, 2 rpm]\n  heat: 300 K\n  oil: 5 mm\n"
    coords = {"speed": ("speed", [1.0, 2.0], {"units": "rad/s"}), "oil": ((), 5e-3, {"units": "m"})}
    study = xr.Dataset(coords=coords, attrs={"campaign": campaign})
    text = "expected a temperature of 313.15 to 373.15 K, got 253.15 K at 10.471976 rad/s, film 2e-06 m, area 1 m^2"
    message = {"series": "", "status": "failed", "case": {"speed": 1.0}, "message": text}
    (group,) = progress.grouped([message], {"": study})
    assert group.reason == (
        "expected a temperature of 40 to 100 degC, got -20 degC at 100 rpm, film 0.002 mm, area 1 m^2"
    )
