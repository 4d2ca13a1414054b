import numpy as np
import pytest
from friction_store import store

from mdr_dask import bootstrap
from mdr_dask.errors import FitError
from mdr_dask.fits import available, friction, top
from mdr_dask.fits.cases import nonlinear
from mdr_dask.fits.indenter import within_indenter_law
from mdr_dask.physics.sliding import laws

FIT = {name: fit.compute for name, fit in available("sliding_friction").items()}


@pytest.fixture(scope="module")
def forces():
    axes = {"hurst": [0.3, 0.7], "normal_force": np.geomspace(1e-3, 1e2, 16), "velocity": np.geomspace(1e-5, 1e3, 17)}
    return store(axes, realisations=12)


def test_laws_are_found_again_in_data_made_by_them(forces):
    force = laws.force_number(forces.normal_force, forces.shear_modulus, forces.rms_roughness, forces.length)
    slope = forces.rms_slope.mean("realisation")
    velocity = laws.velocity_number(forces.velocity, forces.relaxation_time, slope, forces.rms_roughness)
    exact = np.sqrt(2) * slope * laws.interpolation(force, velocity, 0.35, 1.5)
    made = forces.assign(friction_coefficient=exact.broadcast_like(forces.friction_coefficient))
    found = FIT["interpolation"]({"": made})
    assert found["alpha"].values == pytest.approx(0.35, abs=1e-6)
    assert found["beta"].values == pytest.approx(1.5, rel=1e-6)
    assert found["rms_error"].values == pytest.approx(0, abs=1e-6)
    zone = FIT["zone_one"]({"": made})
    # at a force number of 0.3, the second term of eq. 3.18 is not yet negligible, so that the law is no exact power law
    assert zone["alpha"].values == pytest.approx(0.35, abs=0.1)


def test_the_interpolation_law_holds_as_stated(forces):
    found = FIT["interpolation"]({"": forces})
    assert np.all(found["rms_error"] <= found["rms_error_stated"] + 1e-9)
    assert np.all(found["rms_error_stated"] < 0.16)  # 11 % for long lines, and the scatter of 12 short lines


def test_an_exponent_without_influence_is_not_determined():
    """At high forces the fit lowers the third law without limit; the other results stay finite."""
    force, velocity = (axis.ravel() for axis in np.meshgrid([1.0, 15.0, 200.0], np.geomspace(0.01, 10, 12)))
    law = np.log(laws.interpolation(force, velocity, -40.0, 1.7))
    scatter = np.random.default_rng(5).normal(0, 1e-2, (1 + bootstrap.RESAMPLES, force.size))

    def model(constants):
        return np.log(laws.interpolation(force, velocity, constants[:, :1], np.exp(constants[:, 1:])))

    found, results = nonlinear(model, np.array([0.4, np.log(1.6)]), law + scatter, 10, str)
    assert np.all(np.isnan(found.constants[:, 0]))
    assert np.all(np.isfinite(found.constants[:, 1]))
    assert float(results["rms_error"]) < 0.02


def test_plateau_lies_near_root_two(forces):
    found = FIT["plateau"]({"": forces})
    assert found["plateau"].dims == ("hurst", "normal_force")
    high = found.isel(normal_force=slice(10, 13))
    assert np.all(high["reached"].str.startswith("yes"))
    assert high["plateau"].sel(hurst=0.7).values == pytest.approx(np.sqrt(2), rel=0.15)


def test_a_failed_line_of_three_leaves_a_plateau():
    """Some resamples contain only the failed line."""
    x = np.linspace(-1, 1, 5)
    lines = np.array([1.0, 1.02, 0.97])[:, None] * (1 - 0.3 * x**2)
    lines[1, 2] = np.nan
    found = top.highest(x, bootstrap.means(lines), 2)
    assert found.height[0] == pytest.approx(0.99, abs=0.03)


