"""Growth and slope of the contact, and collapse of curves: planted laws, wrong laws, and computed friction."""

import numpy as np
import pytest
from fit_studies import SLOPE, coverage, judged, not_contradicted, planted
from friction_store import store

from mdr_dask.errors import FitError
from mdr_dask.fits import available, scaling
from mdr_dask.fits.scaling import FITS, contact_slope_law
from mdr_dask.physics.surfaces import roughness

FIT = {fit.name: fit for fit in FITS}
LEAST = 0.9  # 95 % minus 2.3 standard deviations of a fraction of 100 studies
LINES = pytest.mark.parametrize("lines", [3, 30])
LOADS = {"normal_force": np.geomspace(1e-3, 3e-2, 8)}


@pytest.mark.parametrize("hurst", [0.0, 0.5, 0.9, 1.0])
def test_slope_in_contact_by_its_integral(hurst):
    """Eq. 3.21 agrees with a sum over the waves of the line that are shorter than the contact."""
    amplitude = roughness.amplitudes(2000, hurst)
    slope = roughness.spectral_slope(amplitude)
    for fraction in (1.0, 0.3, 0.03):
        part = np.where(np.arange(1, 2001) * fraction >= 1, amplitude, 0.0)
        # integral and sum differ by about one wave at their lower end, which matters most for H = 1
        expected = roughness.spectral_slope(part) / slope
        assert contact_slope_law(np.array(fraction), hurst, 4000) == pytest.approx(expected, abs=0.05)
    assert np.isnan(contact_slope_law(np.array(1e-4), hurst, 4000))


CURVES = {"normal_force": np.geomspace(0.01, 10, 4), "velocity": np.geomspace(1e-7, 1e-1, 19)}
RIGHT, UP = 0.7, 0.2  # powers of the load by which the curves are shifted


def scaled(force, velocity):
    """Return friction by eq. 3.22, with a common curve that differs from the laws of the package."""
    x = velocity * 300 / force**RIGHT
    return force**UP * x / (1 + x**0.7) ** (1 / 0.7)


@pytest.mark.slow
@LINES
def test_curves_collapse_with_the_planted_shifts(lines):
    found = FIT["collapse"].compute({"": planted(CURVES, lines, 60, friction_coefficient=scaled)})
    decades = np.log10(found["force_number"] / found["force_number"].isel(curve=2))
    assert coverage(found, "horizontal", -RIGHT * decades) >= LEAST
    assert coverage(found, "vertical", -UP * decades) >= LEAST
    assert not_contradicted(found, lines) == 1
    assert np.all(found["rms_error"] < 0.1 * found["rms_before"])


def test_curves_without_scatter_collapse_exactly():
    """The curves are five parts of one bell; the penalty on bends does not distort it."""
    place = np.linspace(-1.5, 1.5, 21)
    along, up = np.array([0.0, 0.4, 0.9, 1.3, 1.8]), np.array([0.0, 0.1, -0.2, 0.3, 0.1])
    x = (place[None] + 0.0 * along[:, None]).ravel()
    member = np.repeat(np.arange(5), place.size)
    row = -np.log(np.cosh(x + along[member])) - up[member]
    found = scaling.collapse(x, row[None], member, along + 0.1, 0)
    np.testing.assert_allclose(found.shifts[0], [along, up], atol=0.01)
    assert np.max(np.abs(found.residuals)) < 0.01


@pytest.mark.slow
@LINES
def test_curves_of_different_form_do_not_collapse(lines):
    def different(force, velocity):
        x = velocity * 300
        return x / (1 + x ** (0.2 + 2 * (force > 1))) ** (1 / (0.2 + 2 * (force > 1)))

    found = FIT["collapse"].compute({"": planted(CURVES, lines, 2, friction_coefficient=different)})
    assert judged(found, "no: departs") == 1


def test_straight_curves_have_undetermined_shifts():
    found = FIT["collapse"].compute({"": planted(CURVES, 10, 2, friction_coefficient=lambda force, v: force**-0.3 * v)})
    moved = found.isel(curve=[0, 1, 3])
    assert all(np.all(np.isnan(moved[name])) for name in ("horizontal", "horizontal_low", "vertical", "vertical_high"))


def test_laws_that_predict_the_same_for_all_cases_are_not_tested():
    """In full contact, and for nearly equal loads, the data cannot contradict a law with a fitted factor."""
    whole = {
        "contact_slope": lambda force, v: SLOPE + 0 * force * v,
        "contact_fraction": lambda force, v: 1 + 0 * force,
    }
    found = FIT["contact_slope"].compute({"": planted(CURVES, 10, 1, **whole)})
    assert np.all(found["law_holds"].str.startswith("not tested: the lengths in contact"))
    near = {"normal_force": np.linspace(1e-2, 1.02e-2, 4)}
    data = planted(near, 10, 1, contact_fraction=lambda force, _: 0.3 * force**0.6)
    found = FIT["contact_growth"].compute({"": data})
    assert np.isnan(found["exponent"]).all()
    assert np.all(found["law_holds"].str.startswith("not tested: the cases differ too little"))
    assert np.all(found["fitted_law_holds"].str.startswith("not tested: these cases do not determine"))


