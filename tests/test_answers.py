"""Rounds of realisations continue until a fitted constant is known, only in the cases that determine it."""

import dataclasses
import re

import numpy as np
import pytest
import xarray as xr
from test_execute import run

from mdr_dask import bootstrap, fits, store
from mdr_dask.campaign import Replication, Tolerance, loads
from mdr_dask.cli import main
from mdr_dask.errors import CampaignError, FitError
from mdr_dask.fits.base import Fit

TEXT = """
name: answers
model: sliding_friction
seed: 5
realisations: {{at_least: 10, at_most: 40, until: {{{until}}}}}
parameters:
  length: 20 mm
  points: 500
  hurst: 0.7
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  normal_force: [6 mN, 2 mN, 20 mN, 1 N]
  velocity: [1 nm/s, 10 nm/s, 1 m/s]
outputs: [friction_coefficient]
errors: false
"""


def study(until):
    return loads(TEXT.format(until=until), "a.yaml", ".")


def _level(series):
    """Return the mean height at the positions below 4 m: one constant for each slope."""
    data = series[""]
    near = data.height.where(data.position < 4, drop=True)
    if not near.size:
        raise FitError("expected positions below 4 m")
    values = near.transpose("realisation", "slope", "position").to_numpy()
    stack, count = bootstrap.means(values).mean(axis=-1), int(np.isfinite(values).sum(axis=0).min())
    low, high = bootstrap.interval(stack, count)
    names = {"level": stack[0], "level_low": low, "level_high": high}
    return xr.Dataset({key: ("slope", value) for key, value in names.items()}, {"slope": data.slope})


def _missed(series):
    """Return the mean height with an interval that holds half a metre which no more realisations narrow."""
    found = _level(series)
    return found.assign(level_low=found.level_low - 0.5, level_high=found.level_high + 0.5)


LEVEL = Fit("level", ("toy",), "mean height", _level, constants=("level",))
MISSED = Fit("missed", ("toy",), "mean height by a law that misses it", _missed, constants=("level",))


@pytest.fixture
def own(toy, monkeypatch):
    """Return a study of the toy model, with a fit of one's own, to a tolerance."""
    known = {"level": LEVEL, "missed": MISSED}
    monkeypatch.setattr("mdr_dask.fits.answers.available", lambda _: known)  # the first: it is loaded by now
    monkeypatch.setattr(fits, "available", lambda _: known)

    def campaign(tolerance, at_most=120, positions=(5.0, 2.0, 1.0, 3.0), answer="level.level", at_least=10):
        rounds = Replication(at_least, at_most, {}, {answer: tolerance})
        axes = toy.axis("slope", [0.0, 1.0, 9.0]), toy.axis("position", positions)
        return toy.campaign(*axes, realisations=rounds, noise=0.5)

    return campaign


def taken(url):
    return store.datasets(url)[""].height.notnull().sum("realisation").load()


def test_only_rows_and_columns_that_a_constant_follows_from_go_on(own, url):
    run(own(Tolerance(absolute=0.25, relative=0.2)), url)
    found = taken(url)
    assert (found.sel(position=5.0) == 10).all()  # the fit does not use it
    assert (found.sel(slope=9.0) == 10).all()  # a part of a large constant
    rest = found.sel(slope=[0.0, 1.0], position=[1.0, 2.0, 3.0])
    assert (rest > 10).all()
    assert (rest == rest[:, :1]).all()  # what a fit compares has the same lines
    result = _level({"": store.datasets(url)[""].load()})
    half = (result.level_high - result.level_low) / 2
    assert (half <= np.maximum(0.25, 0.2 * abs(result.level))).all()


def test_a_study_in_a_larger_store_is_judged_by_its_own_cases_and_lines(own, toy, tmp_path):
    small, large = (str(tmp_path / name) for name in ("small.zarr", "large.zarr"))
    campaign = own(Tolerance(absolute=0.3))
    run(campaign, small)
    run(dataclasses.replace(own(Tolerance(absolute=0.3), positions=(5.0, 2.0, 0.5, 1.0, 3.0))), large)
    run(campaign, large)
    np.testing.assert_array_equal(taken(small).drop_vars("position"), taken(large).sel(position=[1.0, 2.0, 3.0, 5.0]))


