"""Values known from independent calculations lie in the intervals of fits to a campaign."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mdr_dask import execute
from mdr_dask.campaign import Replication, load
from mdr_dask.fits import available
from mdr_dask.store import datasets

CAMPAIGNS = Path(__file__).parent.parent / "campaigns"
#: At v -> 0 from statics alone, 200 realisations, H = 0, 0.1, ..., 1.
ALPHA = np.array([0.149, 0.183, 0.229, 0.275, 0.315, 0.352, 0.384, 0.410, 0.429, 0.437, 0.430])
BETA = np.array([1.68, 1.62, 1.58, 1.57, 1.59, 1.61, 1.64, 1.66, 1.68, 1.68, 1.65])
#: What another window of loads does to them.
ALPHA_WINDOW, BETA_WINDOW = 0.02, 0.14


@pytest.fixture(scope="module")
def groups(tmp_path_factory):
    campaign = replace(load(CAMPAIGNS / "friction_laws.yaml"), replication=Replication(24, 24, {}))
    url = str(tmp_path_factory.mktemp("laws") / "laws.zarr")
    progress = execute.run(campaign, url, execute.Resources(), lambda _: None)
    assert progress.failed == 0
    return datasets(url)


def sigma(fitted, name):
    return (fitted[f"{name}_high"] - fitted[f"{name}_low"]).to_numpy() / 3.92


@pytest.mark.slow
def test_zone_one_over_the_hurst_exponent(groups):
    fitted = available("sliding_friction")["zone_one"].results(groups)["zone_one"]
    assert (abs(fitted.alpha - ALPHA) < 4 * sigma(fitted, "alpha") + ALPHA_WINDOW).all()
    assert (abs(fitted.beta - BETA) < 4 * sigma(fitted, "beta") + BETA_WINDOW).all()
    middle = fitted.sel(hurst=slice(0.15, 0.85))
    law = middle.hurst / (1 + middle.hurst)
    assert (abs(middle.alpha - law) < 0.06 + 4 * sigma(middle, "alpha")).all()


@pytest.mark.slow
def test_the_plateau_over_the_hurst_exponent(groups):
    fitted = available("sliding_friction")["plateau"].results(groups)["plateau"]
    plateau = fitted.plateau.squeeze()
    assert plateau.sel(hurst=0.0) == pytest.approx(1.26, abs=0.06)
    middle = plateau.sel(hurst=slice(0.15, 0.85))
    assert (abs(middle / np.sqrt(2) - 1) < 0.08).all()