def test_a_bend_of_one_curve_alone_determines_no_shift():
    """Of loads between 250 and 10 000, only the lowest gives a bent curve, and straight curves fit it anywhere."""
    axes = {"normal_force": np.geomspace(25, 1000, 4), "velocity": np.geomspace(1e-3, 0.5, 12)}
    data = planted(axes, 10, 1, friction_coefficient=lambda force, v: 1 / np.hypot(1, force / v / 4))
    found = FIT["collapse"].compute({"": data})
    assert np.all(np.isnan(found["horizontal"].isel(curve=[0, 1, 3])))


def test_the_model_follows_its_statics():
    axes = {"hurst": [0.3, 0.7], "normal_force": np.geomspace(0.01, 0.3, 6) * 0.1, "velocity": [1e-7, 1e-6]}
    outputs = ("friction_coefficient", "contact_fraction", "contact_slope", "rms_slope")
    data = store(axes, realisations=8, outputs=outputs, points=1000)
    found = FIT["contact_growth"].compute({"": data})
    assert np.all(np.abs(found["exponent"] - found["exponent_stated"]) < 0.06)
    # eq. 3.12 is exact without free recovery, that is, at the lowest velocity
    assert found["mu_over_law"].values == pytest.approx(1.0, abs=0.01)
    assert np.all((found["slope_in_contact"] > 0.7) & (found["slope_in_contact"] < 1.1))
    wide = FIT["contact_slope"].compute({"": data})
    assert np.all(np.isfinite(wide["factor"]))


def test_data_that_cannot_be_fitted_are_refused_with_the_reason():
    data = planted(LOADS, 5, 1, contact_fraction=lambda force, _: 0.3 * force**0.6).isel(study=0)
    with pytest.raises(FitError, match="contact_slope"):
        FIT["contact_slope"].compute({"": data})
    with pytest.raises(FitError, match="expected at least three loads"):
        FIT["contact_growth"].compute({"": data.isel(normal_force=slice(2))})
    curves = planted(CURVES, 5, 1, friction_coefficient=scaled)
    with pytest.raises(FitError, match="expected at least two loads"):
        FIT["collapse"].compute({"": curves.isel(normal_force=[0])})


def test_friction_beyond_its_maximum_follows_the_slope_in_contact():
    """In region IV, friction divided by the slope in contact is 2 / sqrt 3, as for one parabolic tip."""
    axes = {"velocity": np.geomspace(1e-2, 1e5, 12)}
    outputs = ("friction_coefficient", "contact_fraction", "contact_slope", "rms_slope")
    found = FIT["contact_slope"].compute({"": store(axes, realisations=6, outputs=outputs, normal_force=0.01)})
    assert str(found["friction_follows"].item()).startswith("yes")
    assert found["fall"] > 5
    assert found["friction_over_slope"] == pytest.approx(2 / np.sqrt(3), abs=0.03)


def test_the_plateau_is_compared_with_both_slopes():
    """Friction is 1.2 times the slope in contact and sqrt 2 times that of the line: eq. 3.15 does not hold."""
    axes = {"normal_force": [0.1], "velocity": np.geomspace(1e-4, 1e2, 9)}

    def level(_, velocity):
        return 1.2 * 1.2 * SLOPE / np.hypot(1, 1e-2 / velocity)

    data = planted(axes, 40, 1, friction_coefficient=level, contact_slope=lambda force, v: 1.2 * SLOPE + 0 * v * force)
    found = available("sliding_friction")["plateau"].compute({"": data.isel(study=0, normal_force=0)})
    assert str(found["line_slope_holds"].item()).startswith("yes")
    assert str(found["law_holds"].item()).startswith(("no: departs by -", "approximately: departs by -"))
    assert found["plateau_of_contact"] == pytest.approx(1.2, rel=0.03)
    without = available("sliding_friction")["plateau"].compute({"": data.isel(study=0).drop_vars("contact_slope")})
    assert str(without["law_holds"].values.flat[0]).startswith("not tested: the study has no output contact_slope")


def test_too_few_points_do_not_test_a_collapse():
    """With more constants than points, any curves collapse. A load without a curve has NaN."""
    axes = {"hurst": [0.3, 0.7], "normal_force": np.geomspace(1e-2, 10, 4), "velocity": np.geomspace(1e-6, 1, 5)}
    data = planted(axes, 3, 1, friction_coefficient=scaled).isel(study=0)
    falling = (data.hurst == 0.7) & (data.normal_force > 5) & (data.velocity > 1e-5)
    data["friction_coefficient"] = data.friction_coefficient.where(~falling, 1e-9)
    found = FIT["collapse"].compute({"": data})
    assert found["force_number"].notnull().all()
    assert found["fitted_law_holds"].str.startswith("not tested: ").all()
    assert found["horizontal_low"].isnull().all()
