"""How honest the error estimate of sliding friction is: ``python -m benchmarks.honesty_friction [cases [seed]]``.

Random cases in all regions, solved with ``oversampling: auto``, against oversampling 128; every tenth is a fine line
under the loads of the spacing series of the PRL campaign, against oversampling 16.
"""

import sys

import numpy as np

from mdr_dask.models.base import Block
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction
from mdr_dask.physics import roughness

OUTPUTS = ("friction_coefficient", "discretisation_error", "rms_slope")


def solve(hurst, points, force, reach, realisation, oversampling, accuracy=0.01):
    parameters = SlidingFriction(
        length=1.0,
        points=points,
        oversampling=oversampling,
        hurst=hurst,
        rms_roughness=1.0,
        shear_modulus=1.0,
        relaxation_time=1.0,
        normal_force=force,
        velocity=reach,
    )
    outputs = OUTPUTS if oversampling == "auto" else OUTPUTS[:1]
    return MODEL.compute(Block(parameters, {}, 1, (realisation,), 1, outputs, accuracy)).values


def honesty(cases=500, accuracy=0.01, seed=0):
    """Return the share of cases whose error is below its estimate, and the median of estimate over error."""
    generator = np.random.default_rng(seed)
    errors, estimates = np.empty(cases), np.empty(cases)
    for k in range(cases):
        hurst = float(generator.choice([0, 1, generator.uniform(), generator.uniform()]))
        points = int(generator.choice([100, 500, 2000]))
        force = 10 ** generator.uniform(-3, 3)
        fine = k % 10 == 9
        if fine:
            points, force = int(generator.choice([9000, 30000])), 10 ** generator.uniform(0, 2)
        slope = roughness.spectral_slope(roughness.amplitudes(points // 2, hurst))
        reach = 10 ** generator.uniform(-2, 3) / slope if k % 5 else 10 ** generator.uniform(-8, 2)
        line = 1000 * seed + k
        found = solve(hurst, points, force, reach, line, "auto", accuracy)
        exact = solve(hurst, points, force, reach, line, 16 if fine else 128)["friction_coefficient"]
        errors[k] = abs(found["friction_coefficient"] / exact - 1).item()
        estimates[k] = found["discretisation_error"].item()
    # below 1e-9 both are rounding
    return float(np.mean(errors <= estimates + 1e-9)), float(np.median(estimates / np.maximum(errors, 1e-12)))


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    for target in (0.05, 0.01, 0.002):
        share, over = honesty(number, target, first)
        print(f"{number} cases at {target:g}: {share:.1%} below the estimate, {over:.1f} times too large (median)")
