"""Table of the equations of the thesis: place in the code, and check."""

from __future__ import annotations

from benchmarks.thesis.ledger import row

#: Equation, place in the code, check. For damaged or wrong printed equations, the form that was used is given.
EQUATIONS = (
    ("(2.1), (2.2)", "parameters E*, G*", "Mindlin's 8 G* a"),
    ("(2.3), (3.1)-(3.5)", "physics/solids.py", "creep and relaxation in closed form"),
    ("(2.4), (2.5), (2.11)", "physics/mdr/transforms.py", "power laws in closed form; there and back"),
    ("(2.6)-(2.10)", "physics/mdr/power_law_contact.py", "Hertz and Sneddon"),
    ("(2.12), (2.21), (2.23)", "physics/surfaces", "measured maps against a second program"),
    ("(2.13)-(2.19), (2.22), (2.24)", "physics/surfaces/roughness.py", "rms height and slope to rounding"),
    ("(2.20)", "physics/surfaces/roughness.py", "quadrature of both spectra"),
    ("(2.25)-(2.27)", "benchmarks/thesis/measures.py", "(2.25): order of the limits reversed in print"),
    ("(3.6)-(3.10), (3.24)-(3.30)", "physics/sliding", "energy, v -> 0, long time stepping; motion as in (3.28)"),
    ("(3.11), (3.13)", "physics/sliding/laws.py: zone_one, alpha", "fit `zone_one`"),
    ("(3.12)", "fits/scaling.py", "fit `contact_growth`: exact at low speed"),
    ("(3.14)", "physics/sliding/laws.py: full_contact", "exact, to rounding"),
    ("(3.15), (3.16)", "fits/friction.py: plateau", "fit `plateau`, with both slopes"),
    (
        "(3.17), (3.18)",
        "physics/sliding/laws.py: interpolation",
        "squares: seven and four digits 2 survive in the print",
    ),
    ("(3.19), (3.20)", "physics/sliding/laws.py: velocity_number, force_number", "exact similarity of the solver"),
    ("(3.21)", "fits/scaling.py: contact_slope_law", "sum over waves; fit `contact_slope`"),
    ("(3.22), (3.23)", "fits/scaling.py: collapse", "fit `collapse`"),
    ("(3.31)-(3.34), (3.37)-(3.39)", "physics/sliding/laws.py: indenter_low", "rebuilt from surviving digits; limits"),
    ("(3.40), (3.43)", "physics/sliding/laws.py: indenter", "fit `indenter`"),
    ("(3.41), (3.42)", "physics/sliding/laws.py: indenter_low", "lost in print; from the prose"),
    ("(3.44)-(3.46)", "physics/superposition", "simulated rough sphere: slope -0.152 for -0.15"),
    ("(4.1)-(4.4)", "physics/transients", "closed forms; long time stepping; (4.3) has one minus too many"),
    ("(4.5)-(4.7)", "fits/relaxation.py", "planted exponentials"),
    ("(4.8), (4.9)", "fits/jumps.py", "fits `jump_linearity`, `jump_law`"),
    ("(4.10), (4.11)", "fits/jumps.py: jump_law", "(4.10) is misprinted: limit of (4.11) is 0.4 dv / v_1"),
    ("(4.12)", "fits/relaxation.py: law_rate", "factor 1 by (4.13) and (4.15); fit `rate_power`"),
    ("(4.13)-(4.15)", "fits/relaxation.py: relaxation_law", "fit `relaxation`; (4.14) is lost in print"),
    ("(5.1)", "models/mixed_lubrication", "Holm's constriction: 1/R = L_cont / rho"),
    ("(5.2)", "physics/lubrication/film_formulas.py: hertz_line", "Hertz"),
    (
        "(5.3), (B.21)-(B.24)",
        "physics/lubrication/film_formulas.py",
        "source formulas; three pairs of brackets: E' = 2E*",
    ),
    ("(5.4)-(5.6)", "physics/lubrication", "integral of 2 tau0 (R - r) / h"),
    ("(6.1), (6.2), (6.12)-(6.15)", "physics/wear", "volume and energy balance"),
    ("(6.3)-(6.7)", "physics/wear", "Cattaneo and Mindlin"),
    ("(6.8)-(6.10)", "physics/wear", "transform of the limiting line; (6.9) half lost"),
    ("(6.11)", "physics/wear", "the bare a is read as a(c); with the current radius xi = 0.8 is best"),
    ("(6.16), (6.17)", "physics/wear", "balance of volume; (6.17) exact"),
    ("table A.1, (B.5), (B.6), (B.17), (B.18)", "physics/lubrication/oil.py", "ASTM D341; Dowson and Higginson"),
    ("(B.1)-(B.4), (B.7)-(B.16)", "physics/lubrication", "Hertz limit; mean velocity, E' = 2E*"),
    ("(B.19), (B.20)", "physics/lubrication/deformation.py", "flat under Hertz's pressure only with 1/pi"),
)


def table() -> str:
    """Return the table as Markdown."""
    rows = [row((equation, f"`{place}`", check)) for equation, place, check in EQUATIONS]
    return "\n".join(
        ["## Equations, their place and their check", "", "| equation | place | check |", "|---|---|---|", *rows, ""]
    )
