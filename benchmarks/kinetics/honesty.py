"""How honest the errors of a velocity jump are: ``python -m benchmarks kinetics honesty [cases [seed]]``.

Random cases in all regions; the truth is a march on a four times finer grid with five times as many steps, and ends to
a relative accuracy of 1e-6. Below them, light and slow cases for the ends alone, where contact is a few peaks. Then
jumps to a fifth or to ten times, on short lines, beside every element followed, which shares no search with the march.
"""

import sys

import numpy as np

from mdr_dask.models.base import Block, Status
from mdr_dask.models.velocity_jump import MODEL, VelocityJump
from mdr_dask.physics.surfaces import roughness

ENDS = ("friction_coefficient_before", "friction_coefficient_jump", "friction_coefficient_after")
TRACE = (*ENDS, "friction_coefficient")
EVERY = (*TRACE, "indentation_depth")
EXACT = 1e-6
EARLY = tuple(float(time) for time in np.geomspace(1e-3, 5, 20))
ROUNDING = 1e-9  # of a value: errors below are met


def solve(case, realisation, oversampling, steps, outputs, accuracy=None):
    parameters = VelocityJump(
        length=1.0,
        oversampling=oversampling,
        steps_per_decade=steps,
        rms_roughness=1.0,
        shear_modulus=1.0,
        relaxation_time=1.0,
        **case,
    )
    found = MODEL.compute(Block(parameters, {}, 1, (realisation,), 1, outputs, accuracy))
    done = found.status[0, 0] == Status.DONE
    return {name: value[0, 0] for name, value in found.values.items()} if done else None


def relaxing(found):
    """Return mu - mu_2 at t_0+ and after."""
    at = found["friction_coefficient_before"] + found["friction_coefficient_jump"]
    return np.append(at, found["friction_coefficient"]) - found["friction_coefficient_after"]


def broad(generator, k):
    """Return a case of any region."""
    hurst = float(generator.choice([0, 0.3, 0.7, 1, generator.uniform()]))
    points = int(generator.choice([200, 500, 1000]))
    force = 10 ** generator.uniform(-2, 1.5)
    slope = roughness.spectral_slope(roughness.amplitudes(points // 2, hurst))
    deborah = 10 ** generator.uniform(-2, 2) / slope if k % 5 else 10 ** generator.uniform(-5, 0)
    change = float(generator.choice([-0.2, 0.1, 0.3]))
    return {"hurst": hurst, "points": points, "normal_force": force, "velocity": deborah, "velocity_change": change}


def light(generator, k):
    """Return a light, slow case, up or down by up to a factor of ten."""
    hurst, points = float(generator.uniform(0, 1)), int(generator.choice([16, 32, 64, 200]))
    slope = roughness.spectral_slope(roughness.amplitudes(points // 2, hurst))
    force, deborah = 10 ** generator.uniform(-4, 0), 10 ** generator.uniform(-5, 0) / slope
    change = float(generator.choice([-0.9, -0.5, -0.2, 0.2, 1, 9]))
    return {"hurst": hurst, "points": points, "normal_force": force, "velocity": deborah, "velocity_change": change}


def honesty(cases, seed, kind=broad, outputs=EVERY, grid=(4, 8), accuracy=None):
    """Return largest errors over estimates, and over the largest value, of every output: shape (cases, outputs, 2)."""
    generator = np.random.default_rng(seed)
    rows = np.full((cases, len(outputs), 2), np.nan)
    for k in range(cases):
        case, realisation = kind(generator, k), 1000 * seed + k
        found = solve(case, realisation, *grid, MODEL.with_companions(outputs), accuracy)
        exact = solve(case, realisation, 4 * grid[0], 5 * grid[1], outputs, EXACT)
        if not found or not exact:
            continue
        for j, name in enumerate(outputs):
            size = np.max(np.abs(exact[name]))
            error = np.abs(found[name] - exact[name])
            estimate = np.maximum(found[f"{name}_error"], ROUNDING * size)
            rows[k, j] = np.max(error / estimate), np.max(error) / size
    return rows


def large(generator):
    """Return a jump to a fifth or to as much as ten times the velocity, on a short line."""
    hurst, points = float(generator.uniform(0, 1)), int(generator.choice([40, 80, 120]))
    slope = roughness.spectral_slope(roughness.amplitudes(points // 2, hurst))
    force, velocity = 10 ** generator.uniform(-2.5, 1.5), 10 ** generator.uniform(-2, 0.6) / slope
    change = float(generator.choice([-0.8, -0.5, 0.3, 1, 2, 4, 9]))
    case = {"hurst": hurst, "points": points, "normal_force": force, "velocity": velocity, "relaxation_times": EARLY}
    steps = {"shape": "steps", "times": [0.0], "velocities": [velocity * (1 + change)]}
    return case | {"velocity_change": change}, case | {"protocol": steps}


def beside_elements(cases, seed, grid=(4, 8)):
    """Return what `honesty` does, of large jumps beside every element followed, whose own error counts as met."""
    generator, outputs = np.random.default_rng(seed), ("friction_coefficient", "indentation_depth")
    rows = np.full((cases, len(outputs), 2), np.nan)
    for k in range(cases):
        jump, history = large(generator)
        found, exact = (
            solve(case, 1000 * seed + k, *on, MODEL.with_companions(outputs))
            for case, on in ((jump, grid), (history, (16, 24)))
        )
        if not found or not exact:
            continue
        for j, name in enumerate(outputs):
            size, doubt = np.max(np.abs(exact[name])), np.max(exact[f"{name}_error"])
            error = np.maximum(np.max(np.abs(found[name] - exact[name])) - doubt, 0.0)
            rows[k, j] = error / np.maximum(np.max(found[f"{name}_error"]), ROUNDING * size), error / size
    return rows


def report(title, rows, outputs, accuracy=0.01):
    done = np.isfinite(rows[:, 0, 0])
    print(f"{title}: {done.sum()} of {len(rows)} converged")
    for j, name in enumerate(outputs):
        ratio, error = rows[done, j].T
        print(
            f"  {name}: {np.mean(ratio <= 1):.1%} covered, largest error over estimate {ratio.max():.2g}, error over "
            f"value median {np.median(error):.1e}, 95 % {np.quantile(error, 0.95):.1e}, largest {error.max():.1e}, "
            f"{np.sum(error > accuracy)} beyond {accuracy:g}"
        )


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    for grid in ((2, 8), (4, 8), (4, 12)):
        report(f"oversampling {grid[0]}, {grid[1]} steps", honesty(number, first, grid=grid), EVERY)
    for accuracy in (0.05, 0.01, 0.002):
        rows = honesty(number, first, light, ENDS, accuracy=accuracy)
        report(f"light and slow, ends to {accuracy:g}", rows, ENDS, accuracy)
    rows = beside_elements(number, first)
    report("large jumps beside every element followed, 8 steps", rows, ("friction_coefficient", "indentation_depth"))
