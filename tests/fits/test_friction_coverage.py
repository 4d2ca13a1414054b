"""Coverage of the intervals of the fits of sliding friction, and verdicts on laws that do not hold."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr
from fit_studies import LENGTH, POINTS, RMS, SLOPE, TAU, G, coverage, judged, not_contradicted, planted

from mdr_dask.fits import available
from mdr_dask.fits.scaling import contact_slope_law
from mdr_dask.physics.sliding import laws

pytestmark = pytest.mark.slow
FIT = available("sliding_friction")
LEAST = 0.9  # 95 % minus 2.3 standard deviations of a fraction of 100 studies
LINES = pytest.mark.parametrize("lines", [5, 30])
# relative scatter that is common to all cases of a line, and relative scatter of every single case
SHARED, OWN = (0.1, 0.02), (0.05, 0.1)

ZONE = {"normal_force": np.geomspace(1e-3, 3e-2, 8)}
TOP = {"normal_force": 15.0 * G * RMS * LENGTH, "velocity": np.geomspace(1e-2, 1e4, 19) / 100}
PLANE = {"normal_force": np.geomspace(0.3, 30, 4) * G * RMS * LENGTH, "velocity": np.geomspace(1e-6, 1e-2, 7)}
#: A flat cone that is pressed in by more than the roughness.
CONE = {"velocity": np.geomspace(1e-4, 3e-1, 9), "indenter_angle": 0.015, "normal_force": 0.5}
STEEP = {"hurst": 0.9, "normal_force": ZONE["normal_force"]}


def zone(force, velocity):
    return np.sqrt(2) * SLOPE * 1.5 * velocity * force**-0.35


def plane(force, velocity):
    return np.sqrt(2) * SLOPE * laws.interpolation(force, velocity, 0.35, 1.5)


def broad(_, velocity):
    return np.sqrt(2) * SLOPE * (1 + (velocity / 0.02) ** -2) ** -0.5 * (1 + (velocity / 5000) ** 2) ** -0.5


def skew(_, velocity):
    return 2 * SLOPE * velocity / (1 + velocity) * (1 + velocity / 3) ** -0.4


def saturating(_, velocity):
    return np.sqrt(2) * SLOPE * (1 + (velocity / 0.05) ** -2) ** -0.5


def of_xi(law):
    """Return friction of the cone as a function of xi."""
    half_width = np.sqrt(0.5 / (4 * G) / (np.pi / 2 * np.tan(0.015)))

    def of_velocity(_, number):
        velocity = number * np.sqrt(2) * RMS / (TAU * SLOPE)
        xi = laws.indenter_low(half_width, velocity, TAU, G, 0.5, SLOPE) / (np.sqrt(2) * SLOPE)
        return np.sqrt(2) * SLOPE * law(xi)

    return of_velocity


def fraction(force, _):
    return 0.5 * force**0.6


def in_contact(force, _):
    return 0.9 * SLOPE * contact_slope_law(fraction(force, _), 0.9, POINTS)


def top_of(law):
    return {"plateau": law(None, np.geomspace(1e-3, 1e4, 200001)).max() / SLOPE}


class Case(NamedTuple):
    """A fit, the axes of a study, its outputs, and the planted constants."""

    fit: str
    axes: dict[str, Any]
    outputs: dict[str, Callable[..., Any]]
    truth: dict[str, float]
    verdict: str = "fitted_law_holds"

    def found(self, lines, studies=100, scatter=OWN, grid=0.0):
        """Fit every study; fits that need all dimensions of a study are made one after another."""
        data = planted(self.axes, lines, studies, scatter, grid, **self.outputs)
        found = FIT[self.fit].compute({"": data})
        if "study" in found.dims:
            return found
        return xr.concat([FIT[self.fit].compute({"": data.isel(study=k)}) for k in range(studies)], "study")


def of_friction(law):
    return {"friction_coefficient": law}


CASES = {
    "zone_one": Case("zone_one", ZONE, of_friction(zone), {"alpha": 0.35, "beta": 1.5}),
    "interpolation": Case("interpolation", PLANE, of_friction(plane), {"alpha": 0.35, "beta": 1.5}),
    "indenter": Case("indenter", CONE, of_friction(of_xi(lambda xi: laws.indenter(xi, 1.3))), {"exponent": 1.3}),
    "broad": Case("plateau", TOP, of_friction(broad), top_of(broad), "reached"),
    "skew": Case("plateau", TOP, of_friction(skew), top_of(skew), "reached"),
    "saturating": Case("plateau", TOP, of_friction(saturating), top_of(saturating), "reached"),
    "contact_growth": Case(
        "contact_growth",
        ZONE,
        {"contact_fraction": lambda force, _: 0.3 * force**0.6},
        {"exponent": 0.6, "factor": 0.3},
    ),
    "contact_slope": Case(
        "contact_slope",
        STEEP,
        {"contact_fraction": fraction, "contact_slope": in_contact},
        {"factor": 0.9},
        "law_holds",
    ),
}


@pytest.mark.parametrize(("lines", "scatter"), [(5, OWN), (10, SHARED), (30, OWN)])
@pytest.mark.parametrize("case", CASES)
def test_intervals_contain_planted_constants(case, lines, scatter):
    found = CASES[case].found(lines, scatter=scatter)
    for name, value in CASES[case].truth.items():
        assert coverage(found, name, value) >= LEAST
        if name == "plateau":  # unbiased, although the largest of the noisy means is up to 7 % too high here
            assert float(found[name].mean()) == pytest.approx(value, rel=0.025)
    assert not_contradicted(found, lines, CASES[case].verdict) >= LEAST


@pytest.mark.parametrize(("lines", "grid"), [(5, 0.2), (30, 0.02)])
@pytest.mark.parametrize("case", ["zone_one", "interpolation", "indenter", "broad"])
def test_a_stated_error_of_the_grid_is_part_of_the_interval(case, lines, grid):
    """All friction is too high by the stated error, so that an interval from scatter alone would miss the truth."""
    found = CASES[case].found(lines, 20, (0.01, 0.01), grid)
    for name, value in CASES[case].truth.items():
        assert coverage(found, name, value) >= LEAST
    assert case == "broad" or judged(found, "no:") == 0


WRONG = {
    "bent": Case(
        "zone_one",
        ZONE,
        of_friction(lambda f, v: zone(f, v) * 2 ** (np.log(f / 0.055) / np.log(0.3 / 0.055)) ** 2),
        {"alpha": 0.2},
    ),
    "kinked": Case(
        "interpolation", PLANE, of_friction(lambda f, v: plane(f, v) * np.where(v > 0.1, 0.6, 1)), {"alpha": 0.1}
    ),
    "cone": Case(
        "indenter",
        CONE,
        of_friction(of_xi(lambda xi: laws.indenter(xi, 1.5) * np.where(xi > 0.1, 1.0, 2.0))),
        {"exponent": 0.3},
    ),
    "slope": Case(
        "contact_slope",
        STEEP,
        {"contact_fraction": fraction, "contact_slope": lambda f, _: SLOPE * f**0.4},
        {"factor": 0.1},
        "law_holds",
    ),
}


@LINES
@pytest.mark.parametrize("case", WRONG)
def test_another_law_is_named_and_widens_the_interval(case, lines):
    """From scatter alone, the interval would be 0.02 wide; `truth` contains the smallest allowed width."""
    found = WRONG[case].found(lines, 10, (0.05, 0.02))
    assert judged(found, "yes", WRONG[case].verdict) == 0
    for name, width in WRONG[case].truth.items():
        assert np.all(found[f"{name}_high"] - found[f"{name}_low"] > width)


@LINES
@pytest.mark.parametrize(
    ("law", "end"),
    [
        (lambda _, v: (1 + (v / 5) ** -1) ** -0.5, "still rises at the largest velocity"),
        (lambda _, v: (1 + v / 0.001) ** -0.5, "already falls at the lowest velocity"),
    ],
)
def test_a_plateau_that_is_not_reached_has_no_interval(lines, law, end):
    far = {**TOP, "velocity": TOP["velocity"][:9]}
    found = FIT["plateau"].compute({"": planted(far, lines, 20, (0.1, 0.02), friction_coefficient=law)})
    assert judged(found, "no: the plateau is not reached, friction " + end, "reached") == 1
    assert np.all(np.isnan(found["plateau_low"]) & np.isnan(found["plateau_high"]))
    assert np.all(np.isfinite(found["plateau"]))


@pytest.mark.parametrize("law", [zone, WRONG["bent"].outputs["friction_coefficient"]])
def test_one_line_alone_has_no_interval_and_no_verdict(law):
    found = FIT["zone_one"].compute({"": planted(ZONE, 1, 1, (0.0, 0.0), friction_coefficient=law)}).squeeze()
    assert found["fitted_law_holds"].item().startswith("not tested: too few realisations to estimate the scatter")
    assert np.isfinite(found["alpha"])
    assert np.isnan(found["alpha_low"])
