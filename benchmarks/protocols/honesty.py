"""Whether the discretisation error of protocols is honest, on random cases.

    python -m benchmarks protocols honesty [CASES]

Each case is solved on its grid and on one three times finer with twice the steps; the true error is the largest
difference of the coefficient over its largest value, as the estimate is.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np

from benchmarks.measures import alone
from mdr_dask.models.velocity_jump import MODEL, VelocityJump

TIMES = tuple(float(t) for t in np.linspace(0.0, 3.0, 16))
FRICTION, ESTIMATE = OUTPUTS = ("friction_coefficient", "friction_coefficient_error")
FLOOR = 1e-4  # errors below count as met


def random_case(generator: np.random.Generator) -> dict[str, object]:
    """Return parameters of a case: body, shape, course, load and speed over four decades."""

    def power(low: float, high: float) -> float:
        return float(10 ** generator.uniform(low, high))

    velocity, force = power(-3, 0.5), power(-2, 0.5)
    courses: list[dict[str, object]] = [
        {"shape": "steps", "start": "rest", "times": [0.0], "velocities": [velocity]},
        {"shape": "steps", "times": [0.0, 1e-3], "velocities": [velocity * power(-0.5, 0.5), velocity * power(-1, 1)]},
        {"shape": "steps", "times": [1e-3], "velocities": [velocity], "forces": [force * power(-1, 1)]},
        {"shape": "ramp", "duration": power(-4, -2), "velocity": velocity * power(-1, 1)},
        {"shape": "oscillation", "amplitude": velocity * generator.uniform(0, 1.5), "frequency": power(1, 3)},
    ]
    kelvin = {"shear_modulus": 1e7, "relaxation_time": 1e-3}
    standard = {
        "standard_solid": {"static_modulus": 1e7, "glass_modulus": 1e7 * power(0.3, 2), "relaxation_time": 1e-3}
    }
    prony = {"prony": {"static_modulus": 1e7, "moduli": [3e7, 1e7], "times": [1e-4, 1e-3]}}
    bodies = [kelvin, {"material": standard}, {"material": prony}]
    shapes = [
        {"shape": "plane"},
        {"shape": "plane"},
        {"shape": "parabola", "radius": 0.05},
        {"shape": "cone", "angle": 0.01},
    ]
    return {
        "length": 0.002,
        "points": 20,
        "oversampling": 8,
        "hurst": generator.uniform(0.3, 1),
        "rms_roughness": 2e-6,
        "normal_force": force,
        "velocity": velocity,
        "relaxation_times": TIMES,
        "protocol": courses[generator.integers(len(courses))],
        "indenter": shapes[generator.integers(len(shapes))],
        **bodies[generator.integers(len(bodies))],
    }


def solve(case: dict[str, object], realisation: int) -> dict[str, np.ndarray] | None:
    return alone(MODEL, VelocityJump.model_validate(case), realisation, OUTPUTS, 7)


def solved(cases: int, seed: int) -> Iterator[tuple[float, float, dict[str, object]]]:
    """Yield error and estimate over the largest friction, and the case; cases without a solution are left out."""
    generator = np.random.default_rng(seed)
    for number in range(cases):
        case = random_case(generator)
        coarse = solve(case, number)
        fine = solve(case | {"oversampling": 24, "steps_per_decade": 24}, number)
        if coarse is not None and fine is not None:
            largest = np.max(np.abs(fine[FRICTION]))
            true = float(np.max(np.abs(coarse[FRICTION] - fine[FRICTION])) / largest)
            yield true, float(np.max(coarse[ESTIMATE]) / largest), case


def judged(cases: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return errors and estimates."""
    true, estimate = np.array([row[:2] for row in solved(cases, seed)]).T
    return true, estimate


def main() -> None:
    cases = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    rows = list(solved(cases, 2014))
    true, estimate = np.array([row[:2] for row in rows]).T
    met = true <= np.maximum(estimate, FLOOR)
    print(f"{len(rows)} cases, {cases - len(rows)} failed; estimate covers {100 * met.mean():.1f} %")
    ratio = estimate / np.maximum(true, 1e-12)
    print(f"estimate / error: median {np.median(ratio):.1f}")
    print(f"error: median {np.median(true):.1e}, 95 % below {np.quantile(true, 0.95):.1e}")
    for k in np.flatnonzero(~met):
        case = rows[k][2]
        print(
            f"  {true[k]:.1e} estimated {estimate[k]:.1e}: {case['protocol']}, {case['indenter']}, {'material' in case}"
        )


if __name__ == "__main__":
    main()
