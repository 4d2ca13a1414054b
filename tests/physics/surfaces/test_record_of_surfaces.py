"""Maps, scans, spectra, lines and shapes on record: unequal sides, missing points, noise, bends, kinks, guards."""

import numpy as np
import record
from flattened import flat

from mdr_dask.errors import MdrDaskError
from mdr_dask.physics.surfaces import (
    cubic_line,
    maps,
    measured,
    roughness,
    scans,
    self_affine,
    shapes,
    spectrum,
    splines,
)
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import Waves, series, waves_of

NX, NY, SIZE = 26, 41, (1.3e-4, 0.7e-4)


def why(function, *arguments):
    """The sentence with which something is refused."""
    try:
        function(*arguments)
    except (MdrDaskError, ValueError) as error:
        return str(error)
    return "taken"


def height(nx=NX, ny=NY):
    """Waves in no direction of the grid, a tilt and a bend."""
    x, y = np.meshgrid(np.arange(nx) / nx, np.arange(ny) / ny, indexing="ij")
    waves = [np.cos(2 * np.pi * (a * x + b * y) + a * b) / (1 + a * a + b * b) for a in range(-5, 6) for b in range(8)]
    return 1e-7 * (np.sum(waves, axis=0) + 2 * x - 3 * y + x * y + 0.7 * x**2)


def rows(found):
    """A spectrum of a map with what is read from it."""
    whole = {
        name: getattr(found, name) for name in ("wavenumber", "density", "count", "independent", "rms_height", "axes")
    }
    whole |= {"slopes": found.slopes, "angular": (found.angular.real, found.angular.imag), "cuts": found.cuts}
    whole |= {"gradient": found.rms_gradient, "binned": found.binned(), "anisotropy": found.anisotropy()}
    for name, one in (("spectrum", found.spectrum()), ("along x", found.along(0)), ("along y", found.along(1))):
        whole |= {name: (one.wavenumber, one.density, one.rms_height())}
    return whole


def test_maps(dataframe_regression):
    found = {}
    for name, (nx, ny), size in (
        ("wide", (NX, NY), SIZE),
        ("even", (40, 26), (0.7e-4, 1.3e-4)),
        ("odd", (17, 33), (1e-4, 1e-4)),
    ):
        surface = maps.SurfaceMap(height(nx, ny), size)
        for order in ("none", "mean", "plane", "parabola"):
            found |= {f"{name} {order}": maps.without_trend(surface, order).height}
        plain = maps.without_trend(surface, "plane")
        found |= {f"{name} {hann}": rows(maps.spectrum_of_map(plain, hann)) for hann in (True, False)}
        found |= {f"{name} window": maps.hann_disc((nx, ny), size), f"{name} waves": maps.wavenumbers((nx, ny), size)}
    spiky = height()
    for row, column, high in ((3, 4, 9e-7), (3, 5, 4e-7), (12, 30, -7e-7), (24, 39, 8e-7), (1, 1, 2e-6), (0, 7, 1e-5)):
        spiky[row, column] += high
    found |= {"outliers": np.flatnonzero(maps.outliers(maps.SurfaceMap(spiky, SIZE)))}
    found |= {"none": maps.outliers(maps.SurfaceMap(np.zeros((NX, NY)), SIZE)).sum()}
    holes = height()
    holes[4:7, 9:12], holes[0, 0], holes[25, 40], holes[13, :3] = np.nan, np.nan, np.nan, np.nan
    found |= {"filled": maps.filled(maps.SurfaceMap(holes, SIZE)).height[~np.isfinite(holes)]}
    many = np.where(np.arange(NX * NY).reshape(NX, NY) % 19 == 0, np.nan, height())
    refused = (maps.filled, maps.SurfaceMap(many, SIZE)), (maps.filled, maps.SurfaceMap(height(15, 30), SIZE))
    refused += ((maps.spectrum_of_map, maps.SurfaceMap(np.full((NX, NY), 3.0), SIZE)),)
    found |= {"refused": [why(*each) for each in refused]}
    record.check(dataframe_regression, flat("", found))


def test_a_map_that_is_longer_than_a_band(dataframe_regression):
    high = height(300, 61)
    high[[5, 130, 257], [4, 29, 51]] += 2e-6
    surface = maps.SurfaceMap(high, (3e-4, 2e-5))
    found = {
        "outliers": np.flatnonzero(maps.outliers(surface)),
        "trend": maps.without_trend(surface, "parabola").height,
    }
    record.check(dataframe_regression, found)


