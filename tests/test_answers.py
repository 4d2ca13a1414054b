"""Rounds of realisations until a fitted constant is known, spent on the cases that it follows from."""

import numpy as np
import pytest
from test_execute import digests, run

from mdr_dask import store
from mdr_dask.campaign import Tolerance, loads
from mdr_dask.errors import CampaignError
from mdr_dask.fits import available

TEXT = """
name: answers
model: sliding_friction
seed: 5
realisations: {{at_least: 10, at_most: 60, until: {{{until}}}}}
parameters:
  length: 20 mm
  points: 500
  hurst: 0.7
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  normal_force: [2 mN, 6 mN, 20 mN, 1 N]
  velocity: [1 nm/s, 10 nm/s, 1 m/s]
outputs: [friction_coefficient]
errors: false
"""


def study(until):
    return loads(TEXT.format(until=until), "a.yaml", ".")


def test_what_is_no_output_is_a_constant_of_a_fit():
    wanted = study("friction_coefficient: 1 %, zone_one.alpha: 0.01, plateau: 2 %").replication
    assert wanted.until == {"friction_coefficient": Tolerance(relative=0.01)}
    assert wanted.answers == {
        "zone_one.alpha": Tolerance(absolute=0.01),
        "plateau.plateau": Tolerance(relative=0.02),
    }


def test_what_is_neither_is_refused_before_anything_is_written(url, tmp_path):
    with pytest.raises(
        CampaignError, match=r"until\.zone_two: neither an output nor a fit of .*did you mean 'zone_one'"
    ):
        run(study("zone_two.alpha: 0.01"), url)
    assert not list(tmp_path.iterdir())


def test_the_interval_is_as_narrow_as_asked_and_only_cases_that_narrow_it_go_on(url):
    campaign = study("zone_one.alpha: 0.06")
    run(campaign, url)
    data = store.datasets(url)
    found = available("sliding_friction")["zone_one"].results(data)[""]
    done = data[""].friction_coefficient.notnull().sum("realisation")
    half = float(found.alpha_high - found.alpha_low) / 2
    assert half <= 0.06 or done.max() == 60
    assert done.max() > 10
    assert (done.sel(normal_force=1.0) == 10).all()  # beyond zone 1
    assert (done.sel(velocity=1.0) == 10).all()  # beyond region I
    assert int(done.sum()) < 0.5 * done.size * int(done.max())
    before = digests(url)
    assert run(campaign, url).done == 0
    assert digests(url) == before
    np.testing.assert_array_equal(done, store.datasets(url)[""].friction_coefficient.notnull().sum("realisation"))
