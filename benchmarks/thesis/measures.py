"""Tests of claims of the thesis that are not tested by a fit."""

from __future__ import annotations

import numpy as np
import xarray as xr
from scipy.optimize import brentq, isotonic_regression

from benchmarks.thesis.ledger import Judge, Studies, compared
from mdr_dask.fits import available
from mdr_dask.fits.base import law_holds
from mdr_dask.physics.lubrication import oil
from mdr_dask.physics.mdr import power_law_contact as contact
from mdr_dask.physics.mdr.half_integrals import graded_panels
from mdr_dask.physics.mdr.transforms import forward_transform, power_factor
from mdr_dask.physics.sliding import laws
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.waves import Waves

MODES, HURSTS = 2500, (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)


def transforms(_: Studies) -> str:
    """Transform a body with a bend to its line and back."""
    panels = graded_panels(30, 1, 12)
    radius, outer = np.sqrt(panels.nodes), panels.nodes > 0.05**2
    image = forward_transform(lambda r: 2 * r + 1.05 * r**2.5, radius).value
    exact = power_factor(2.0) * radius**2 + 0.3 * power_factor(3.5) * radius**3.5
    back = panels.full @ exact
    error = max(np.max(np.abs(image / exact - 1)), np.max(np.abs(back / (radius**2 + 0.3 * radius**3.5) - 1)[outer]))
    return compared(f"largest relative error {error:.0e}", error)


def hertz(_: Studies) -> str:
    """Compare Hertz's law for a sphere, F = 4/3 E* R^(1/2) d^(3/2), with the line of the method."""
    E_star, R, depth = 1e9, 0.02, 1e-5
    radius = contact.contact_radius(depth, 1 / (2 * R), 2.0)
    force = contact.normal_force(radius, 1 / (2 * R), 2.0, E_star)
    return compared("force of Hertz's sphere", float(force / (4 / 3 * E_star * np.sqrt(R) * depth**1.5)) - 1)


def lines(_: Studies) -> str:
    """Compare rms height and slope of generated lines with their spectra."""
    departures = []
    for hurst in HURSTS:
        amplitude = roughness.amplitudes(MODES, hurst)
        phase = roughness.phases(1, 0, MODES)
        waves = Waves(0.5 * amplitude * np.exp(1j * phase), 2 * MODES)
        departures += [
            waves.heights(4 * MODES).std() - 1,
            waves.slopes(4 * MODES).std() / roughness.spectral_slope(amplitude) - 1,
        ]
    return compared("rms height and slope, H = 0 to 1", *departures)


def integral(power: int, limits: str) -> Judge:
    """Return a function that compares an integral of the spectrum with the sum over 2500 harmonics."""

    def judge(_: Studies) -> str:
        k, departures = np.arange(1, MODES + 1.0), {}
        for hurst in (0.3, 0.5, 0.7, 0.9):
            exponent = power - 2 * hurst
            full = (MODES**exponent - 1) / exponent
            short = MODES**exponent / exponent if exponent > 0 else -1 / exponent
            value = full if limits == "both" else short
            departures[hurst] = float(np.sqrt(value / np.sum(k ** (exponent - 1))) - 1)
        figure = ", ".join(f"{100 * each:+.1f} % at H = {hurst:g}" for hurst, each in departures.items())
        return compared(figure, *departures.values())

    return judge


def rule(_: Studies) -> str:
    """Compare rms height and gradient of a surface with spectrum C2D and of the line pi q C2D, by quadrature."""
    q, departures = np.geomspace(1.0, 1e3, 20001), []
    for hurst in (0.3, 0.7):
        surface, line = q ** (-2 - 2 * hurst), np.pi * q * q ** (-2 - 2 * hurst)
        for order in (0, 2):
            of_surface = 2 * np.pi * np.trapezoid(q ** (1 + order) * surface, q)
            departures.append(2 * np.trapezoid(q**order * line, q) / of_surface - 1)
    return compared("rms height and full gradient", *departures)


