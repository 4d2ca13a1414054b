"""Chapter 5 and the appendices of the thesis: films between rollers and mixed lubrication."""

from __future__ import annotations

import numpy as np

from benchmarks.thesis.ledger import Claim, Found, Studies, Verdict, judged, told
from mdr_dask.physics.lubrication import oil

RUN = "mdr-dask run campaigns/{}.yaml"


def _trends(studies: Studies) -> Found:
    """Count pairs of neighbours among the operation cases whose probability moves as the thesis says."""
    probability = studies("rolling2013", ("operation",))["operation"].breakthrough_probability.mean("realisation")
    right, pairs = 0, 0
    for dim, sign in (("temperature", 1), ("normal_force", 1), ("rotation_speed", -1)):
        steps = sign * probability.diff(dim)
        wide = abs(steps) > 0.02
        right += int(((steps > 0) & wide).sum())
        pairs += int(wide.sum())
    figure = f"{right} of {pairs} pairs of neighbours that differ by more than 0.02"
    return judged(figure, 1 - right / max(pairs, 1), 0.0, 0.1)


def _thesis_point(studies: Studies) -> Found:
    """Give the probability at 800 N, 100 rpm and 40 degC."""
    operation = studies("rolling2013", ("operation",))["operation"]
    value = operation.breakthrough_probability.sel(normal_force=800, method="nearest").mean("realisation")
    rpm = 100 * 2 * np.pi / 60
    percent = 100 * float(value.sel(rotation_speed=rpm, temperature=313.15, method="nearest"))
    return Found(f"P = {percent:.1f} %", Verdict.FAILS if percent < 2 else Verdict.HOLDS)


def _formula(studies: Studies) -> Found:
    """Compare solved films with Pan and Hamrock's formula."""
    films = studies("ehl_map", ("barus",))["barus"]
    ratio = (films.central_film / films.formula_central_film).to_numpy()
    low, high = 100 * (ratio.min() - 1), 100 * (ratio.max() - 1)
    return judged(f"{low:+.0f} to {high:+.0f} % (Barus)", max(abs(low), abs(high)) / 100, 0.03, 0.35)


def _constriction(studies: Studies) -> Found:
    films = studies("ehl_map", ("barus",))["barus"]
    ratio = (films.minimum_film / films.central_film).to_numpy()
    return judged(f"{100 * ratio.min():.0f} to {100 * ratio.max():.0f} %", abs(ratio.min() - 0.75), 0.02, 0.2)


def _density(_: Studies) -> Found:
    most = oil.DENSITY_RISE / oil.DENSITY_SATURATION
    return Found(f"{100 * most:.1f} %", Verdict.FAILS if abs(most - 0.33) > 0.01 else Verdict.HOLDS)


def _criterion(_: Studies) -> Found:
    """Width of steel contact that has 100 ohm: l = rho / R."""
    width = 0.2e-6 / 100
    return Found(f"{1e9 * width:.0f} nm of contact (rho = 0.2 uohm m)", Verdict.WITHIN)


def _stribeck(studies: Studies) -> Found:
    """Compare friction at the slowest speed with boundary friction."""
    friction = studies("stribeck", (), rotation_speed="{geometric: [0.001 rpm, 1000 rpm, 13]}")[""].friction_coefficient
    mean = friction.mean("realisation")
    slow, least = float(mean.isel(rotation_speed=0).max()), float(mean.min())
    return judged(f"mu = {slow:.3f} at 0.001 rpm (boundary 0.1), least {least:.4f}", abs(slow / 0.1 - 1), 0.05, 0.2)


CLAIMS = (
    Claim(
        "fig. 1.2",
        "A Stribeck curve: boundary friction, a minimum, a rise",
        RUN.format("stribeck"),
        _stribeck,
        "Asperities and film share the load; at 800 N friction comes within 5 % below 1e-4 rpm only.",
    ),
    Claim("(5.1)", "Resistance of the contact", RUN.format("rolling2013_trace"), told(Verdict.HOLDS, "an output"), ""),
    Claim(
        "5.3",
        "A resistance below 100 ohm means contact",
        "python -m benchmarks thesis page",
        _criterion,
        "So small a contact is any contact at all.",
    ),
    Claim(
        "(5.2), (5.3), B.3",
        "Pan and Hamrock's formulas give the film",
        RUN.format("ehl_map"),
        _formula,
        "2.929 and 2.992 are misprints of 2.922; the formula is a regression of its own.",
    ),
    Claim(
        "(5.4)-(5.6), fig. 5.5",
        "A boundary layer breaks where h_l < h_c",
        RUN.format("rolling2013_trace"),
        told(Verdict.HOLDS, "found in one pass around the roller"),
        "Only tau0/(E* h_c) matters.",
    ),
    Claim(
        "fig. 5.7a",
        "Contact switches on and off often at 800 N, 100 rpm, 40 degC",
        RUN.format("rolling2013"),
        _thesis_point,
        "It would need rollers twice as rough, or a thinner film.",
    ),
    Claim(
        "fig. 5.9a",
        "Breakthrough rises with temperature and load and falls with speed: 125 cases",
        RUN.format("rolling2013"),
        _trends,
        "",
    ),
    Claim(
        "fig. 5.7b, 5.8, 5.9b, 5.10",
        "Measurements on a twin-disc rig",
        "",
        told(Verdict.NO_DATA),
        "Not public.",
    ),
    Claim(
        "(A.1), table A.1, (B.5)",
        "Mobilgear SHC XMP 320: viscosity over temperature",
        "mdr-dask models mixed_lubrication",
        told(Verdict.WITHIN, "ASTM D341 in place of the exponential, which is up to 18 % off"),
        "The pressure-viscosity coefficient is not in the thesis.",
    ),
    Claim(
        "(B.6)",
        "Pressure raises the density by 33 % at most",
        "python -m benchmarks thesis page",
        _density,
        "The law tends to 0.6/1.7.",
    ),
    Claim(
        "fig. B.3",
        "The least film is 75 % of the central one",
        RUN.format("ehl_map"),
        _constriction,
        "0.75 to 0.77 for an incompressible oil; its density law raises it.",
    ),
)
