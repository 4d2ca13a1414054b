"""Film exponents: exact for a power law, and close to known exponents for computed films."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mdr_dask.errors import FitError
from mdr_dask.fits import available

FIT = available("ehl_line")["film_exponents"]


def film_exponents(series: dict[str, xr.Dataset]) -> xr.Dataset:
    """Return the fit of the only series."""
    return FIT.results(series)[next(iter(series))]


def power_law(W: np.ndarray, U: np.ndarray, G: np.ndarray) -> xr.Dataset:
    film = 2.922 * W[:, None, None] ** -0.166 * U[None, :, None] ** 0.692 * G[None, None, :] ** 0.47
    dims = ("load_parameter", "speed_parameter", "material_parameter")
    return xr.Dataset(
        {"central_film": ((*dims, "realisation"), film[..., None])},
        coords=dict(zip(dims, (W, U, G), strict=True)) | {"contact_modulus": 1.15e11},
    )


GRID = (np.geomspace(1e-5, 1e-4, 3), np.geomspace(1e-12, 1e-10, 4), np.array([2000.0, 4000.0, 8000.0]))


def test_power_law_is_recovered() -> None:
    fit = film_exponents({"map": power_law(*GRID)})
    for name, value in (("load", -0.166), ("speed", 0.692), ("material", 0.47), ("factor", 2.922)):
        assert float(fit[f"central_{name}"]) == pytest.approx(value, rel=1e-9)
    assert float(fit["central_worst"]) < 1e-12
    assert str(fit["law_holds"].item()).startswith("yes: ")


def test_a_bent_law_is_named_and_its_interval_is_wide() -> None:
    """The exponent of the speed changes from 0.4 to 1 over the map, as from an elastic to a rigid contact."""
    speeds = np.geomspace(1e-13, 1e-9, 9)
    data = power_law(GRID[0], speeds, GRID[2])
    logarithm = np.log(speeds / 1e-11)
    bend = np.exp(0.3 / 9.2 / 2 * logarithm**2)[None, :, None, None]
    fit = film_exponents({"": data.assign(central_film=data["central_film"] * bend)})
    assert str(fit["law_holds"].item()).startswith("no: departs by")
    straight = film_exponents({"": data})
    assert str(straight["law_holds"].item()).startswith("yes")
    assert fit["central_speed_high"] - fit["central_speed_low"] > 0.08  # scatter alone would give 0.02


@pytest.mark.slow
def test_interval_contains_the_exponent_at_its_rate() -> None:
    """95 % of the intervals of 200 noisy maps contain the exponent; three standard errors are 4.6 %."""
    inside = 0
    for seed in range(200):
        data = power_law(*GRID)
        noise = np.exp(0.03 * np.random.default_rng(seed).normal(size=data["central_film"].shape))
        fit = film_exponents({"": data.assign(central_film=data["central_film"] * noise)})
        inside += bool(fit["central_speed_low"] <= 0.692 <= fit["central_speed_high"])
    assert abs(inside / 200 - 0.95) < 0.046


def test_a_parameter_that_is_not_varied_has_no_exponent() -> None:
    one = power_law(GRID[0][:1], GRID[1], GRID[2]).isel(load_parameter=0)
    fit = film_exponents({"": one})
    assert np.isnan(fit["central_load"]).all()
    assert float(fit["central_speed"]) == pytest.approx(0.692)


def test_other_axes_make_maps_of_their_own() -> None:
    one = power_law(*GRID)
    both = xr.concat([one, 2 * one], dim="viscosity_law").assign_coords(viscosity_law=["barus", "roelands"])
    fit = film_exponents({"map": both})
    assert fit["viscosity_law"].values.tolist() == ["barus", "roelands"]
    np.testing.assert_allclose(fit["central_factor"], [2.922, 2 * 2.922], rtol=1e-9)


def test_failed_cases_are_left_out() -> None:
    data = power_law(*GRID)
    data["central_film"][0, 0, 0] = np.nan
    assert float(film_exponents({"": data})["central_speed"]) == pytest.approx(0.692, rel=1e-9)


def test_too_few_films_are_refused() -> None:
    enough = film_exponents({"": power_law(GRID[0][:1], GRID[1][:3], GRID[2][:1])})
    assert float(enough["central_speed"]) == pytest.approx(0.692, rel=1e-9)
    with pytest.raises(FitError, match="more film thicknesses than fitted constants"):
        film_exponents({"": power_law(GRID[0][:1], GRID[1][:2], GRID[2][:1])})
    with pytest.raises(FitError, match="expected the outputs central_film, minimum_film"):
        film_exponents({"": xr.Dataset()})


def test_parameters_that_vary_only_together_have_no_exponents() -> None:
    """A change of the modulus changes W, U and G by powers of the same factor."""
    one = power_law(np.array([1e-4]), np.array([1e-10]), np.array([2000.0])).central_film.item()
    stiffness = np.geomspace(1.0, 10.0, 8)
    film = one * stiffness ** (0.166 - 0.692 + 0.47)
    data = xr.Dataset(
        {"central_film": (("modulus", "realisation"), film[:, None])},
        {
            "load_parameter": ("modulus", 1e-4 / stiffness),
            "speed_parameter": ("modulus", 1e-10 / stiffness),
            "material_parameter": ("modulus", 2000 * stiffness),
            "contact_modulus": 1e11,
        },
    )
    fit = film_exponents({"": data})
    assert all(np.isnan(fit[f"central_{name}"]) for name in ("load", "speed", "material", "factor"))
    assert str(fit["law_holds"].item()).startswith("yes")
