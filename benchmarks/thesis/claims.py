"""The claims of the thesis, chapter by chapter."""

from __future__ import annotations

from typing import Any

from benchmarks.thesis import measures
from benchmarks.thesis.ledger import Claim, FromFit

PAGE = "python -m benchmarks thesis"


def run(campaign: str) -> str:
    """Return the command that runs a campaign."""
    return f"mdr-dask run campaigns/{campaign}.yaml"


def fit(campaign: str, law: str) -> str:
    """Return the command that fits a law."""
    return f"mdr-dask fit results/{campaign}.zarr {law}"


MIDDLE = {"hurst": slice(0.15, 0.85)}
THREE = {"hurst": [0.2, 0.5, 0.8]}
FEW = {"hurst": "[0, 0.2, 0.5, 0.8, 1]"}
#: Reduced axes of campaigns: few speeds and Hurst exponents of the kinetics, and loads on the plateau.
SPEEDS = {"series_velocity": "{velocity: {geometric: [10 um/s, 10 m/s, 15]}, hurst: [0, 0.3, 0.7, 1]}"}
LOADS = {
    "series_force_velocity": "{normal_force: {geometric: [0.1 N, 100 N, 4]}, velocity: [1 mm/s, 0.1 m/s, 10 m/s]}",
}


def friction(law: str, series: str, **options: Any) -> FromFit:
    """Return the verdict of a fit to `friction_laws` at H = 0.2 to 0.8."""
    return FromFit("friction_laws", law, series, within=MIDDLE, shown=THREE, replaced=FEW, **options)


def kinetics(law: str, **options: Any) -> FromFit:
    """Return the verdict of a fit to the series `velocity` of `kinetics2014`."""
    return FromFit("kinetics2014", law, "velocity", replaced=SPEEDS, **options)


METHOD = (
    Claim(
        "1.2",
        "The reduction to one dimension is exact, for rough surfaces too",
        "",
        "no: exact for bodies of revolution; for rough ones the stiffness is within 15 % of a half-space (25 % at "
        "light loads), and the area is not given at all",
        "The length in contact only repeats the stiffness (Lyashenko et al., Tribol. Lett. 52, 223, 2013).",
    ),
    Claim(
        "(2.1), (2.2)",
        "Reduced moduli E* and G* of a pair",
        "mdr-dask models mixed_lubrication",
        "yes: both are parameters",
        "Elastic similarity (6.3) of the two bodies is an assumption of the user.",
    ),
    Claim(
        "(2.3), fig. 2.1, 3.2",
        "Elements: spring, dashpot, Kelvin body, standard solid",
        run("velocity_protocols"),
        "yes: Kelvin body, standard solid, Prony series, measured moduli",
    ),
    Claim(
        "(2.4), (2.5)",
        "A body of revolution and its line follow from each other",
        "pytest tests/physics/mdr",
        measures.transforms,
        "The printed (2.4) leaves out f(0), which a worn body needs.",
    ),
    Claim("(2.6)-(2.10)", "Force, depth and radius follow from the line", "pytest tests/physics/mdr", measures.hertz),
    Claim(
        "(2.11)",
        "Pressure from the line",
        "pytest tests/physics/mdr",
        "yes: with the jump at the edge of a worn line; errors in wear.md",
    ),
    Claim(
        "2.2",
        "Conductance, heat and friction follow from force over depth",
        run("rolling2013_trace"),
        "not modelled: only the electrical resistance (5.1) is an output",
        "The solvers compute dF/dd, the contact stiffness, but no model has it as an output.",
    ),
    Claim(
        "(2.13)-(2.19), (2.22), (2.24), fig. 2.6",
        "Lines with a given spectrum; the same phases for every H",
        run("quickstart"),
        measures.lines,
        "A real line needs phi(-q) = -phi(q); the thesis prints an even phase.",
    ),
    Claim(
        "(2.12), (2.21), (2.23)",
        "Spectrum, rms height and gradient of areal surfaces",
        "mdr-dask surface MAP",
        "yes: of measured maps, in rings of the wavenumber (surfaces.md)",
    ),
    Claim(
        "(2.14), (2.16), (2.17)",
        "Areal surfaces with a given spectrum",
        "",
        "not modelled: maps are read, not generated",
    ),
    Claim(
        "(2.20)",
        "C1D = pi q C2D keeps rms height and full gradient",
        PAGE,
        measures.rule,
        "A measured scan is not this line: its slope is smaller by the square root of two.",
    ),
    Claim(
        "(2.25)",
        "rms height from the integral of the spectrum",
        PAGE,
        measures.integral(0, "both"),
        "The first harmonics carry the height, and their sum is not an integral.",
    ),
    Claim("(2.26)", "rms slope from the integral of the spectrum", PAGE, measures.integral(2, "both")),
    Claim(
        "(2.27)",
        "The same with the upper limit alone",
        PAGE,
        measures.integral(2, "upper"),
        "Near H = 1 the lower limit counts.",
    ),
)

