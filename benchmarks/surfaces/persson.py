"""Compare friction of lines with Persson's theory for tyres and seals: ``python -m benchmarks persson``.

B. N. J. Persson, J. Chem. Phys. 115, 3840 (2001), with his correction S = 1/2 + P^2/2 of the elastic energy in partial
contact. Lines and theory have the same isotropic spectrum and the same Kelvin or standard solid. A line of length L
carries the load on a disc of diameter L, as in docs/validity.md. The theory is exact in full contact, otherwise an
approximation.
"""

import numpy as np
from scipy.special import erf

from benchmarks.rows import table
from mdr_dask.physics.sliding.problem import PronyTerms, Request, solve
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.spectrum import self_affine
from mdr_dask.physics.surfaces.waves import Waves

LINES, STATIC = 10, 1e6
#: Hurst exponent, longest wave, roll-off and shortest wave (m), rms height (m), length of the line (m), Nyquist points.
SURFACES = {
    "road": (0.8, 8e-3, 5e-3, 4e-5, 2e-4, 16e-3, 800),
    "ground steel": (0.8, 2e-4, 1e-4, 1e-6, 5e-7, 4e-4, 800),
}
#: Ratio of glassy to static modulus (None for a Kelvin solid), and relaxation time in s.
SOLIDS = {"Kelvin": (None, 1e-6), "standard": (30.0, 1e-5)}
PRESSURES = (1e-2, 3e-2, 1e-1, 3e-1, 1.0)  # MPa
VELOCITIES = (1e-2, 1.0)  # m/s


def modulus(solid, omega):
    """Return the complex shear modulus of a solid in Pa."""
    glass, time = solid
    if glass is None:
        return STATIC * (1 + 1j * omega * time)
    return STATIC * (1 + (glass - 1) * 1j * omega * time / (1 + 1j * omega * time))


def persson(spectrum, solid, pressure, velocity):
    """Return friction and relative area in contact by Persson's theory."""
    q = np.geomspace(spectrum.wavenumber[0], spectrum.wavenumber[-1], 400)
    angle = (np.arange(200) + 0.5) * np.pi / 400  # angles of a quarter of the circle
    effective = 4 * modulus(solid, q[:, None] * velocity * np.cos(angle)) / pressure  # E / (1 - nu^2) = 4 G
    density = spectrum.at(q)
    squares = 2 * np.pi * np.mean(np.abs(effective) ** 2, axis=1)
    losses = 2 * np.pi * np.mean(effective.imag * np.cos(angle), axis=1)
    rise = q**4 * density * squares / 8
    steps = np.diff(np.log(q)) * (rise[1:] + rise[:-1]) / 2
    spread = np.append(0.0, np.cumsum(steps))
    with np.errstate(divide="ignore"):
        contact = erf(1 / (2 * np.sqrt(spread)))
    shares = q**4 * density * (0.5 + 0.5 * contact**2) * contact * losses / 2
    return np.trapezoid(shares, np.log(q)), contact[-1]


def lines(spectrum, solid, pressure, velocity, length, points):
    """Return friction (mean and standard error over lines), contact fraction, and F / (E* L h)."""
    amplitude = spectrum.line(length, points // 2)
    height = np.sqrt(np.sum(amplitude**2) / 2)
    load = pressure * np.pi / 4 * length**2 / (4 * STATIC * length * height)
    glass, time = solid
    deborah = velocity * time / length
    terms = None if glass is None else PronyTerms((glass - 1,), (deborah,))
    viscous = np.array([deborah if glass is None else 0.0])
    friction, fraction = [], []
    for line in range(LINES):
        waves = Waves(0.5 * amplitude / height * roughness.phase_factors(7, line, points // 2), points)
        steady, _ = solve(RoughLine(waves), terms, viscous, np.array([load]), Request(0.02))
        friction.append(steady.drag[0] / load * height / length)
        fraction.append(steady.contact_fraction[0])
    return np.mean(friction), np.std(friction, ddof=1) / np.sqrt(LINES), np.mean(fraction), load


def main():
    """Print a table of the friction of lines over the friction of the theory."""
    rows = []
    for name, (hurst, longest, rolloff, shortest, rms, length, points) in SURFACES.items():
        spectrum = self_affine(hurst, longest, shortest, rms, rolloff)
        for kind, solid in SOLIDS.items():
            for velocity in VELOCITIES:
                for pressure in PRESSURES:
                    theory, area = persson(spectrum, solid, pressure * 1e6, velocity)
                    mean, error, fraction, load = lines(spectrum, solid, pressure * 1e6, velocity, length, points)
                    numbers = (f"{load:.2g}", f"{fraction:.2g}", f"{area:.2g}", f"{mean:.3g} ± {error:.1g}")
                    rows.append((name, kind, velocity, pressure, *numbers, f"{theory:.3g}", f"{mean / theory:.2f}"))
    columns = ("surface", "solid", "v m/s", "pressure MPa", "F / (E* L h)", "line in contact", "area, theory")
    print(table((*columns, "mu, lines", "mu, theory", "ratio"), rows))