def test_constants_that_stay_unknown_are_reported(own, tmp_path):
    for name, campaign, expected in (
        (
            "a",
            own(Tolerance(absolute=1e-3), at_most=20),
            r"level\.level: half of the interval is .* after 20 realisations",
        ),
        ("b", own(Tolerance(absolute=1e-3), positions=(5.0, 6.0)), r"level\.level: expected positions below 4 m"),
    ):
        events = []
        run(campaign, str(tmp_path / f"{name}.zarr"), tell=events.append)
        (event,) = [event for event in events if event.name == "not answered"]
        assert re.search(expected, event.sentence)
    assert int(taken(str(tmp_path / "b.zarr")).max()) == 10


def test_rounds_end_if_more_realisations_cannot_narrow_the_interval(own, url):
    """Half of the interval is 0.5 m and what scatter adds: 0.4 m is out of reach, 0.8 m takes a few more lines."""
    events = []
    run(own(Tolerance(absolute=0.4), at_most=2000, answer="missed.level"), url, tell=events.append)
    assert int(taken(url).max()) < 500
    (event,) = [event for event in events if event.name == "not answered"]
    assert re.search(r"after \d+ realisations; 0\.5 of it comes from the law", event.sentence)
    events.clear()
    run(own(Tolerance(absolute=0.8), at_most=2000, answer="missed.level"), url + "2", tell=events.append)
    assert not [event for event in events if event.name == "not answered"]


def test_zone_one_goes_on_in_region_one_alone_and_ends_narrow_enough(url):
    run(study("zone_one.alpha: 0.06"), url)
    data = store.datasets(url)
    found = fits.available("sliding_friction")["zone_one"].results(data)[""]
    done = data[""].friction_coefficient.notnull().sum("realisation")
    assert float(found.alpha_high - found.alpha_low) / 2 <= 0.06
    assert done.max() > 10
    assert (done.sel(normal_force=1.0) == 10).all()  # beyond zone 1
    assert (done.sel(velocity=1.0) == 10).all()  # beyond region I
    assert float(found.loads) == 3


@pytest.mark.parametrize(
    ("until", "expected"),
    [
        ("zone_two.alpha: 0.01", r"a.yaml:5:51: realisations.until.zone_two.alpha: .*did you mean 'zone_one'"),
        ("zone_one.gamma: 0.01", r"an interval of the fit zone_one \(alpha, beta\), got 'gamma'"),
        ("calibration.tau: 1 %", r"of the fit calibration \(none\), got 'tau'"),
    ],
)
def test_unknown_constants_are_refused_before_anything_is_written(url, tmp_path, capsys, until, expected):
    with pytest.raises(CampaignError, match=expected):
        run(study(until), url)
    (tmp_path / "a.yaml").write_text(TEXT.format(until=until))
    assert main(["check", str(tmp_path / "a.yaml")]) == 2
    assert re.search(expected, capsys.readouterr().err)
    (tmp_path / "a.yaml").unlink()
    assert not list(tmp_path.iterdir())


def test_the_unknowns_of_a_table_are_constants_too(toy, tmp_path, capsys):
    """Realisations go on until calibration knows the slope; what the table names is no unknown."""
    text = """
name: rig
model: toy
realisations: {at_least: 10, at_most: 400, until: {calibration.slope: 4 %}}
parameters: {slope: {linear: [1, 3, 6]}, position: {linear: [0.5 m, 3 m, 5]}, noise: 0.2}
measured: {table: rig.csv}

"""
    rows = "".join(f"{x},{2 * x},{0.02 * x}\n" for x in (0.6, 1.1, 1.7, 2.2, 2.8))
    (tmp_path / "rig.csv").write_text("position [m],height [m],standard_error [m]\n" + rows)
    run(loads(text, "rig.yaml", str(tmp_path)), str(tmp_path / "rig.zarr"))
    data = store.datasets(str(tmp_path / "rig.zarr"))
    (found,) = fits.available("toy")["calibration"].results(data).values()
    assert float(found.slope_high - found.slope_low) / 2 <= 0.04 * float(found.slope)
    assert 10 < taken(str(tmp_path / "rig.zarr")).max() < 400
    with pytest.raises(CampaignError, match=r"of the fit calibration \(slope\), got 'position'"):
        run(
            loads(text.replace("calibration.slope", "calibration.position"), "rig.yaml", str(tmp_path)),
            str(tmp_path / "b"),
        )
