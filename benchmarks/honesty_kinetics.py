"""How honest the error estimate of a velocity jump is: ``python -m benchmarks.honesty_kinetics [cases [seed]]``.

Random cases in all regions against a march on a four times finer grid with five times as many steps.
"""

import sys

import numpy as np

from benchmarks.measures import alone
from mdr_dask.models.velocity_jump import MODEL, VelocityJump
from mdr_dask.physics.surfaces import roughness

TRACE = (
    "friction_coefficient_before",
    "friction_coefficient_jump",
    "friction_coefficient_after",
    "friction_coefficient",
)


def solve(hurst, points, force, reach, change, realisation, oversampling, steps, outputs):
    parameters = VelocityJump(
        length=1.0,
        points=points,
        oversampling=oversampling,
        steps_per_decade=steps,
        hurst=hurst,
        rms_roughness=1.0,
        shear_modulus=1.0,
        relaxation_time=1.0,
        normal_force=force,
        velocity=reach,
        velocity_change=change,
    )
    return alone(MODEL, parameters, realisation, outputs, 1)


def relaxing(found):
    """Return mu - mu_2 at t_0+ and after."""
    at = found["friction_coefficient_before"] + found["friction_coefficient_jump"]
    return np.append(at, found["friction_coefficient"]) - found["friction_coefficient_after"]


def honesty(cases=200, seed=0, oversampling=4, steps=8):
    """Return true errors, estimates and largest relaxing parts, over mu_2; NaN where a march did not converge."""
    generator = np.random.default_rng(seed)
    rows = np.full((cases, 3), np.nan)
    for k in range(cases):
        hurst = float(generator.choice([0, 0.3, 0.7, 1, generator.uniform()]))
        points = int(generator.choice([200, 500, 1000]))
        force = 10 ** generator.uniform(-2, 1.5)
        slope = roughness.spectral_slope(roughness.amplitudes(points // 2, hurst))
        reach = 10 ** generator.uniform(-2, 2) / slope if k % 5 else 10 ** generator.uniform(-5, 0)
        case = hurst, points, force, reach, float(generator.choice([-0.2, 0.1, 0.3])), 1000 * seed + k
        found = solve(*case, oversampling, steps, (*TRACE, "discretisation_error"))
        exact = solve(*case, 4 * oversampling, 5 * steps, TRACE)
        if found and exact:
            part, truth = relaxing(found), relaxing(exact)
            after = exact["friction_coefficient_after"]
            error = np.max(np.abs(part - truth)) / after
            rows[k] = error, found["discretisation_error"], np.max(np.abs(truth)) / after
    return rows


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    for grid, pace in ((2, 8), (4, 8), (4, 12)):
        error, estimate, part = honesty(number, first, grid, pace).T
        done = np.isfinite(error)
        error, estimate, part = error[done], estimate[done], part[done]
        # below 1e-9 both are rounding
        share = np.mean(error <= estimate + 1e-9)
        some = part > 1e-8
        print(
            f"oversampling {grid}, {pace} steps: {done.sum()} of {number} converged, {share:.1%} below the estimate, "
            f"{np.median(estimate[some] / np.maximum(error[some], 1e-12)):.1f} times too large (median); error over "
            f"mu_2 median {np.median(error):.1e}, 95 % {np.quantile(error, 0.95):.1e}; over the relaxing part median "
            f"{np.median(error[some] / part[some]):.1e}"
        )
