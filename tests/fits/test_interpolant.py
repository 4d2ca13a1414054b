"""Laws as tables: the stated errors of linear interpolation, and studies from which no law can be made."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mdr_dask.cli import main
from mdr_dask.errors import FitError
from mdr_dask.fits.interpolant import law
from mdr_dask.models.base import Status

FORCE, VELOCITY = np.geomspace(1e-3, 1e2, 20), np.geomspace(1e-4, 1e2, 36)
SHAPES = {
    "friction": (lambda f, v: v / (v + f**0.6 + f / 4), FORCE, VELOCITY),
    "few values": (lambda f, v: v / (v + f**0.6 + f / 4), FORCE[::4], VELOCITY[::5]),
    "maximum": (lambda f, v: v / (1 + v**2 / f), np.geomspace(0.1, 10, 7), np.geomspace(1e-3, 1e3, 25)),
    "kink": (np.maximum, np.linspace(1, 3, 9), np.linspace(0.5, 4, 12)),
    "changing sign": (lambda f, v: np.sin(v) + 0 * f, np.linspace(0, 1, 4), np.linspace(0, 10, 25)),
    "power": (lambda f, v: f**0.3 * v**-1.2, np.geomspace(0.01, 1, 5), np.geomspace(1, 100, 8)),
}


def study(shape, realisations=1, noise=0.0, seed=0):
    function, force, velocity = SHAPES[shape]
    mean = function(force[:, None], velocity)
    random = np.random.default_rng(seed)
    values = mean[..., None] * (1 + noise * random.standard_normal((*mean.shape, realisations)))
    coords = {"force": ("force", force, {"units": "N"}), "velocity": ("velocity", velocity, {"units": "m/s"})}
    return xr.Dataset({"mu": (("force", "velocity", "realisation"), values, {"units": "1"})}, coords=coords)


def inside(shape, number=1000):
    random = np.random.default_rng(7)
    axes = SHAPES[shape][1:]
    drawn = [random.uniform(size=number) for _ in axes]
    return [
        np.exp(np.log(a[0]) + u * np.log(a[-1] / a[0])) if a[0] > 0 and a[-1] > 20 * a[0] else a[0] + u * np.ptp(a)
        for a, u in zip(axes, drawn, strict=True)
    ]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("realisations", "noise"), [(1, 0.0), (20, 0.05)])
def test_random_points_lie_within_the_stated_error(shape, realisations, noise):
    table = law(study(shape, realisations, noise), "mu")
    force, velocity = inside(shape)
    found = table.interp(force=("point", force), velocity=("point", velocity))
    error = np.abs(found.mu - SHAPES[shape][0](force, velocity))
    assert np.mean(error <= found.mu_error + 1e-12) >= 0.95
    # and the error is small enough to be useful
    assert float(found.mu_error.median()) < max(0.12 * float(np.abs(found.mu).median()), 3 * noise)


def test_the_study_itself_is_in_the_table():
    data = study("friction")
    table = law(data, "mu")
    at = table.sel(force=data.force, velocity=data.velocity)
    np.testing.assert_allclose(at.mu, data.mu[..., 0], rtol=1e-12)
    assert table.attrs["Conventions"].startswith("CF")
    assert table.mu.attrs["ancillary_variables"] == "mu_error"


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda d: d.isel(force=0, velocity=0), "at least 4 numbers"),
        (
            lambda d: d.isel(force=slice(3)),
            "force: expected at least 4 values, got 3; keep one by --select force=VALUE",
        ),
        (lambda d: d.stack(case=["force", "velocity"]), "sampled study"),
        (lambda d: d.where(d.velocity < 10), "cases have no value"),
    ],
)
def test_bad_studies_are_refused_with_the_reason(change, what):
    with pytest.raises(FitError, match=what):
        law(change(study("friction")), "mu")


def test_the_command(toy, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("a.yaml").write_text(
        "name: a\nmodel: toy\nrealisations: 3\nparameters:\n  slope: {linear: [1, 2, 5]}\n"
        "  position: {geometric: [1 mm, 1 m, 7]}\n"
    )
    assert main(["run", "a.yaml", "--quiet"]) == 0
    assert main(["law", "results/a.zarr", "height", "-o", "height.nc"]) == 0
    printed = capsys.readouterr().out
    assert "position: 1 mm to 1 m" in printed
    with xr.open_dataset("height.nc") as opened:
        found = opened.interp(slope=1.25, position=0.1).load()
    mean = xr.open_zarr("results/a.zarr").height.mean("realisation")
    computed = mean.sel(slope=1.25).sel(position=0.1, method="nearest")
    assert float(found.height) == pytest.approx(float(computed), rel=1e-6)
    assert found.height_error > 0
    assert main(["law", "results/a.zarr", "height", "-o", "height.csv"]) == 2


@pytest.mark.parametrize("shape", ["changing sign", "friction"])  # interpolated on a linear and on a logarithmic scale
def test_cases_that_adaptive_axes_left_out_have_the_error_of_interpolation(shape):
    data = study(shape)
    data["status"] = ("force", "velocity", "realisation"), np.full(data.mu.shape, Status.DONE)
    left_out = np.zeros(data.mu.shape, dtype=bool)
    left_out[1, 3::4] = True
    data = data.assign(mu=data.mu.where(~left_out), status=data.status.where(~left_out, Status.NOT_NEEDED))
    table = law(data, "mu")
    rows = table.sel(force=data.force[1], velocity=data.velocity[left_out[1, :, 0]])
    error = np.abs(rows.mu - study(shape).mu[1, left_out[1, :, 0], 0].to_numpy())
    assert np.all(error <= rows.mu_error)
    assert np.all(rows.mu_error < np.maximum(50 * error, 0.1))
