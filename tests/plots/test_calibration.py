"""What the figure of a calibration shades."""

import numpy as np
import pytest
import record
import seen
import xarray as xr
from scipy.stats import norm

from mdr_dask.fits.calibration import calibration as fitted
from mdr_dask.plots.calibration import between, calibration
from mdr_dask.plots.style import broken, plain, quantity


@pytest.mark.parametrize("ends", [(0.3, 2.2), (0.3, 0.4), (1.0, 2.0)])
def test_a_shade_reaches_to_the_ends_of_its_interval(ends):
    """Not only to the nearest points of the curve."""
    x = np.arange(4.0)
    inside, height = between(x, 2 * x, *ends)
    assert (inside[0], inside[-1]) == ends
    assert np.all(np.diff(inside) > 0)
    np.testing.assert_allclose(height, 2 * inside)


def test_a_label_is_broken_where_it_is_longer_than_its_line():
    label = "friction of a rubber block on a rough track of basalt"
    lines = broken(label, 20).split("\n")
    assert " ".join(lines) == label
    assert [len(plain(line)) for line in lines] == [20, 16, 15]


def test_a_parameter_of_ones_own_has_its_words_and_its_unit():
    values = xr.DataArray(2.0, name="track_age", attrs={"units": "s"}).assign_coords(track_age=2.0)
    assert quantity("track_age", values)[:2] == ("track age", "s")


def test_shades_are_the_intervals_of_the_fit(dataframe_regression):
    """Of residuals 95 % of a normal distribution, of an unknown those of the table: light 95 %, dark 68 %."""
    velocity, height = np.geomspace(0.01, 1, 8), np.geomspace(1e-6, 1e-5, 9)
    friction = 0.3 * np.sqrt(height / 1e-6) * velocity[:, None] ** 0.2
    coords = {
        "velocity": ("velocity", velocity, {"units": "m/s"}),
        "rms_roughness": ("rms_roughness", height, {"units": "m"}),
    }
    noise = np.random.default_rng(4).normal(size=velocity.size)
    rows = [f"{v},{0.6 * v**0.2 * (1 + 0.05 * e)},{0.03 * v**0.2}" for v, e in zip(velocity, noise, strict=True)]
    text = "velocity [m/s],mu,standard_error\n" + "\n".join(rows)
    data = xr.Dataset({"mu": (("velocity", "rms_roughness"), friction, {"units": "1"})}, coords)
    data = data.assign_attrs(measured={"name": "rig.csv", "text": text})
    figure = calibration({"": data})
    _, residuals, marginal = figure.axes
    (shade,) = residuals.patches
    np.testing.assert_allclose((shade.get_y(), shade.get_y() + shade.get_height()), norm.ppf([0.025, 0.975]), rtol=1e-4)
    ends = sorted((each.get_paths()[0].vertices[:, 0] for each in marginal.collections), key=np.ptp)
    found = fitted({"": data})
    for x, level in zip(ends, ("_68", ""), strict=True):
        told = [float(found[f"rms_roughness_{end}{level}"]) for end in ("low", "high")]
        np.testing.assert_allclose((x.min(), x.max()), 1e6 * np.array(told), rtol=1e-4)
    record.check(dataframe_regression, seen.of(figure))