STEADY = (
    Claim(
        "(3.1)-(3.5), fig. 3.3",
        "Creep and relaxation of an element",
        "pytest tests/physics/transients",
        "yes: elements follow closed forms between contacts",
    ),
    Claim(
        "(3.6)-(3.10)",
        "Forces and friction of a Kelvin foundation in steady sliding",
        run("quickstart"),
        "yes: found directly, without running in, every number with its error",
        "Lines move as in (3.28), against the direction of (3.7): this matters for one asymmetric line only.",
    ),
    Claim(
        "3.2.1, 4.2",
        "The algorithm is not iterative and has no convergence problems",
        run("quickstart"),
        "no: the depth that belongs to a given load is found by iteration",
        "The elements are independent, so each step of the iteration is one pass along the line.",
    ),
    Claim(
        "fig. 3.6",
        "Friction from the start of sliding",
        run("velocity_protocols"),
        "yes: series `start`; the transient ends after the shortest wave or a relaxation time",
    ),
    Claim(
        "3.2.2",
        "3.5 million simulations in 50 h",
        run("prl2013"),
        "yes: 3.52 million on the same grid and with the same time steps in 54 s (version 0.1, two cores)",
    ),
    Claim(
        "3.2.2",
        "In zone 1 mu is proportional to the square of the slope",
        run("friction_force"),
        measures.slope_squared,
        "The slope is changed by the shortest wave alone.",
    ),
    Claim(
        "3.2.2",
        "mu depends on force and modulus through F/G only",
        run("quickstart"),
        measures.force_over_modulus,
        "An exact similarity.",
    ),
    Claim("fig. 3.7, 3.9", "Region I (mu ~ v), plateau, and decay", run("friction_force"), measures.regions),
    Claim(
        "abstract, 3.2.2",
        "Region IV: friction drops to another constant level",
        run("friction_force"),
        measures.last_level,
        "The last contact is one parabolic tip: mu = 2/sqrt 3 of the slope in contact and falls as v^(-1/2). The "
        "constant level is the slope beside the one node that is left in contact on the grid of the thesis.",
    ),
    Claim("3.2.2", "Region II is a decade wide, and mu doubles in it", run("friction_force"), measures.transition),
    Claim(
        "abstract",
        "The plateau depends only weakly on the force",
        run("friction_force"),
        measures.weak_dependence,
    ),
    Claim(
        "(3.11), (3.13), fig. 3.10",
        "alpha = H/(1+H) for H = 0.2 to 0.8",
        fit("friction_laws", "zone_one"),
        friction("zone_one", "zone_one", constants=("alpha", "beta")),
        "Other limits of the loads change alpha by 0.02 and beta by 0.14. The thesis prints beta in figure 3.10 only.",
    ),
    Claim(
        "(3.12)",
        "At low speed mu follows from contact length and slope in contact",
        fit("friction_laws", "contact_growth"),
        FromFit(
            "friction_laws",
            "contact_growth",
            "zone_one",
            "fitted_law_holds",
            ("mu_over_law", "slope_in_contact"),
            MIDDLE,
            THREE,
            FEW,
        ),
        "The balance of forces is exact (mu_over_law = 1), and the slope in contact is that of the line.",
    ),
    Claim(
        "(3.12)",
        "The contact length is proportional to the load to the power 1/(1+H)",
        fit("friction_laws", "contact_growth"),
        friction("contact_growth", "zone_one", constants=("exponent",)),
        "At H = 0 the logarithm of small contacts bends the law.",
    ),
    Claim(
        "(3.14)", "In full contact mu = 4 eta v L slope^2 / F", run("friction_force"), measures.full_contact, "Exact."
    ),
    Claim(
        "(3.15), fig. 3.11",
        "On the plateau mu = sqrt 2 times the slope in contact",
        fit("friction_laws", "plateau"),
        friction("plateau", "plateau", constants=("plateau_of_contact",)),
        "The lines in contact are steeper than the whole line.",
    ),
    Claim(
        "(3.15), as it holds",
        "On the plateau mu = sqrt 2 times the slope of the whole line",
        fit("friction_laws", "plateau"),
        friction("plateau", "plateau", sentence="line_slope_holds", constants=("plateau",)),
    ),
    Claim(
        "(3.16)",
        "The sqrt 2 is rms over mean of the slopes, and depends only weakly on their distribution",
        PAGE,
        measures.slopes,
        "The ratio is 1.15 to 1.2 for the slopes in contact (plateau_of_contact above), 2/sqrt 3 in region IV.",
    ),
    Claim(
        "(3.17), (3.18), fig. 3.8",
        "One law for regions I to III and both zones",
        fit("friction_force", "interpolation"),
        FromFit("friction_force", "interpolation", constants=("alpha", "beta")),
        "Squares are added, with the slope of the line, H/(1+H) and beta = 1.6; (3.18) is printed without beta.",
    ),
    Claim(
        "(3.20)",
        "F_N = G h L gives the order of magnitude of complete contact",
        run("friction_force"),
        measures.complete_contact,
    ),
    Claim("(3.19)", "At v = 1 all contacts are one-sided", "", "not tested: no output says whether a contact is"),
    Claim(
        "(3.21), reason",
        "Friction falls in region IV because the slope in contact falls",
        fit("friction_laws", "contact_slope"),
        friction("contact_slope", "plateau", sentence="friction_follows", constants=("friction_over_slope", "fall")),
    ),
    Claim(
        "(3.21), formula",
        "The slope in contact follows from its length by the integral of the spectrum",
        fit("friction_laws", "contact_slope"),
        friction("contact_slope", "plateau", constants=("factor",)),
        "The formula averages over the whole line; the last contacts are tips, where the line is flatter.",
    ),
    Claim(
        "3.2.3",
        "The slope in contact is a function of the depth alone",
        run("friction_force"),
        measures.slope_of_depth,
    ),
    Claim(
        "(3.22), (3.23)",
        "Curves at all loads are one curve, shifted by the slope in contact and along the velocity",
        fit("friction_force", "collapse"),
        FromFit("friction_force", "collapse", constants=("rms_before",)),
    ),
    Claim(
        "(3.22), as it holds",
        "Curves at all loads are one curve, shifted freely along both axes",
        fit("friction_force", "collapse"),
        FromFit("friction_force", "collapse", sentence="fitted_law_holds", constants=("rms_error",)),
    ),
    Claim(
        "(3.23)",
        "The shifts along the velocity are those of (3.17)",
        fit("friction_force", "collapse"),
        measures.shifts,
    ),
    Claim(
        "(3.24)-(3.35), (3.37)-(3.39), fig. 3.14",
        "Rough indenters at low speed: mu = sqrt 2 slope xi",
        fit("scirep2014_cone", "indenter"),
        "approximately: within 5 % where the roughness is small beside the depth, up to 100-fold outside (version 0.1)",
        "Steep cones and bodies that barely touch do not follow the law; the figure marks them.",
    ),
    Claim(
        "(3.36), (3.40), fig. 3.15",
        "The exponent 1.5 fits all parameter sets",
        fit("scirep2014_cone", "indenter"),
        FromFit("scirep2014_cone", "indenter", "relaxation", constants=("exponent",)),
        "The exponent rises with H.",
    ),
    Claim(
        "(3.41)-(3.44)",
        "Curves against force at several speeds are pieces of one curve",
        run("force_master_curve"),
        "yes: for a rough sphere, after its own bulk hysteresis is subtracted (master-curves.md)",
    ),
    Claim(
        "(3.45), (3.46), fig. 3.19",
        "The shift is -3 beta / 2 for every decade of velocity; -0.15 gives beta = 0.1",
        run("force_master_curve"),
        "yes: the simulation with beta = 0.1 gives -0.152 (-0.153, -0.151) (evidence/master-curves.md)",
    ),
    Claim(
        "3.3.4",
        "1680 measurements on polyurethane form a master curve",
        "",
        "no data: the measurements are not public; `force_master_curve` is a simulation in their place",
    ),
    Claim(
        "3.3.4",
        "At 40 N the contact is as wide as the layer is thick",
        PAGE,
        measures.layer,
        "By F = (2/3) G D^3/R; the kink at 40 N needs a model of the layer.",
    ),
    Claim(
        "3.3.4",
        "Beyond the kink the stiffness of the layer is k ~ F^(1/2)",
        "",
        "not modelled: layers are not; F ~ d^2 and F^(1/2) belong to a compressible layer, F ~ d^3 and F^(2/3) to an "
        "incompressible bonded one such as rubber",
    ),
    Claim(
        "3.3.4",
        "The rubber warms by 0.06 K at 100 N and 1 cm/s",
        PAGE,
        measures.heating,
        "The printed depth, 0.04 mm, belongs to 1 N.",
    ),
    Claim("3.3.4", "The micro-contacts warm by 0.08 K", PAGE, measures.small_heating),
    Claim(
        "Lee and Radok; u_x = 1.5 mu d",
        "Depth governs contact; the tangential stiffness is 2/3 of the normal one",
        "",
        "not modelled: neither are layers and tangential contact of elastomers",
    ),
)

