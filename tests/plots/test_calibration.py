"""What the figure of a calibration shades."""

import numpy as np
import pytest
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


def test_shades_are_the_intervals_of_the_fit():
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


def test_what_is_not_determined_is_grey_over_its_whole_axis_and_its_product_follows():
    """Friction of a product of two unknowns, at two temperatures: each has a curve of its own."""
    velocity, height, modulus = np.geomspace(0.01, 1, 6), np.geomspace(1e-6, 1e-5, 9), np.geomspace(1e6, 1e7, 9)
    temperature = np.array([293.15, 313.15])
    friction = 0.3 * np.sqrt(height[:, None] / 1e-6 * modulus / 1e6)
    friction = friction * velocity[:, None, None] ** 0.2 * (temperature / 293.15)[:, None, None, None]
    coords = {
        "temperature": ("temperature", temperature, {"units": "K"}),
        "velocity": ("velocity", velocity, {"units": "m/s"}),
        "rms_roughness": ("rms_roughness", height, {"units": "m"}),
        "shear_modulus": ("shear_modulus", modulus, {"units": "Pa"}),
    }
    noise = np.random.default_rng(4).normal(size=(2, velocity.size))
    text = "temperature [K],velocity [m/s],mu,standard_error\n" + "\n".join(
        f"{t},{v},{0.9 * t / 293.15 * v**0.2 * (1 + 0.05 * e)},{0.03 * v**0.2}"
        for t, row in zip(temperature, noise, strict=True)
        for v, e in zip(velocity, row, strict=True)
    )
    data = xr.Dataset({"mu": (tuple(coords), friction, {"units": "1"})}, coords)
    data = data.assign_attrs(measured={"name": "rig.csv", "text": text})
    figure = calibration({"": data})
    found = fitted({"": data})
    points, _, *marginals = figure.axes
    assert points.get_legend_handles_labels()[1] == ["temperature = 20 °C", "temperature = 40 °C"]
    assert [axes.get_title() for axes in marginals] == ["not determined", "not determined", ""]
    for axes, name, factor in zip(marginals, ("rms_roughness", "shear_modulus"), (1e6, 1e-6), strict=False):
        (line,) = axes.lines
        ends = factor * coords[name][1][[0, -1]]
        np.testing.assert_allclose(np.log(line.get_xdata()[[0, -1]]), np.log(ends), atol=0.1)
        assert not axes.collections
        assert np.isnan(found[f"{name}_low"])
    product = "rms_roughness x shear_modulus"
    assert marginals[2].get_xlabel() == f"{product} [m Pa]"
    ends = sorted((each.get_paths()[0].vertices[:, 0] for each in marginals[2].collections), key=np.ptp)
    for x, level in zip(ends, ("_68", ""), strict=True):
        told = [float(found[f"{product}_{end}{level}"]) for end in ("low", "high")]
        np.testing.assert_allclose((x.min(), x.max()), told, rtol=1e-4)