def test_spectra(dataframe_regression):
    found = {}
    for rolloff in (0.0, 2e-4):
        one = spectrum.self_affine(0.73, 9e-4, 1.1e-6, 3e-7, rolloff)
        found |= {f"{rolloff}": (one.wavenumber, one.density, one.rms_height(), one.rms_gradient(), one.wavelengths)}
        found |= {f"{rolloff} line": one.line(3e-4, 23), f"{rolloff} cut": one.cut(np.geomspace(3e3, 5e6, 9))}
        found |= {f"{rolloff} at": one.at(np.geomspace(1e3, 1e8, 13))}
        for name, part in (
            ("between", one.between(3e-4, 7e-6)),
            ("short", one.between(0.0, 2e-6)),
            ("all", one.between()),
        ):
            found |= {f"{rolloff} {name}": (part.wavenumber, part.density)}
        for ends in ((2e-3, 0.0), (0.0, 5e-7), (2e-3, 5e-7), (1e-4, 1e-4)):
            part = one.continued(*ends)
            found |= {f"{rolloff} continued {ends}": (part.wavenumber, part.density)}
    found |= {"flat": spectrum.Spectrum(np.array([1.0, 3.0, 7.0]), np.array([1.0, 1 / 9, 1 / 49])).rms_height()}
    q = np.array([1.0, 2.0, 3.0])
    bad = ((q[:1], q[:1]), (q, q[:2]), (q, -q), (q, q * np.nan), (-q, q), (q[::-1], q), (np.ones(3), q))
    found |= {"refused": [why(spectrum.Spectrum, *each) for each in bad]}
    found |= {"nothing": [why(one.between, *ends) for ends in ((1e-6, 1e-6), (1e-7, 0.0), (0.0, 1e-2))]}
    record.check(dataframe_regression, flat("", found))


def test_power_laws_of_spectra(dataframe_regression):
    """Bends at either end, noise in the tail, an end that falls off, too few bins, no such law."""
    q, found = np.geomspace(1e4, 1e7, 19), {}
    law = 1e-9 * (q / 1e4) ** -3.3 * (1 + 0.04 * np.sin(9 * np.arange(19)))
    shapes_of = {"law": law, "bend": np.minimum(law, law[5]), "noise": np.maximum(law, law[14])}
    shapes_of |= {"both": np.clip(law, law[13], law[4]), "end": np.where(q > q[15], 1e-9 * law, law)}
    shapes_of |= {"gone": np.where(q > q[15], 0.0, law), "hole": np.where(q == q[15], 0.0, law)}
    shapes_of |= {"steep": law * (q / 1e4) ** -4, "flat": np.full(19, 1e-12)}
    for (name, density), error in ((each, error) for each in shapes_of.items() for error in (0.02, 0.3)):
        bins = scans.Cut(q, density, np.full(19, error))
        limits = self_affine.noise_limit(bins), self_affine.noise_limit(bins, -0.5, 0.5), self_affine.steep_limit(bins)
        found |= {f"{name} {error} limits": np.nan_to_num(limits, posinf=-1.0)}
        if np.all(density > 0):
            found |= {f"{name} {error} law": self_affine.fit_self_affine(bins)}
            found |= {f"{name} {error} until": self_affine.fit_self_affine(bins.until(q[9]))}
            isotropic = scans.of_cut(bins)
            found |= {f"{name} {error} isotropic": (isotropic.wavenumber, isotropic.density)}
    few = scans.Cut(q[:4], law[:4], np.ones(4))
    found |= {"few": self_affine.fit_self_affine(few), "three": why(scans.of_cut, few.until(q[1]))}
    record.check(dataframe_regression, flat("", found))


def test_scans_and_measured_lines(dataframe_regression):
    x = 1e-6 * np.arange(31)
    z = 1e-7 * (np.sin(0.9 * np.arange(31)) + 0.03 * np.arange(31) + 0.002 * np.arange(31) ** 2)
    uneven, found = x * (1 + 0.2 * x / x[-1]), {}
    for name, place in (("even", x), ("falling", x[::-1]), ("uneven", uneven)):
        for detrend, taper, ends in (
            ("none", 0.0, ()),
            ("mean", 0.3, ()),
            ("line", 0.0, (4e-6,)),
            ("parabola", 1.4, (3e-6, 2e-5)),
        ):
            line = measured.measured_line(place, z, detrend, taper, *ends)
            found |= {f"{name} {detrend}": line, f"{name} {detrend} spacing": line.spacing}
    lines = [measured.measured_line(x, z + 1e-8 * np.cos(k * np.arange(31)), "line") for k in (0, 1, 2)]
    found |= {f"cut {hann}": scans.cut_of_lines(lines, hann) for hann in (True, False)}
    found |= {"window": scans.hann_window(13), "more": measured.resampled(z, 44), "fewer": measured.resampled(z, 17)}
    found |= {"rms": (measured.rms_height(z), measured.rms_slope(z, 3e-5)), "power": measured.power_spectrum(z, 3e-5)}
    bad = ((x[:7], z[:7]), (x, z[:9]), (x, z * np.nan), (np.abs(x - 1e-5), z))
    found |= {"refused": [why(measured.measured_line, *each) for each in bad]}
    found |= {"unequal": why(scans.cut_of_lines, [lines[0], measured.measured_line(1.1 * x, z)])}
    record.check(dataframe_regression, flat("", found))