KINETICS = (
    Claim(
        "(4.1)-(4.4), fig. 4.1, 4.2",
        "mu jumps with the velocity and relaxes to its steady value",
        run("kinetics2014"),
        "yes: the jump and both steady values, each with its error",
        "The rate of the indentation is part of the forces. (4.3) has one minus too many.",
    ),
    Claim(
        "(4.5)-(4.7), fig. 4.3",
        "One exponential fits the relaxation; b = 2.4",
        fit("kinetics2014", "relaxation"),
        FromFit("kinetics2014", "relaxation", "example", "fitted_law_holds", ("rate", "integral_rate")),
        "A straight line through ln(mu - mu_2) gives 2.2 to 3.0.",
    ),
    Claim(
        "(4.8), fig. 4.1",
        "Jumps are proportional to the change of the velocity, from -20 to +30 %",
        fit("kinetics2014", "jump_linearity"),
        FromFit("kinetics2014", "jump_linearity", "jumps", constants=("zeta", "zeta_trend")),
    ),
    Claim(
        "(4.9)",
        "In region I zeta = 1",
        fit("kinetics2014", "jump_law"),
        kinetics("jump_law", sentence="zeta_holds", constants=("zeta",)),
    ),
    Claim(
        "(4.10)",
        "On the plateau the jump is 0.4 of the slope, times dv / v_1",
        fit("kinetics2014", "jump_law"),
        kinetics("jump_law", sentence="plateau_holds", constants=("plateau_jump",)),
        "Printed without dv / v_1 and with mu_1 in place of 1: a misprint, since (4.11) has this limit.",
    ),
    Claim(
        "(4.11), fig. 4.5",
        "The jump follows one law with the constant 0.4",
        fit("kinetics2014", "jump_law"),
        kinetics("jump_law", constants=("constant",)),
        "With 0.4 the knee is 20 to 29 % too low at mu_1 = 0.5 to 0.8 of the slope.",
    ),
    Claim(
        "fig. 4.4",
        "The same law at all loads",
        fit("kinetics2014", "jump_law"),
        FromFit("kinetics2014", "jump_law", "force_velocity", constants=("constant",), replaced=LOADS),
    ),
    Claim(
        "(4.12), fig. 4.6",
        "Below v_1 tau q_max = 1 the rate b is proportional to v_1",
        fit("kinetics2014", "rate_power"),
        kinetics("rate_power", constants=("power",), within={"regime": "below"}),
        "b hardly depends on the velocity there, so D_c is no length.",
    ),
    Claim(
        "(4.12), fig. 4.6, 4.7",
        "Above it b is proportional to v_1^(1 - H)",
        fit("kinetics2014", "rate_power"),
        kinetics("rate_power", constants=("power",), within={"regime": "above"}),
        "Figure 4.6 ends at v_1 = 0.1 m/s; rates above 0.5 m/s are hardly known.",
    ),
    Claim(
        "(4.13)-(4.15)",
        "Closed law of mu(t) after the jump",
        fit("kinetics2014", "relaxation"),
        kinetics("relaxation", constants=(), within={"hurst": [0.3, 0.7]}),
        "It inherits the errors of (4.11) and (4.12).",
    ),
)

