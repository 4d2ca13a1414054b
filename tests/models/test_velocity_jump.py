"""The model velocity_jump: values, shared solutions, errors and failed cases."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from jump_blocks import BASE, block
from pydantic import ValidationError

from mdr_dask.models.base import Block, Result, Status
from mdr_dask.models.sliding_friction import SlidingFriction
from mdr_dask.models.sliding_friction import solve as sliding
from mdr_dask.models.velocity_jump import MODEL
from mdr_dask.models.velocity_jump.solve import compute
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.transients import accuracy as jumps

LINE = BASE | {"points": 400, "relaxation_times": (0.01, 0.1, 1.0, 10.0)}
of_line = partial(block, **LINE)


def test_a_transient_that_misses_the_accuracy_has_a_warning() -> None:
    coarse = of_line({"velocity": np.array([0.05])}, (0, 1), hurst=0.3, oversampling=2, steps_per_decade=4)
    assert not compute(coarse).messages
    messages = compute(replace(coarse, accuracy=0.01)).messages
    assert all("is missed; estimated relative errors: friction_coefficient " in messages[0, line] for line in (0, 1))


def test_equal_cases_are_solved_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four of the five cases have the same dimensionless numbers, reached through different parameters."""
    solved: list[int] = []
    solve = jumps.jump_between

    def counted(*arguments: Any) -> Any:
        found = solve(*arguments)
        solved.append(1)
        return found

    monkeypatch.setattr(jumps, "jump_between", counted)
    same = of_line(
        {
            "shear_modulus": np.array([1e7, 2e7, 1e7, 1e7, 1e7]),
            "normal_force": np.array([0.1, 0.2, 10.0, 0.1, 0.1]),
            "length": np.array([0.002, 0.002, 0.02, 0.002, 0.002]),
            "rms_roughness": np.array([2e-6, 2e-6, 2e-5, 2e-6, 2e-6]),
            "velocity": np.array([0.05, 0.05, 0.5, 0.1, 0.06]),
            "relaxation_time": np.array([1e-3, 1e-3, 1e-3, 5e-4, 1e-3]),
        }
    )
    result = compute(same)
    assert len(solved) == 2 * 2 * len(same.realisations)  # two different cases, each on two grids for its error
    assert result.solves == 2 * len(same.realisations)


def test_jump_follows_the_slope_in_region_one() -> None:
    """In region I, friction is proportional to the velocity (eq. 4.9) and does not relax after the jump."""
    result = compute(of_line({}, velocity=1e-6)).values
    before, jump = result["friction_coefficient_before"], result["friction_coefficient_jump"]
    assert np.allclose(jump / before, 0.2, rtol=2e-3)
    after = result["friction_coefficient_after"]
    assert np.allclose(before + jump, after, rtol=2e-3)


def test_error_of_the_transient_covers_it() -> None:
    coarse = compute(of_line({}, tuple(range(6))))
    fine = compute(of_line({}, tuple(range(6)), oversampling=32, steps_per_decade=96))
    for name in ("friction_coefficient", "indentation_depth"):
        error = np.abs(coarse.values[name] - fine.values[name])
        assert np.mean(error <= coarse.values[f"{name}_error"]) > 0.8, name


def test_bad_line_is_a_status() -> None:
    result = compute(of_line({}, longest_wavelength=1e-6))
    assert np.all(result.status == Status.FAILED)
    assert all("longest wavelength" in message for message in result.messages.values())
    assert np.all(np.isnan(result.values["friction_coefficient"]))


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("velocity_change", 0.0, "expected a velocity_change farther from 0"),
        ("velocity_change", 1e-17, "expected a velocity_change farther from 0"),
        ("normal_force", -1.0, "the load must be positive and finite, got -1"),
        ("normal_force", 1e300, "check the units"),
    ],
)
def test_impossible_jumps_are_failed_cases_with_a_message_in_every_realisation(name, value, message) -> None:
    result = compute(of_line({name: np.array([LINE.get(name, 0.2), value])}))
    assert result.status.tolist() == [[Status.DONE] * 2, [Status.FAILED] * 2]
    assert [message in result.messages.get((1, r), "") for r in (0, 1)] == [True] * 2
    assert {case for case, _ in result.messages} == {1}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"velocity_change": 0.0}, "other than 0"),
        ({"relaxation_times": (1.0, 0.5)}, "increasing times"),
        ({"velocity_change": -1.0}, "greater than -1"),
    ],
)
def test_impossible_parameters_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        of_line(**change)


