"""What the figure of a calibration shades."""

import numpy as np
import pytest
import xarray as xr

from mdr_dask.plots.calibration import between
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