LUBRICATION = (
    Claim(
        "fig. 1.2",
        "A Stribeck curve: boundary friction, a minimum, a rise",
        run("stribeck"),
        measures.stribeck,
        "At 800 N friction comes within 5 % of boundary friction below 1e-4 rpm only.",
    ),
    Claim(
        "(5.1)",
        "Resistance of the contact",
        run("rolling2013_trace"),
        "yes: an output, for all squares side by side on the width",
    ),
    Claim(
        "5.3",
        "A resistance below 100 ohm means contact",
        PAGE,
        "yes: 100 ohm belong to 2 nm of contact (rho = 0.2 uohm m), so any contact is below",
    ),
    Claim(
        "(5.2), (5.3), (B.21)-(B.24)",
        "Pan and Hamrock's formulas give the film",
        fit("ehl_map", "film_exponents"),
        FromFit("ehl_map", "film_exponents", "barus", constants=("central_load", "central_speed", "central_material")),
        "E' = 2E* and the mean velocity (the text decides both); 2.929 and 2.992 are misprints of 2.922.",
    ),
    Claim(
        "(B.22)",
        "Factor 1.806 of the formula with units",
        PAGE,
        measures.unit_dependent,
        "It contains E'^0.002, so it depends on the units of E'.",
    ),
    Claim(
        "(5.4)-(5.6), fig. 5.5",
        "A boundary layer breaks where h_l < h_c",
        run("rolling2013_trace"),
        "yes: found in one pass around the roller; only tau0/(E* h_c) matters",
    ),
    Claim(
        "fig. 5.7a",
        "Contact switches on and off often at 800 N, 100 rpm, 40 degC",
        run("rolling2013"),
        measures.switching,
        "One line stands for the whole width in the thesis. By the load sharing a line stands for a square of its "
        "length, and a width of 10 mm holds 24 of them (`rig_probability`). Rougher rollers or a thinner film "
        "would give more.",
    ),
    Claim(
        "fig. 5.9a",
        "Breakthrough rises with temperature and load and falls with speed: 125 cases",
        run("rolling2013"),
        measures.trends,
    ),
    Claim(
        "fig. 5.7b, 5.8, 5.9b, 5.10", "Measurements on a twin-disc rig", "", "no data: the measurements are not public"
    ),
    Claim(
        "table A.1, (B.5)",
        "Mobilgear SHC XMP 320: viscosity against temperature",
        "mdr-dask models mixed_lubrication",
        "approximately: the exponential (B.5) is up to 18 % off ASTM D341, which is used",
        "The pressure-viscosity coefficient is not in the thesis.",
    ),
    Claim(
        "(B.1)-(B.3), (B.7)-(B.16)",
        "Reynolds' equation and the deformation of a line contact",
        "pytest tests/physics/lubrication",
        "yes: with the mean velocity in (B.1), which the factor 3 pi^2 / 4 of (B.15) needs; the thesis says the sum",
        "(B.8) with -2 / (pi E) ln (x - s)^2 is right for E = E' = 2E*.",
    ),
    Claim(
        "(B.20)",
        "Weights of the discretised deformation",
        "pytest tests/physics/lubrication",
        "no: printed without 1/pi; only 1/pi flattens Hertz's pressure",
    ),
    Claim("(B.6)", "Pressure raises the density by 33 % at most", PAGE, measures.density, "The law tends to 0.6/1.7."),
    Claim(
        "fig. B.3",
        "The smallest film is 75 % of the central one",
        run("ehl_map"),
        measures.film_ratio,
        "0.75 to 0.77 for an incompressible oil; its density law raises it.",
    ),
    Claim("B", "Newton's iteration is difficult to converge", "", "not tested: no program of that time is at hand"),
)