def test_generated_lines(dataframe_regression):
    found = {}
    for case in ((17, 0.7), (17, 0.0, 4.5), (17, 1.0, 0.0, 3.0), (64, 0.3, 5.0, 2.0)):
        amplitude = roughness.amplitudes(*case)
        phase = roughness.phases(3, 2, case[0])
        found |= {f"{case}": (amplitude, roughness.spectral_slope(amplitude), phase)}
        lines = [roughness.line(amplitude, phase, 2 * case[0] + 1 + k, k) for k in range(3)]
        found |= {f"{case} lines": lines}
        waves = Waves(0.5 * amplitude * roughness.phase_factors(3, 2, case[0]), 2 * case[0])
        found |= {f"{case} waves": (waves.heights(3 * case[0]), waves.slopes(3 * case[0]), waves.rms_slope())}
        found |= {f"{case} from": waves.from_place(0.313).heights(2 * case[0] + 3)}
        for way in (splines.closest, splines.through):
            spline = way(waves.coefficients, 2 * case[0] + 3)
            found |= {f"{case} {way.__name__}": (spline, splines.heights(spline))}
    factors = np.empty((9, 2))
    roughness._turn(np.linspace(0.0, 1.0, 9, endpoint=False) + 0.03, factors)
    found |= {"turn": factors, "nyquist": series(np.array([1.0 + 2j, 0.3 - 1j]), 4)}
    found |= {"of": [waves_of(np.sin(np.arange(n) ** 2)).coefficients.imag for n in (8, 9)]}
    found |= {"refused": [why(roughness.amplitudes, 3, 0.5, 0.0, 4.0), why(series, np.ones(3, complex), 5)]}
    found |= {"spline": splines.through_heights(np.sin(np.arange(11.0) ** 2))}
    record.check(dataframe_regression, flat("", found))


def test_pieces_of_splines(dataframe_regression):
    pieces = (
        [1.0, -2.0, 3.0, -1.0],
        [-1.0, 0.6, 0.5, -2.0],
        [0.1, 0.1, 0.1, 0.1],
        [1.0, 0.0, -1.0, -2.0],
        [-3.0, 2.0, -1.0, 4.0],
    )
    found, places = {}, np.empty(8)
    for number, coefficients in enumerate(np.array(pieces)):
        of = splines.piece(coefficients, 0)
        numbers = [
            *of,
            splines.value(of, 0.37),
            splines.integral(of, 0.37),
            *splines.shares(0.37),
            *splines._extremes(of),
        ]
        found |= {f"{number}": np.array(numbers)}
        count = splines.zeros(coefficients, 0, places, 1)
        found |= {f"{number} zeros": places[1:count].copy()}
    record.check(dataframe_regression, found)


def test_shapes_and_cells(dataframe_regression):
    x, found = np.array([-0.4, -0.11, 0.0, 0.03, 0.11, 0.5]), {}
    bodies = {
        "cone": shapes.PowerLaw.of_body(0.3, 1.0),
        "blunt": shapes.PowerLaw(2.1, 3.3),
        "rounded": shapes.RoundedCone(0.7, 0.11),
    }
    waves = Waves(np.array([0.3 + 0.1j, -0.2j, 0.05 + 0.11j]), 6)
    lines = {"plane": RoughLine(waves), **{name: RoughLine(waves, body) for name, body in bodies.items()}}
    for name, body in bodies.items():
        found |= {name: (body.at(x), body.body(np.abs(x)), np.array(body.breaks), body.scaled(0.3, 0.02))}
    for name, line in lines.items():
        for kind, one in (
            ("cubic", line.cubic(14)),
            ("straight", line.straight(14)),
            ("top", line.from_summit().cubic(11)),
        ):
            found |= {
                f"{name} {kind}": cubic_line.cut(one),
                f"{name} {kind} smooth": cubic_line.without_kinks(one).enter,
            }
    summits = [cubic_line.summit(a, b, c) for a in (-1.0, 0.0, 0.4) for b in (-2.0, 0.0, 0.5) for c in (-0.7, 0.0, 0.3)]
    found |= {"summits": np.array(summits), "running": cubic_line.running(np.array([0.3, 0.1, -0.7]))}
    for nodes in (3, 7, 20):
        found |= {
            f"highest {nodes}": np.array(cubic_line.highest_point(waves.heights(nodes + 5), waves.slopes(nodes + 5)))
        }
    found |= {"mapped": [shapes.mapped(n) for n in (0.5, 1.0, 2.0, 7.3)]}
    loads, deborah = np.array([0.1, 2.0, 1e-3, 5.0, 0.3]), np.array([0.2, 1e-3, 3.0, 0.7, 1e3])
    coefficients, exponents, results = (
        np.array([0.3, 2.0, 1.0, 0.1, 7.0]),
        np.array([1.0, 2.0, 1.3, 4.0, 1.0]),
        np.empty((5, 5)),
    )
    shapes.smooth(loads, deborah, coefficients, exponents, results)
    found |= {"smooth": list(results), "width": shapes.half_width(loads, 0.7, 2.0)}
    record.check(dataframe_regression, flat("", found))
