"""Chapter 4 of the thesis: friction after a jump of the velocity."""

from __future__ import annotations

import numpy as np

from benchmarks.thesis.ledger import Claim, Found, Studies, Verdict, interval, judged, told

RUN, FIT = "mdr-dask run campaigns/kinetics2014.yaml", "mdr-dask fit results/kinetics2014.zarr {}"
#: A few speeds and Hurst exponents of the thesis's series.
FEW = {"series_velocity": "{velocity: {geometric: [10 um/s, 10 m/s, 15]}, hurst: [0, 0.3, 0.7, 1]}"}


def _law(name: str):
    """Return the results of a fit to a few speeds and Hurst exponents."""

    def fitted(studies: Studies):
        return next(iter(studies.fit("kinetics2014", name, ("velocity",), **FEW).values()))

    return fitted


def _region_one(studies: Studies) -> Found:
    zeta = _law("jump_limits")(studies).sel(limit="region I")
    miss = float(abs(zeta.found - 1).max())
    return judged(f"zeta = {interval(zeta.sel(hurst='all'), 'found')}", miss, 0.03, 0.2)


def _plateau(studies: Studies) -> Found:
    jump = _law("jump_limits")(studies).sel(limit="plateau")
    miss = float(abs(jump.found.sel(hurst="all") - 0.4))
    return judged(interval(jump.sel(hurst="all"), "found", 2), miss, 0.04, 0.15)


def _jump_law(studies: Studies) -> Found:
    fitted = _law("jump_law")(studies).sel(hurst="all")
    deviation = 100 * float(fitted.deviation_of_thesis)
    figure = f"constant {interval(fitted, 'constant')}; with 0.4 the law is {deviation:.0f} % off, rms"
    return judged(figure, deviation / 100, 0.03, 0.25)


def _one_exponential(studies: Studies) -> Found:
    """Fit one exponential to the case of figure 4.3."""
    fitted = next(iter(studies.fit("kinetics2014", "relaxation", ("example",), points="5000").values())).squeeze()
    return judged(f"b = {interval(fitted, 'rate', 2)} by least squares", abs(float(fitted.rate) / 2.4 - 1), 0.02, 1.0)


def _linear(studies: Studies) -> Found:
    """Test whether jumps from -20 to +30 % are proportional to the change of the velocity."""
    fitted = next(iter(studies.fit("kinetics2014", "jump_linearity", ("jumps",)).values()))
    rms = float(fitted.rms_error)
    return judged(f"departs by {100 * rms:.1f} % rms over -20 to +30 %", rms, 0.02, 0.2)


def _courses(studies: Studies) -> Found:
    """Compare the closed courses with the traces, over the height of the jump."""
    fitted = _law("relaxation_course")(studies)
    error = fitted.rms_error.to_numpy()
    error = error[np.isfinite(error)]
    figure = f"{100 * np.median(error):.1f} % of the jump in the median, {100 * error.max():.0f} % at most"
    return judged(figure, float(np.median(error)), 0.005, 0.3)


def _rate(regime: str):
    """Return the judge of the power of b on one side of v_1 tau q_max = 1."""

    def judge(studies: Studies) -> Found:
        fitted = _law("rate_power")(studies).sel(regime=regime).dropna("hurst", subset=["power"])
        miss = float(abs(fitted.power - fitted.law_power).max())
        powers = [f"{float(fitted.power.sel(hurst=h)):.2f} at H = {h:g}" for h in fitted.hurst.to_numpy()]
        return judged("a = " + ", ".join(powers), miss, 0.02, 0.35)

    return judge


CLAIMS = (
    Claim(
        "(4.1)-(4.4), fig. 4.1, 4.2",
        "mu jumps with the velocity and relaxes to its steady value",
        RUN,
        told(Verdict.HOLDS, "the jump and the steady ends each with its error"),
        "The rate of the indentation, which the thesis's scheme carries along, is part of the forces.",
    ),
    Claim(
        "(4.5)-(4.7), fig. 4.3",
        "One exponential fits the relaxation; b = 2.4",
        FIT.format("relaxation"),
        _one_exponential,
        "A line through ln(mu - mu_2) gives 2.2 to 3.0; the relaxation begins as no exponential.",
    ),
    Claim(
        "(4.8), fig. 4.1",
        "Jumps are proportional to the change of the velocity",
        FIT.format("jump_linearity"),
        _linear,
        "They are for small changes; larger ones bend.",
    ),
    Claim("(4.8), (4.9)", "In region I zeta = xi = 1", FIT.format("jump_limits"), _region_one, ""),
    Claim("(4.10)", "On the plateau the jump is 0.4 of the slope", FIT.format("jump_limits"), _plateau, ""),
    Claim(
        "(4.11), fig. 4.5",
        "The jump follows one law with the constant 0.4",
        FIT.format("jump_law"),
        _jump_law,
        "With 0.4 the knee is 20 to 29 % too low at mu_1 = 0.5 to 0.8 of the slope.",
    ),
    Claim(
        "(4.12), fig. 4.6",
        "Below v_1 tau q_max = 1 the rate b goes with v_1",
        FIT.format("rate_power"),
        _rate("below"),
        "b hardly depends on the velocity there, so D_c is no length.",
    ),
    Claim(
        "(4.12), fig. 4.6, 4.7",
        "Above it b goes with v_1^(1 - H)",
        FIT.format("rate_power"),
        _rate("above"),
        "",
    ),
    Claim(
        "(4.13)-(4.15)",
        "Closed courses of mu after the jump",
        FIT.format("relaxation_course"),
        _courses,
        "They put (4.11) and (4.12) together and inherit what these miss.",
    ),
)
