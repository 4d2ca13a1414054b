"""The claims of the thesis that are tested, by their text in docs/thesis.md."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.thesis import measures
from benchmarks.thesis.ledger import FromFit, Judge

MIDDLE = {"hurst": slice(0.15, 0.85)}
THREE = {"hurst": [0.2, 0.5, 0.8]}
FEW = {"hurst": "[0, 0.2, 0.5, 0.8, 1]"}
#: Reduced axes of campaigns: few speeds and Hurst exponents of the kinetics, and loads on the plateau.
SPEEDS = {"series_velocity": "{velocity: {geometric: [10 um/s, 10 m/s, 15]}, hurst: [0, 0.3, 0.7, 1]}"}
LOADS = {
    "series_force_velocity": "{normal_force: {geometric: [0.1 N, 100 N, 4]}, velocity: [1 mm/s, 0.1 m/s, 10 m/s]}",
}


def friction(law: str, series: str, sentence: str, *constants: str) -> FromFit:
    """Return the verdict of a fit to `friction_laws` at H = 0.2 to 0.8."""
    return FromFit("friction_laws", law, series, sentence, constants, MIDDLE, THREE, FEW)


def curves(law: str, sentence: str, *constants: str) -> FromFit:
    """Return the verdict of a fit to `friction_force`."""
    return FromFit("friction_force", law, sentence=sentence, constants=constants)


def kinetics(law: str, sentence: str, *constants: str, within: Mapping[str, Any] | None = None) -> FromFit:
    """Return the verdict of a fit to the series `velocity` of `kinetics2014`."""
    return FromFit("kinetics2014", law, "velocity", sentence, constants, within or {}, replaced=SPEEDS)


JUDGES: dict[str, Judge] = {
    "A body of revolution and its line follow from each other": measures.transforms,
    "Force, depth and radius follow from the line": measures.hertz,
    "Lines with a given spectrum; the same phases for every H": measures.lines,
    "C1D = pi q C2D keeps rms height and full gradient": measures.rule,
    "rms height from the integral of the spectrum": measures.integral(0, "both"),
    "rms slope from the integral of the spectrum": measures.integral(2, "both"),
    "The same with the upper limit alone": measures.integral(2, "upper"),
    "In zone 1 mu is proportional to the square of the slope": measures.slope_squared,
    "mu depends on force and modulus through F/G only": measures.force_over_modulus,
    "Region I (mu ~ v), plateau, and decay": measures.regions,
    "Region IV: friction drops to another constant level": measures.last_level,
    "Region II is a decade wide, and mu doubles in it": measures.transition,
    "The plateau depends only weakly on the force": measures.weak_dependence,
    "alpha = H/(1+H) for H = 0.2 to 0.8": friction("zone_one", "zone_one", "law_holds", "alpha", "beta"),
    "At low speed mu follows from contact length and slope in contact": friction(
        "contact_growth", "zone_one", "fitted_law_holds", "mu_over_law", "slope_in_contact"
    ),
    "The contact length is proportional to the load to the power 1/(1+H)": friction(
        "contact_growth", "zone_one", "law_holds", "exponent"
    ),
    "In full contact mu = 4 eta v L slope^2 / F": measures.full_contact,
    "On the plateau mu = sqrt 2 times the slope in contact": friction(
        "plateau", "plateau", "law_holds", "plateau_of_contact"
    ),
    "On the plateau mu = sqrt 2 times the slope of the whole line": friction(
        "plateau", "plateau", "line_slope_holds", "plateau"
    ),
    "The sqrt 2 is rms over mean of the slopes, and depends only weakly on their distribution": measures.slopes,
    "One law for regions I to III and both zones": curves("interpolation", "law_holds", "alpha", "beta"),
    "F_N = G h L gives the order of magnitude of complete contact": measures.complete_contact,
    "Friction falls in region IV because the slope in contact falls": friction(
        "contact_slope", "plateau", "friction_follows", "friction_over_slope", "fall"
    ),
    "The slope in contact follows from its length by the integral of the spectrum": friction(
        "contact_slope", "plateau", "law_holds", "factor"
    ),
    "The slope in contact is a function of the depth alone": measures.slope_of_depth,
    "Curves at all loads are one curve, shifted by the slope in contact and along the velocity": curves(
        "collapse", "law_holds", "rms_before"
    ),
    "Curves at all loads are one curve, shifted freely along both axes": curves(
        "collapse", "fitted_law_holds", "rms_error"
    ),
    "The shifts along the velocity are those of (3.17)": measures.shifts,
    "The exponent 1.5 fits all parameter sets": FromFit(
        "scirep2014_cone", "indenter", "relaxation", constants=("exponent",)
    ),
    "At 40 N the contact is as wide as the layer is thick": measures.layer,
    "The rubber warms by 0.06 K at 100 N and 1 cm/s": measures.heating,
    "The micro-contacts warm by 0.08 K": measures.small_heating,
    "One exponential fits the relaxation; b = 2.4": FromFit(
        "kinetics2014", "relaxation", "example", "fitted_law_holds", ("rate", "integral_rate")
    ),
    "Jumps are proportional to the change of the velocity, from -20 to +30 %": measures.proportional_jumps,
    "In region I zeta = 1": kinetics("jump_law", "zeta_holds", "zeta"),
    "On the plateau the jump is 0.4 of the slope, times dv / v_1": kinetics(
        "jump_law", "plateau_holds", "plateau_jump"
    ),
    "The jump follows one law with the constant 0.4": kinetics("jump_law", "law_holds", "constant"),
    "The same law at all loads": FromFit(
        "kinetics2014", "jump_law", "force_velocity", constants=("constant",), replaced=LOADS
    ),
    "Below v_1 tau q_max = 1 the rate b is proportional to v_1": kinetics(
        "rate_power", "law_holds", "power", within={"regime": "below"}
    ),
    "Above it b is proportional to v_1^(1 - H)": kinetics(
        "rate_power", "law_holds", "power", within={"regime": "above"}
    ),
    "Closed law of mu(t) after the jump": kinetics("relaxation", "law_holds", within={"hurst": [0.3, 0.7]}),
    "A Stribeck curve: boundary friction, a minimum, a rise": measures.stribeck,
    "Pan and Hamrock's formulas give the film": FromFit(
        "ehl_map", "film_exponents", "barus", constants=("central_load", "central_speed", "central_material")
    ),
    "Factor 1.806 of the formula with units": measures.unit_dependent,
    "Contact switches on and off often at 800 N, 100 rpm, 40 degC": measures.switching,
    "Breakthrough rises with temperature and load and falls with speed: 125 cases": measures.trends,
    "Pressure raises the density by 33 % at most": measures.density,
    "The smallest film is 75 % of the central one": measures.film_ratio,
    "The fast rule meets exact profiles for any number of cycles": measures.fast_rule,
    "a(c) of the parabola, in closed form": measures.limiting_radius,
}