def _numbers(dataset: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
    """Return the mean of mu over slope, the force number and the velocity number."""
    mean = dataset[["friction_coefficient", "rms_slope"]].mean("realisation")
    force = laws.force_number(dataset.normal_force, dataset.shear_modulus, dataset.rms_roughness, dataset.length)
    velocity = laws.velocity_number(dataset.velocity, dataset.relaxation_time, mean.rms_slope, dataset.rms_roughness)
    return mean.friction_coefficient / mean.rms_slope, force, velocity


def slope_squared(studies: Studies) -> str:
    """Vary the slope only by the shortest wave, in region I of zone 1, and fit the power of friction."""
    points = "[2000, 3240, 5184, 8640, 13824]" if studies.points is None else "[500, 800, 1250, 2000]"
    text = {"points": points, "velocity": "1 um/s", "hurst": "0.7", "normal_force": "30 mN"}
    mean = studies("friction_force", **text)[""].mean("realisation")
    slope, mu = np.log(mean.rms_slope.to_numpy()), np.log(mean.friction_coefficient.to_numpy())
    rest = mu - 2 * slope
    return compared(f"mu ~ slope^{np.polyfit(slope, mu, 1)[0]:.2f}", *(rest - rest.mean()))


def force_over_modulus(studies: Studies) -> str:
    """Compare two rubbers under loads with the same ratio to their moduli."""
    soft = studies("quickstart", shear_modulus="1 MPa", normal_force="[1 mN]")[""]
    hard = studies("quickstart", shear_modulus="100 MPa", normal_force="[100 mN]")[""]
    ratio = hard.friction_coefficient.values / soft.friction_coefficient.values
    return compared("G = 1 and 100 MPa", *np.ravel(ratio - 1))


def regions(studies: Studies) -> str:
    """Find region I, the plateau and its decay at a light load."""
    mu, _, velocity = _numbers(studies("friction_force")[""])
    light = mu.isel(normal_force=4)
    speed = np.log(velocity.isel(normal_force=4, velocity=slice(3)).to_numpy())
    start = np.polyfit(speed, np.log(light.isel(velocity=slice(3)).to_numpy()), 1)[0]
    figure = f"mu ~ v^{start:.2f} at first, largest mu/slope {float(light.max()):.2f}, at last {float(light[-1]):.2f}"
    return compared(figure, start - 1)


def last_level(studies: Studies) -> str:
    """Compute mu at one light load up to 1000 km/s; the claim is that it no longer changes."""
    text = {"normal_force": "10 mN", "velocity": "[10 km/s, 100 km/s, 1e6 m/s]"}
    mean = studies("friction_force", **text)[""].mean("realisation")
    mu = mean.friction_coefficient.squeeze().to_numpy()
    power = np.polyfit(np.log(mean.velocity.to_numpy()), np.log(mu), 1)[0]
    ratio = float((mean.friction_coefficient / mean.contact_slope).squeeze()[-1])
    return compared(
        f"mu ~ v^{power:.2f} up to 1000 km/s, and {ratio:.3f} times the slope in contact", *(mu / mu[0] - 1)
    )


def transition(studies: Studies) -> str:
    """Measure region II, from where mu is 90 % of the law of region I to where it is 90 % of the plateau."""
    mu, _, velocity = _numbers(studies("friction_force")[""])
    heavy, speed = (x.sel(normal_force=1.5, method="nearest").to_numpy() for x in (mu, np.log10(velocity)))
    below_line = heavy[0] * 10 ** (speed - speed[0]) / heavy
    begins = np.interp(1 / 0.9, np.maximum.accumulate(below_line), speed)
    ends = np.interp(0.9 * heavy.max(), np.maximum.accumulate(heavy), speed)
    rise = 0.9 * heavy.max() / np.interp(begins, speed, heavy)
    return compared(f"{ends - begins:.1f} decades, mu rises {rise:.1f}-fold", ends - begins - 1, rise / 2 - 1)


def weak_dependence(studies: Studies) -> str:
    """Compare the largest friction at all loads above F = 0.1."""
    mu, force, _ = _numbers(studies("friction_force")[""])
    top = mu.max("velocity").where(force > 0.1, drop=True).to_numpy()
    return compared(f"largest mu/slope {top.min():.2f} to {top.max():.2f}, F = 0.1 to 1000", *(top / top.mean() - 1))


def complete_contact(studies: Studies) -> str:
    """Find the force of complete contact at rest; the claim is F = G h L in order of magnitude."""
    data = studies("friction_force")[""]
    _, force, _ = _numbers(data)
    fraction = data.contact_fraction.mean("realisation").isel(velocity=0).to_numpy()
    force = force.to_numpy()
    one, whole = np.interp(0, np.log(force), fraction), np.interp(0.995, fraction, force)
    figure = f"L_cont = {one:.2f} L at F = 1; complete contact at F = {whole:.1f}"
    return f"{'approximately' if 0.1 < whole < 30 else 'no'}: the order of magnitude; {figure}"


def slope_of_depth(studies: Studies) -> str:
    """Fit a rising curve to the slope in contact of all loads and speeds against the depth alone."""
    mean = studies("friction_force")[""].mean("realisation")
    depth = (mean.indentation_depth / mean.rms_roughness).to_numpy().ravel()
    slope = np.log((mean.contact_slope / mean.rms_slope).to_numpy().ravel())
    known = np.flatnonzero(np.isfinite(slope) & np.isfinite(depth))
    ordered = known[np.argsort(depth[known])]
    curve = isotonic_regression(slope[ordered]).x
    return compared("scatter about one rising curve, all loads and speeds", *(slope[ordered] - curve))


def full_contact(studies: Studies) -> str:
    """Compare cases in full contact with mu = 4 eta v L slope^2 / F."""
    grid = {"points": f"{studies.points or 5000}\n  oversampling: 4"}
    data = studies("friction_force", normal_force="[100 N, 1 kN]", velocity="[1e-5, 1e-3]", **grid)[""]
    law = 4 * data.shear_modulus * data.relaxation_time * data.velocity * data.length * data.rms_slope**2
    ratio = (data.friction_coefficient * data.normal_force / law).where(data.contact_fraction >= 1)
    departures = ratio.to_numpy()[np.isfinite(ratio.to_numpy())] - 1
    return compared(f"{departures.size} cases", *departures)


def slopes(_: Studies) -> str:
    """Compute (3.16), rms over mean of the slopes, for two distributions, and compare it with sqrt 2."""
    normal, tip = np.sqrt(np.pi / 2), 2 / np.sqrt(3)
    figure = f"{normal:.3f} for normal slopes and {tip:.3f} for one parabolic tip"
    return f"{law_holds(np.array([normal, tip]) / np.sqrt(2) - 1, None)}; {figure}"


def shifts(studies: Studies) -> str:
    """Compare fitted shifts along the velocity with those of the interpolation law."""
    (found,) = available("sliding_friction")["collapse"].results(studies("friction_force")).values()
    apart = (found.horizontal - found.horizontal_stated).to_numpy().ravel()
    return compared(f"at most {np.nanmax(np.abs(apart)):.2f} decades", *(np.log(10) * apart[np.isfinite(apart)]))


def layer(_: Studies) -> str:
    """Compute the force at which the contact of the ball is as wide as the layer: F = 16/3 G a^3 / R, a = D/2."""
    force = 16 / 3 * 3e6 * (5e-3 / 2) ** 3 / 0.05
    return compared(f"{force:.1f} N at 2a = D; 40 N is a = D", 40 / force - 1)


def heating(_: Studies) -> str:
    """Compute the temperature rise 2 mu G d v / lambda of the ball at 100 N."""
    depth = (3 * 100 / (16 * 3e6 * np.sqrt(0.05))) ** (2 / 3)
    rise = 2 * 0.5 * 3e6 * depth * 0.01 / 20
    return compared(f"d = {1e3 * depth:.2f} mm and {rise:.1f} K", 0.06 / rise - 1)


def small_heating(_: Studies) -> str:
    """Compute the temperature rise 2 mu G h v / lambda of the micro-contacts."""
    rise = 2 * 0.5 * 1.5e9 * 1e-7 * 0.01 / 20
    return compared(f"{rise:.3f} K by the thesis's formula", 0.08 / rise - 1)


def trends(studies: Studies) -> str:
    """Count pairs of neighbouring cases whose probability of breakthrough changes as the thesis states."""
    probability = studies("rolling2013", ("operation",))["operation"].breakthrough_probability.mean("realisation")
    right, pairs = 0, 0
    for dim, sign in (("temperature", 1), ("normal_force", 1), ("rotation_speed", -1)):
        steps = sign * probability.diff(dim)
        wide = abs(steps) > 0.02
        right += int(((steps > 0) & wide).sum())
        pairs += int(wide.sum())
    return compared(f"{right} of {pairs} pairs of neighbours that differ by more than 0.02", right / max(pairs, 1) - 1)


def switching(studies: Studies) -> str:
    """Give the probability of breakthrough at 800 N, 100 rpm and 40 degC, for one line and for 24 parallel lines."""
    operation = studies("rolling2013", ("operation",))["operation"].breakthrough_probability
    value = operation.sel(normal_force=800, method="nearest").mean("realisation")
    one = float(value.sel(rotation_speed=100 * 2 * np.pi / 60, temperature=313.15, method="nearest"))
    word = "no" if one < 0.02 else "approximately"
    return f"{word}: P = {100 * one:.1f} % of one line, {100 * (1 - (1 - one) ** 24):.0f} % of 24 lines side by side"


def proportional_jumps(studies: Studies) -> str:
    """Compare zeta and xi of eq. 4.8 with their means; fit a straight line to zeta against dv / v_1."""
    found = available("velocity_jump")["kinetics"].results(studies("kinetics2014", ("jumps",)))["jumps"]
    trend, zeta = np.polyfit(found.velocity_change, found.zeta, 1)
    away = [found[name] - found[name].mean() for name in ("zeta", "xi")]
    departures = np.concatenate(away) / found.zeta.mean().item()
    sign = "-" if trend < 0 else "+"
    return compared(f"zeta = {zeta:.3g} (1 {sign} {abs(trend / zeta):.2g} dv / v_1)", *departures)


def film_ratio(studies: Studies) -> str:
    """Compare the minimum film with the central film."""
    films = studies("ehl_map", ("barus",))["barus"]
    ratio = (films.minimum_film / films.central_film).to_numpy().ravel()
    return compared(f"{100 * ratio.min():.0f} to {100 * ratio.max():.0f} %", *(ratio / 0.75 - 1))


def density(_: Studies) -> str:
    """Give the largest relative increase of the density by the density law."""
    most = oil.DENSITY_RISE / oil.DENSITY_SATURATION
    return compared(f"{100 * most:.1f} %", most / 0.33 - 1)


def stribeck(studies: Studies) -> str:
    """Compare friction at the slowest speed and 200 N with boundary friction."""
    friction = studies("stribeck")[""].friction_coefficient.mean("realisation")
    slow = friction.isel(rotation_speed=0)
    light = float(slow.max())
    return compared(f"mu = {light:.4f} at the slowest speed, least {float(friction.min()):.4f}", light / 0.1 - 1)


def unit_dependent(_: Studies) -> str:
    """Derive the factor 1.806 of (B.22) from the factor 1.714 of (B.21); the powers of E' add up to 0.002."""
    factor = 1.714 * 2.31e11**0.002
    return compared(f"1.714 E'^0.002 = {factor:.4f} with E' = 2 E* = 2.31e11 Pa", 1.806 / factor - 1)


def limiting_radius(_: Studies) -> str:
    """Compare eq. 6.16 as printed, a = sqrt(2 + c^2/4) - c/2, with the exact volume balance."""

    def exact(c: float) -> float:
        return float(brentq(lambda a: (a * a / 2 - 1) * np.arccos(c / a) + c / 2 * np.sqrt(a * a - c * c), 1.0001, 2))

    cs = np.linspace(0.05, 0.95, 19)
    return compared("c = 0.05 to 0.95", *((np.sqrt(2 + c**2 / 4) - c / 2) / exact(c) - 1 for c in cs))


def fast_rule(studies: Studies) -> str:
    """Give the largest error of the fast rule with xi = 0.8, for all stick radii and cycles, in units of d0."""
    groups = studies("fast_wear_error")
    exact, fast = groups["exact"].worn_profile, groups["fast"].worn_profile.sel(xi=0.8, method="nearest")
    away = (fast - exact).to_numpy().ravel()
    return compared("in units of d0, which is larger than the profile", *away[np.isfinite(away)])
