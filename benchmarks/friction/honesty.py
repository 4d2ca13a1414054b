"""How honest the error estimate of sliding friction is: ``python -m benchmarks friction honesty [cases [seed]]``.

Light, slow planes first, F/(GhL) in 1e-6..1 and v tau slope/h in 1e-6..0.3, to three accuracies against oversampling
128. Then random cases in all regions, solved with ``oversampling: auto``, against oversampling 128; every tenth is a
line of 9000 or 30000 points under the loads of the spacing series of the PRL campaign, against oversampling 64. Then
the long lines of that series, against 32 or 64: the grid of the reference has to be that fine, or its own error is what
is seen.
"""

import sys

import numpy as np

from mdr_dask.models.base import Block
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction
from mdr_dask.physics.surfaces import roughness

OUTPUTS = ("friction_coefficient", "friction_coefficient_error", "rms_slope")
LONG = {20000: 64, 50000: 64, 97200: 32, 200000: 32}  # points, and oversampling of the reference
ROUNDING = 1e-9


def solve(hurst, points, force, deborah, realisation, oversampling, accuracy=0.01):
    """Return the outputs of cases on one line, one for every force and Deborah number."""
    force, deborah = np.atleast_1d(force), np.atleast_1d(deborah)
    parameters = SlidingFriction(
        length=1.0,
        points=points,
        oversampling=oversampling,
        hurst=hurst,
        rms_roughness=1.0,
        shear_modulus=1.0,
        relaxation_time=1.0,
        normal_force=float(force[0]),
        velocity=float(deborah[0]),
    )
    outputs = OUTPUTS if oversampling == "auto" else OUTPUTS[:1]
    columns = {"normal_force": force, "velocity": deborah}
    return MODEL.compute(Block(parameters, columns, force.size, (realisation,), 1, outputs, accuracy)).values


def judged(found, exact):
    """Return errors and estimates of cases."""
    errors = np.abs(found["friction_coefficient"] / exact["friction_coefficient"] - 1)
    return errors.ravel(), (found["friction_coefficient_error"] / found["friction_coefficient"]).ravel()


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
        deborah = 10 ** generator.uniform(-2, 3) / slope if k % 5 else 10 ** generator.uniform(-8, 2)
        line = 1000 * seed + k
        found = solve(hurst, points, force, deborah, line, "auto", accuracy)
        exact = solve(hurst, points, force, deborah, line, 64 if fine else 128)
        errors[k], estimates[k] = (column.item() for column in judged(found, exact))
    return summary(errors, estimates)


def long_lines(hurst, points, lines=8, accuracy=0.01, seed=0, speeds=20):
    """Return the same of the spacing series, every other case under another load, and the share within the accuracy."""
    generator = np.random.default_rng((seed, points))
    columns = []
    for line in range(lines):
        deborah = 5e-2 * 10 ** generator.uniform(-4, 3, speeds)
        force = np.where(np.arange(speeds) % 2, 15.0, 10 ** generator.uniform(0, 2, speeds))
        found = solve(hurst, points, force, deborah, 1000 * seed + line, "auto", accuracy)
        columns.append(judged(found, solve(hurst, points, force, deborah, 1000 * seed + line, LONG[points])))
    errors, estimates = np.concatenate(columns, axis=1)
    return *summary(errors, estimates), float(np.mean(errors <= accuracy))


def light_planes(cases=400, accuracies=(0.05, 0.01, 0.002), seed=0):
    """Return errors and estimates of light, slow cases, each on a line of its own: shape (accuracies, 2, cases)."""
    generator, rows = np.random.default_rng((seed, 400)), []
    for k in range(cases):
        hurst = float(generator.choice([0, 1, generator.uniform(), generator.uniform()]))
        points = int(generator.choice([74, 100, 500, 1274, 2000]))
        force, slow = 10 ** generator.uniform(-6, 0), 10 ** generator.uniform(-6, np.log10(0.3))
        deborah = slow / roughness.spectral_slope(roughness.amplitudes(points // 2, hurst))
        case = hurst, points, force, deborah, 1000 * seed + k
        exact = solve(*case, 128)
        rows.append([judged(solve(*case, "auto", accuracy), exact) for accuracy in accuracies])
    return np.moveaxis(np.array(rows)[..., 0], 0, -1)


def summary(errors, estimates):
    """Return the share of errors below their estimate, and the median of estimate over error."""
    over = np.median(estimates / np.maximum(errors, 1e-12))
    return float(np.mean(errors <= estimates + ROUNDING)), float(over)


def main(cases=500, seed=0):
    accuracies = 0.05, 0.01, 0.002
    print("| light, slow planes | below the estimate | largest error / estimate | median | beyond the accuracy |")
    print("|---|---|---|---|---|")
    for accuracy, (errors, estimates) in zip(accuracies, light_planes(400, accuracies, seed), strict=True):
        (share, over), ratio = summary(errors, estimates), np.max(errors / (estimates + ROUNDING))
        print(
            f"| {accuracy:g} | {share:.1%} | {ratio:.2f} | {over:.0f} | {np.mean(errors > accuracy):.2%} |", flush=True
        )
    for target in accuracies:
        share, over = honesty(cases, target, seed)
        print(f"{cases} cases at {target:g}: {share:.1%} below the estimate, {over:.1f} times too large (median)")
    print("| long lines at 1 %: points | H | below the estimate | estimate / error, median | within 1 % |")
    print("|---|---|---|---|---|")
    for points in LONG:
        for hurst in (0.0, 0.1, 0.3):
            share, over, within = long_lines(hurst, points, seed=seed)
            print(f"| {points} | {hurst} | {share:.1%} | {over:.1f} | {within:.1%} |", flush=True)


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
