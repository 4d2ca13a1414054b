"""Sobol indices of Ishigami's function, whose indices are known, and the command."""

import json

import numpy as np
import pytest
import xarray as xr
from scipy.stats import qmc

from mdr_dask.campaign import loads
from mdr_dask.cli import main
from mdr_dask.errors import FitError
from mdr_dask.fits.sensitivity import sobol_indices

INPUTS = ("x1", "x2", "x3")
FIRST, TOTAL = np.array([0.3139, 0.4424, 0.0]), np.array([0.5576, 0.4424, 0.2437])


def ishigami(x):
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def exchanged(points):
    """Return the cases of Saltelli's design: a, b, a with the first input of b, and so on."""
    a, b = np.hsplit(points, 2)
    cases = []
    for one, other in zip(a, b, strict=True):
        cases += [one, other, *([*one[:k], other[k], *one[k + 1 :]] for k in range(a.shape[1]))]
    return np.array(cases)


def study(number, seed, failed=0.0, realisations=1, noise=0.0):
    random = np.random.default_rng(seed)
    x = (2 * exchanged(qmc.Sobol(6, seed=random).random(number)) - 1) * np.pi
    y = ishigami(x)[:, None] + noise * random.standard_normal((len(x), realisations))
    y[random.random(len(x)) < failed] = np.nan
    coords = {name: ("case", column) for name, column in zip(INPUTS, x.T, strict=True)}
    return xr.Dataset({"y": (("case", "realisation"), y)}, coords=coords)


def held(found, kind, truth):
    return (found[f"{kind}_low"].values <= truth) & (truth <= found[f"{kind}_high"].values)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "failed", "realisations", "noise"),
    [
        (256, 0.0, 1, 0.0),
        (256, 0.05, 1, 0.0),
        (128, 0.0, 4, 3.0),
    ],
)
def test_intervals_hold_the_truth(number, failed, realisations, noise):
    found = [sobol_indices(study(number, seed, failed, realisations, noise), "y") for seed in range(12)]
    # with a probability of 1/90, fewer than 31 of 36 intervals of 95 % contain the truth
    assert np.sum([held(one, "first", FIRST) for one in found]) >= 31
    assert np.sum([held(one, "total", TOTAL) for one in found]) >= 31


def test_scatter_of_realisations_does_not_count():
    # if the noise counted, its mean over four realisations would make every index 14 % smaller
    means = np.mean([sobol_indices(study(256, s, 0.0, 4, 3.0), "y").first for s in range(30)], axis=0)
    assert means == pytest.approx(FIRST, abs=0.035)


def test_a_failed_realisation_does_not_remove_its_case():
    data = study(64, 1, realisations=3, noise=0.1)
    data["y"][::4, 1] = np.nan
    assert sobol_indices(data, "y").attrs["left_out"] == 0


def test_too_few_points_are_reported_with_the_number_needed():
    found = sobol_indices(study(32, 0), "y")
    widest = max(float((found[f"{kind}_high"] - found[f"{kind}_low"]).max()) / 2 for kind in ("first", "total"))
    assert widest > 0.1
    assert found.attrs["advice"].startswith("not enough points")
    assert "enough points: every" in sobol_indices(study(2048, 0), "y").attrs["advice"]


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda d: d.isel(case=slice(10)), "at least three base points"),
        (lambda d: d.assign(y=0 * d.y), "the same in every case"),
        (lambda d: d.rename(case="x"), "got a grid"),
        (lambda d: d.isel(case=slice(1, None)), "got another sampling"),
        (lambda d: d.assign(y=d.y.expand_dims(time=3)), "got values along the dimension time"),
        (lambda d: d.assign_coords(x1=("case", np.full(d.sizes["case"], "a"))), "expected numbers for the input x1"),
    ],
)
def test_bad_studies_are_refused_with_the_reason(change, what):
    with pytest.raises(FitError, match=what):
        sobol_indices(change(study(64, 0)), "y")


def test_the_design_grows_and_exchanges_one_input(toy):
    text = "name: a\nmodel: toy\nparameters:\n  slope: {linear: [-1, 1]}\n  position: {geometric: [1 mm, 1 m]}\n"
    few, many = (
        {axis.path: axis.values for axis in loads(f"{text}sampling: {{saltelli: {n}}}\n", "a.yaml", ".").series[0].axes}
        for n in (3, 8)
    )
    assert all(many[path][:12] == values for path, values in few.items())
    slope, position = (np.reshape(many[path], (8, 4)) for path in ("slope", "position"))
    np.testing.assert_array_equal(slope[:, 2:], slope[:, [1, 0]])
    np.testing.assert_array_equal(position[:, 2:], position[:, [0, 1]])


def test_the_command_prints_rows_draws_and_refuses(toy, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    ranges = "parameters:\n  slope: {linear: [1, 2]}\n  position: {linear: [1, 3]}\n"
    (tmp_path / "a.yaml").write_text(
        f"name: a\nmodel: toy\nrealisations: 3\noutputs: [height, trace]\nsampling: {{saltelli: 64}}\n{ranges}"
    )
    assert main(["run", "a.yaml", "--quiet"]) == 0
    capsys.readouterr()
    assert main(["sensitivity", "results/a.zarr", "height", "--json", "-o", "s.png"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["parameter"] for row in rows] == ["slope", "position"]
    assert set(rows[0]) == {"parameter", *(f"{k}{e}" for k in ("first", "total") for e in ("", "_low", "_high"))}
    # y = s x on s in 1..2, x in 1..3: variances (E x)^2 var s, (E s)^2 var x and var s var x
    shares = np.array([4 / 12, 2.25 * 4 / 12, 1 / 36 * 4 / 4])
    first, total = shares[:2] / shares.sum(), (shares[:2] + shares[2]) / shares.sum()
    for row, one, whole in zip(rows, first, total, strict=True):
        assert row["first_low"] <= one <= row["first_high"]
        assert row["total_low"] <= whole <= row["total_high"]
    assert (tmp_path / "s.png").stat().st_size > 5000
    printed = {}
    for form in ([], ["--csv"]):
        assert main(["sensitivity", "results/a.zarr", "height", *form]) == 0
        printed[bool(form)] = capsys.readouterr().out
    low, high = (f"{rows[0][f'first_{end}']:.4g}" for end in ("low", "high"))
    assert f" ({low}, {high}) " in printed[False]  # the table shows the interval in brackets
    assert "first_low" in printed[True].splitlines()[0]  # the CSV has two columns
    assert main(["sensitivity", "results/a.zarr", "heigth"]) == 2
    assert "did you mean 'height'" in capsys.readouterr().err
    assert main(["sensitivity", "results/a.zarr", "trace"]) == 2
    assert "dimension" in capsys.readouterr().err


def test_an_output_without_realisations_counts_as_one_realisation():
    data = study(128, 3)
    found, single = sobol_indices(data, "y"), sobol_indices(data.isel(realisation=0), "y")
    for name in found:
        np.testing.assert_array_equal(found[name], single[name])
