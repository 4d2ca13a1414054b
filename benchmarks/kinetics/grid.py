"""What grid and steps cost a velocity jump of the campaign in accuracy: ``python -m benchmarks kinetics grid``.

Nine lines of 5000 points in a case, dv = 0.2 v_1, against oversampling 16 and 40 steps per decade.
"""

import numpy as np

from benchmarks.kinetics.honesty import TRACE, relaxing
from benchmarks.measures import alone, print_table
from mdr_dask.models.velocity_jump import MODEL, VelocityJump

CASES = (
    (0.7, 1.2, 0.05),
    (0.7, 1.2, 1.0),
    (0.7, 1.2, 10.0),
    (0.7, 0.01, 0.05),
    (0.7, 1.2, 0.005),
    (0.3, 1.2, 0.05),
    (0.3, 1.2, 1.0),
    (0.0, 1.2, 0.05),
)
SETTINGS = ((4, 12), (4, 8), (4, 6), (4, 4), (2, 8))
FINE = (16, 40)
LINES, SEED = 9, 2014


def solve(hurst, force, velocity, line, oversampling, steps):
    parameters = VelocityJump(
        length=0.01,
        points=5000,
        oversampling=oversampling,
        steps_per_decade=steps,
        hurst=hurst,
        rms_roughness=1e-5,
        shear_modulus=1e7,
        relaxation_time=1e-3,
        normal_force=force,
        velocity=velocity,
        velocity_change=0.2,
    )
    return alone(MODEL, parameters, line, TRACE, SEED)


def errors(case):
    """Return the relaxing part over mu_2, and the errors over the relaxing part, shape (lines, settings)."""
    found = np.full((LINES, len(SETTINGS)), np.nan)
    parts = np.full(LINES, np.nan)
    for line in range(LINES):
        exact = solve(*case, line, *FINE)
        if exact is None:
            continue
        truth = relaxing(exact)
        largest = np.max(np.abs(truth))
        parts[line] = largest / exact["friction_coefficient_after"]
        for k, setting in enumerate(SETTINGS):
            rough = solve(*case, line, *setting)
            if rough is not None:
                found[line, k] = np.max(np.abs(relaxing(rough) - truth)) / largest
    return np.nanmedian(parts), found


def rows():
    for hurst, force, velocity in CASES:
        part, found = errors((hurst, force, velocity))
        middle, worst = np.nanmedian(found, axis=0), np.nanmax(found, axis=0)
        yield (
            f"H = {hurst:g}, {force:g} N, {velocity:g} m/s",
            f"{part:.1e}",
            *(f"{m:.2g}, {w:.2g}" for m, w in zip(middle, worst, strict=True)),
        )


if __name__ == "__main__":
    names = (f"{oversampling}, {steps} steps" for oversampling, steps in SETTINGS)
    print_table(("case", "relaxing part over mu_2", *names), rows())
