"""Friction of rough indenters against law 3.40: ``python -m benchmarks friction indenter_law [realisations]``.

Cone and parabola of physics section 3.3: F_N = 10 N, G = 1 MPa, h = 50 um, tau = 1 ms, H = 0.4, L = 10 mm; the
low-velocity friction xi in units of the plateau goes from 0.01 to 100.
"""

import math
import sys

import numpy as np

from mdr_dask.models.base import Block
from mdr_dask.models.parts.indenter import Cone, Parabola
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction
from mdr_dask.physics.sliding import laws
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces import shapes as indenter

LENGTH, HURST, RMS, POINTS, FORCE, MODULUS, TAU = 0.01, 0.4, 5e-5, 2000, 10.0, 1e6, 1e-3
#: the line's coefficient is tan(10 deg) for the cone and 1 / (1 cm) for the parabola
BODIES = {
    "cone": Cone(shape="cone", angle=math.atan(math.tan(math.radians(10)) / indenter.mapped(1))),
    "parabola": Parabola(shape="parabola", radius=0.01),
}
XI = np.geomspace(0.01, 100, 9)


def ratios(body, realisations):
    """Return mean friction over law 3.40 for every xi, and the status of all cases."""
    slope = roughness.spectral_slope(roughness.amplitudes(POINTS // 2, HURST)) * RMS / LENGTH
    coefficient, exponent = body.power_law()
    half = indenter.half_width(np.array(FORCE / (4 * MODULUS)), indenter.mapped(exponent) * coefficient, exponent)
    low = laws.indenter_low(half, 1.0, TAU, MODULUS, FORCE, slope)
    velocity = XI * math.sqrt(2) * slope / low
    parameters = SlidingFriction(
        length=LENGTH,
        points=POINTS,
        oversampling=8,
        hurst=HURST,
        rms_roughness=RMS,
        shear_modulus=MODULUS,
        relaxation_time=TAU,
        normal_force=FORCE,
        velocity=1.0,
        indenter=body,
    )
    block = Block(parameters, {"velocity": velocity}, XI.size, tuple(range(realisations)), 1, ("friction_coefficient",))
    result = MODEL.compute(block)
    friction = np.nanmean(result.values["friction_coefficient"], axis=1)
    return friction / (math.sqrt(2) * slope * laws.indenter(XI)), result.status


def main(realisations=20):
    print("xi      " + " ".join(f"{xi:7.3g}" for xi in XI))
    for name, body in BODIES.items():
        ratio, status = ratios(body, int(realisations))
        print(f"{name:8}" + " ".join(f"{value:7.3f}" for value in ratio), f"({np.mean(status == 1):.0%} of cases)")


if __name__ == "__main__":
    main(*sys.argv[1:])