def test_bodies_outside_their_law_are_left_out():
    """A cone on three roughnesses: cases without enough roughness, and velocities of region IV, are left out."""
    data = store(
        {"rms_roughness": [1e-7, 1e-6, 5e-5], "velocity": np.geomspace(1e-3, 1e3, 13)},
        realisations=4,
        length=0.01,
        points=2000,
        oversampling=2,
        hurst=0.4,
        shear_modulus=1e6,
        normal_force=10.0,
        indenter={"shape": "cone", "angle": 0.17},
    )
    within = within_indenter_law(data, data["rms_slope"].mean("realisation"))
    assert not np.any(within.isel(rms_roughness=[0, 1]))
    assert np.all(within.isel(rms_roughness=2, velocity=slice(6)))
    assert not within.isel(rms_roughness=2, velocity=-1)
    found = FIT["indenter"]({"": data})
    assert 6 <= found["cases"] < 13
    assert found["rms_error_stated"] < 0.06
    none = FIT["indenter"]({"": data.isel(rms_roughness=[0, 1])})
    assert none["cases"] == 0
    assert np.isnan(none["exponent"])


def test_data_that_cannot_be_fitted_are_refused_with_the_reason(forces):
    with pytest.raises(FitError, match="expected at least three loads with F_N"):
        FIT["zone_one"]({"": forces.isel(velocity=slice(-3, None))})
    with pytest.raises(FitError, match="expected a store with an indenter"):
        FIT["indenter"]({"": forces})
    with pytest.raises(FitError, match="expected friction at three"):
        FIT["plateau"]({"": forces.isel(velocity=slice(2))})


def test_zone_one_has_the_known_constants():
    # physics note section 3: statics of 200 realisations, F_N / (G h L) in 0.01..0.3
    known = {0.0: (0.149, 1.68), 0.3: (0.275, 1.57), 0.7: (0.410, 1.66), 1.0: (0.430, 1.65)}
    axes = {"hurst": list(known), "normal_force": np.geomspace(0.01, 0.3, 8) * 0.1}
    data = store(axes, realisations=60, velocity=1e-9, points=2000)
    found = FIT["zone_one"]({"": data})
    for hurst, constants in known.items():
        here = found.sel(hurst=hurst)
        for name, value in zip(("alpha", "beta"), constants, strict=True):
            sigma = float(here[f"{name}_high"] - here[f"{name}_low"]) / (2 * 1.96)
            # four standard errors of 60 realisations here and 200 in the reference, plus 0.02 for the range of loads
            assert abs(float(here[name]) - value) < 4 * sigma * np.sqrt(1 + 60 / 200) + 0.02


@pytest.mark.parametrize("ends", [{}, {"rolloff_wavelength": 1e-3}, {"longest_wavelength": 2e-3}])
def test_a_slope_that_is_not_stored_follows_from_the_parameters_of_the_line(ends):
    data = store({"hurst": [0.3, 0.7], "points": [200, 400]}, realisations=1, **ends)
    found = friction.spectral_slope(data.drop_vars("rms_slope"))
    np.testing.assert_allclose(found.transpose("hurst", "points"), data["rms_slope"].mean("realisation"), rtol=1e-12)


@pytest.mark.parametrize("misfit", [0.0, 0.1])
def test_far_from_zone_one_its_constants_are_not_determined(misfit):
    """Loads of 250 to 10 000 depend on neither alpha nor beta (eq. 3.17), even if the law does not hold."""
    axes = {"normal_force": np.geomspace(25, 1000, 4), "velocity": np.geomspace(1e-3, 10, 9)}
    data = store(axes, realisations=6)
    wrong = 1 + misfit * np.cos(3 * np.log(data.velocity) + np.log(data.normal_force))
    found = FIT["interpolation"]({"": data.assign(friction_coefficient=data.friction_coefficient * wrong)})
    for name in ("alpha", "beta"):
        assert np.isnan([found[name + end].item() for end in ("", "_low", "_high")]).all()
