"""Chapters 6 and 7.2 of the thesis: fretting wear, and what was left to do."""

from __future__ import annotations

import numpy as np

from benchmarks.thesis.ledger import Claim, Found, Studies, Verdict, judged, told

RUN, PLOT = "mdr-dask run campaigns/{}.yaml", "mdr-dask plot results/{}.zarr {}"


def _limit(c: float) -> float:
    """Return the limiting radius of the parabola by the exact equation of its volume."""
    from scipy.optimize import brentq

    def balance(a: float) -> float:
        return (a * a / 2 - 1) * np.arccos(c / a) + c / 2 * np.sqrt(a * a - c * c)

    return float(brentq(balance, 1.0001, 2.0))


def _printed(_: Studies) -> Found:
    """Compare the printed (6.16), a = sqrt(2 + c^2/4) - c/2, with the exact equation."""
    cs = np.linspace(0.05, 0.95, 19)
    exact = np.array([_limit(c) for c in cs])
    printed = np.sqrt(2 + cs**2 / 4) - cs / 2
    miss = float(np.max(np.abs(printed / exact - 1)))
    return judged(f"up to {100 * miss:.1f} % off", miss, 1e-3, 0.2)


def _fast_error(studies: Studies) -> Found:
    """Give the largest error of the fast rule with xi = 0.8 over stick radius and cycles."""
    groups = studies("fast_wear_error")
    exact, fast = groups["exact"].worn_profile, groups["fast"].worn_profile
    at = fast.sel(xi=0.8, method="nearest")
    miss = float(abs(at - exact).max())
    best = abs(fast - exact).mean(list(exact.dims)).idxmin("xi")
    return judged(f"up to {miss:.2f} d0; least on average at xi = {float(best):.2f}", miss, 0.03, 0.1)


CLAIMS = (
    Claim(
        "(6.1)-(6.7)",
        "Stick radius and slip of an oscillating contact",
        RUN.format("fretting2014"),
        told(Verdict.HOLDS, "closed forms of Cattaneo and Mindlin"),
        "E* and G* are given: elastic similarity is the user's.",
    ),
    Claim(
        "(6.8)-(6.10), fig. 6.1",
        "The limiting shape of fretting wear",
        RUN.format("fretting2014"),
        told(Verdict.HOLDS, "exact evolution ends there"),
        "The labels N of the figures are 8 to 9 times too large.",
    ),
    Claim(
        "(6.11)-(6.15), xi = 0.8",
        "The fast rule meets exact profiles for any number of cycles",
        PLOT.format("fast_wear_error", "fast_wear_error"),
        _fast_error,
        "Its error is that of its own equation; the best xi is 0.9 to 1.",
    ),
    Claim(
        "6.4.2, 6.5",
        "The fast rule is 600 times faster",
        "python -m benchmarks accuracy measure wear",
        told(Verdict.WITHIN, "8 times at 100 nodes, 570 at 1600 (an independent study)"),
        "It depends on the grid; error against time is the fair figure.",
    ),
    Claim(
        "(6.16)",
        "a(c) of the parabola, in closed form",
        "python -m benchmarks thesis page",
        _printed,
        "An approximation; the exact equation is solved here.",
    ),
    Claim(
        "(6.17), fig. 6.3",
        "The same for a cone",
        RUN.format("fretting2014"),
        told(Verdict.HOLDS, "exact in closed form"),
        "",
    ),
    Claim(
        "fig. 6.2",
        "c = 0.455 belongs to the amplitudes of its panels",
        "python -m benchmarks thesis page",
        told(Verdict.FAILS, "0.455 disagrees with its own 0.652 and 0.41 by (6.7)"),
        "0.55, of figure 6.1, fits them.",
    ),
    Claim(
        "6.5",
        "A contact and wear interface for dynamic programs",
        "",
        told(Verdict.NOT_MODELLED),
        "The rules are functions of Python; there is no interface to a dynamic program.",
    ),
    Claim(
        "ch. 6",
        "Tangential force and energy of a cycle",
        "",
        told(Verdict.NOT_MODELLED),
        "Energy is a check inside the solver; fretting loops are no output.",
    ),
    Claim("7.2", "Prony series", RUN.format("measured_polymer"), told(Verdict.HOLDS), ""),
    Claim("7.2", "Heating", "", told(Verdict.NOT_MODELLED), ""),
    Claim("7.2", "Gross slip", RUN.format("gross_slip"), told(Verdict.HOLDS), ""),
)
