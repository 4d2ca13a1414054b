"""Reductions over realisations compared with numpy; they stay lazy."""

import numpy as np
import pytest
import xarray as xr

from mdr_dask.aggregation import QUANTILES, aggregate


@pytest.fixture
def dataset():
    values = np.random.default_rng(3).normal(5.0, 1.0, (3, 40))
    values[0, :4] = np.nan
    values[1] = np.nan
    array = xr.DataArray(values, dims=("load", "realisation"), coords={"load": [1.0, 2.0, 3.0]}, attrs={"units": "N"})
    return xr.Dataset({"force": array, "status": (("load", "realisation"), np.ones((3, 40), dtype=np.int8))})


def test_statistics_are_those_of_numpy_and_empty_cases_are_nan(dataset):
    reduced = aggregate(dataset)
    valid = dataset.force.to_numpy()[0, 4:]
    first = reduced.isel(load=0)
    assert first.force_mean == pytest.approx(valid.mean())
    assert first.force_standard_deviation == pytest.approx(valid.std(ddof=1))
    assert first.force_standard_error == pytest.approx(valid.std(ddof=1) / 6)
    np.testing.assert_allclose(first.force_quantile, np.quantile(valid, QUANTILES), rtol=1e-14)
    assert first.force_count == 36
    assert reduced.force_mean.attrs["units"] == "N"
    assert "status_mean" not in reduced
    empty = reduced.isel(load=1)
    assert empty.force_count == 0
    assert all(np.isnan(empty[name]).all() for name in empty.data_vars if name != "force_count")


def test_aggregates_of_a_chunked_dataset_are_lazy_and_the_same(dataset):
    lazy = aggregate(dataset.chunk(load=1, realisation=10))
    assert all(array.chunks for array in lazy.data_vars.values())
    xr.testing.assert_allclose(lazy.compute(), aggregate(dataset))


def test_one_realisation_has_a_mean_and_no_scatter(dataset):
    reduced = aggregate(dataset.isel(realisation=[20], load=[0]))
    assert np.isfinite(reduced.force_mean).all()
    assert np.isnan(reduced.force_standard_error).all()
    assert np.isnan(reduced.force_interval).all()


def test_grid_errors_stand_apart_from_scatter_and_are_joined_in_the_interval(dataset):
    plain = aggregate(dataset)
    assert "force_grid_error" not in plain
    error = xr.full_like(dataset.force, -0.5).where(dataset.force.notnull()).assign_attrs(units="N")
    known = dataset.assign(force_error=error)
    known["force"] = known.force.assign_attrs(ancillary_variables="force_error")
    reduced = aggregate(known)
    assert "force_error_mean" not in reduced
    assert reduced.force_grid_error.attrs["units"] == "N"
    first, without = reduced.isel(load=0), plain.isel(load=0)
    assert first.force_grid_error == 0.5
    assert first.force_standard_error == without.force_standard_error
    half, scatter = (abs(each.force_interval - each.force_mean) for each in (first, without))
    np.testing.assert_allclose(half, scatter + 0.5)