def test_depth_of_a_jump_comes_from_the_march() -> None:
    """The depth begins and ends at the steady depths, and agrees with the solution for any history."""
    found = compute(of_line({}, relaxation_times=(0.0, 0.5, 20.0), velocity_change=-0.5)).values["indentation_depth"]
    steady = [compute_friction(1e-4, (0, 3), velocity=v).values["indentation_depth"][0] for v in (0.05, 0.025)]
    assert np.allclose(found[0, :, 0], steady[0], rtol=1e-4)
    assert np.allclose(found[0, :, 2], steady[1], rtol=1e-4)
    step = {"shape": "steps", "times": [0.0], "velocities": [0.025]}
    followed = compute(of_line({}, relaxation_times=(0.0, 0.5, 20.0), protocol=step, oversampling=8))
    assert np.allclose(found, followed.values["indentation_depth"], rtol=2e-4)


def compute_friction(accuracy: float, realisations: tuple[int, ...], **case: object) -> Result:
    """Solve steady sliding of the same body."""
    shared = {k: v for k, v in (LINE | case).items() if k not in ("relaxation_times", "velocity_change")}
    outputs = ("friction_coefficient", "indentation_depth")
    return sliding.compute(Block(SlidingFriction.model_validate(shared), {}, 1, realisations, 5, outputs, accuracy))


def random_jump(seed: int) -> dict[str, object]:
    """Return the parameters of a random jump."""
    generator = np.random.default_rng(seed)
    hurst, points = float(generator.uniform(0, 1)), int(generator.choice([16, 32, 64, 200]))
    slope = roughness.spectral_slope(roughness.amplitudes(points // 2, hurst))
    deborah = 10 ** generator.uniform(-2.5, 1.5) / slope
    force = 4 * 1e7 * 0.002 * 2e-6 * 10 ** generator.uniform(-3, 0.5)
    change = float(generator.choice([-0.9, -0.5, -0.2, 0.2, 1.0, 9.0]))
    return {
        "hurst": hurst,
        "points": points,
        "normal_force": force,
        "velocity": deborah * 0.002 / 1e-3,
        "velocity_change": change,
        "relaxation_times": (0.01, 1.0),
    }


ENDS = ("friction_coefficient_before", "friction_coefficient_jump", "friction_coefficient_after")


@pytest.mark.parametrize("seed", range(0, 60, 15))
def test_ends_are_the_steady_solvers(seed: int) -> None:
    case = random_jump(seed)
    found = compute(Block(of_line(**case).parameters, {}, 1, (seed,), 5, MODEL.with_companions(ENDS), 0.01)).values
    for name, change in (("before", 0.0), ("after", case["velocity_change"])):
        truth = compute_friction(1e-5, (seed,), **case | {"velocity": case["velocity"] * (1 + change)})
        exact = truth.values["friction_coefficient"][0, 0]
        assert found[f"friction_coefficient_{name}"][0, 0] == pytest.approx(exact, rel=0.01)


def test_a_small_transient_with_coarse_steps_ends_at_the_steady_friction() -> None:
    """Friction changes by 0.7 % only, and time steps of a quarter of a decade have an error of 0.03 %."""
    scene = {"length": 0.01, "points": 5000, "hurst": 1.0, "rms_roughness": 1e-5, "normal_force": 1.2}
    few = of_line(**scene, velocity=4.5203536563602, velocity_change=0.2, oversampling=4, steps_per_decade=4)
    found = compute(Block(few.parameters, {}, 1, (128,), 2014, ("friction_coefficient", "friction_coefficient_after")))
    assert found.status[0, 0] == Status.DONE
    after = found.values["friction_coefficient_after"][0, 0]
    assert abs(found.values["friction_coefficient"][0, 0, -1] / after - 1) < 1e-3