WEAR = (
    Claim(
        "(6.1)-(6.7)",
        "Stick radius and slip of an oscillating contact",
        run("fretting2014"),
        "yes: closed forms of Cattaneo and Mindlin",
        "E* and G* are given: elastic similarity is an assumption of the user.",
    ),
    Claim(
        "(6.8)-(6.10), fig. 6.1",
        "The limiting shape of fretting wear",
        run("fretting2014"),
        "yes: the exact evolution ends there",
        "The labels N of the figures are 8 to 9 times too large.",
    ),
    Claim(
        "(6.11), xi = 0.8",
        "0.8 is the best factor of the fast rule",
        "",
        "yes: with the current contact radius for the a of (6.11), 0.8 is within 1 % of the least rms error of the "
        "profile (best 0.85 for the parabola, 0.80 for the cone; two independent studies)",
        "The printed a has no argument. With a(c) of the limiting shape, as in the code, the best factor is 0.95 for "
        "the parabola and 1 for the cone.",
    ),
    Claim(
        "(6.11)-(6.15)",
        "The fast rule meets exact profiles for any number of cycles",
        "python docs/examples/fast_rule.py results/fast_wear_error.zarr",
        measures.fast_rule,
    ),
    Claim(
        "6.4.2, 6.5",
        "The fast rule is 600 times faster",
        "python -m benchmarks accuracy wear",
        "approximately: 8 times at 100 nodes, 570 at 1600 (an independent study)",
        "It depends on the grid; error against time is the fair figure.",
    ),
    Claim("(6.16)", "a(c) of the parabola, in closed form", PAGE, measures.limiting_radius),
    Claim("(6.17), fig. 6.3", "The same for a cone", run("fretting2014"), "yes: exact in closed form"),
    Claim(
        "fig. 6.2",
        "c = 0.455 belongs to the amplitudes of its panels",
        PAGE,
        "no: by (6.7) c = 0.455 gives 0.605 and 0.220, the panels say 0.652 and 0.41, which belong to c = 0.55",
    ),
    Claim(
        "6.5",
        "A contact and wear interface for dynamic programs",
        "mdr-dask law results/friction_force.zarr friction_coefficient -o mu.nc",
        "approximately: for steady friction, `mdr_dask.Law` of such a table can be called by any integrator (law.md)",
        "Wear has none.",
    ),
    Claim("ch. 6", "Tangential force and energy of a cycle", "", "not modelled: fretting loops are no output"),
    Claim(
        "abstract",
        "The method is orders of magnitude faster than finite or boundary elements",
        "python -m benchmarks peers contact",
        "yes: for bodies of revolution, where both give the same numbers (comparison.md)",
    ),
    Claim("7.2", "Prony series", run("measured_polymer"), "yes: as a material"),
    Claim("7.2", "Heating", "", "not modelled: no temperature field"),
    Claim("7.2", "Gross slip", run("gross_slip"), "yes: as a campaign"),
)

CHAPTERS: tuple[tuple[str, tuple[Claim, ...]], ...] = (
    ("Chapters 1 and 2: the method, rough lines", METHOD),
    ("Chapter 3: the law of friction", STEADY),
    ("Chapter 4: kinetics", KINETICS),
    ("Chapter 5, appendices A and B: lubrication", LUBRICATION),
    ("Chapters 6 and 7: wear, and what was left to do", WEAR),
)
