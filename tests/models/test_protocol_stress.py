"""Extreme histories of velocity and load give a finite value with an error, or a failed status with a message."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jump_blocks import block

from mdr_dask.models.base import Status
from mdr_dask.models.velocity_jump.solve import compute

pytestmark = pytest.mark.slow

LINE = {"points": 16, "oversampling": 4, "relaxation_times": (0.0, 0.05, 0.5, 1.0, 2.0)}
TERMS = {
    "prony": {
        "static_modulus": 1e7,
        "moduli": [1e6 * (1 + m % 3) for m in range(50)],
        "times": [float(t) for t in np.geomspace(1e-7, 1e-3, 50)],
    }
}


def solved(**changes: object) -> tuple[dict[str, np.ndarray], int, str]:
    result = compute(block(realisations=(0, 1), **LINE | changes))
    return {k: v[0, 0] for k, v in result.values.items()}, int(result.status[0, 0]), result.messages.get((0, 0), "")


def check(**changes: object) -> None:
    values, status, message = solved(**changes)
    if status == Status.DONE:
        assert np.all(np.isfinite(values["friction_coefficient"]))
        assert np.all(values["friction_coefficient_error"] >= 0)
    else:
        assert message
        assert np.all(np.isnan(values["friction_coefficient"]))


def powers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda x: float(10**x))


def shares(most: float) -> st.SearchStrategy[float]:
    """Draw fractions of a value: zero, or not smaller than a campaign allows."""
    return st.one_of(st.just(0.0), st.floats(1e-12, most))


SPEEDS = st.one_of(st.just(0.0), powers(-6, 0), powers(-3, 0).map(lambda v: -v))


@settings(max_examples=25, deadline=None)
@given(
    speeds=st.lists(SPEEDS, min_size=3, max_size=3),
    forces=st.lists(powers(-5, 3), min_size=3, max_size=3),
    start=st.sampled_from(["rest", "steady"]),
    body=st.sampled_from(["kelvin", "standard_solid", "prony"]),
)
def test_steps_of_velocity_and_load(speeds: list[float], forces: list[float], start: str, body: str) -> None:
    """Phases at rest and of reversed sliding, and jumps of the load by up to eight decades."""
    steps = {"shape": "steps", "start": start, "times": [0.0, 5e-4, 1e-3], "velocities": speeds, "forces": forces}
    check(protocol=steps, **of(body))


def of(body: str) -> dict[str, object]:
    if body == "kelvin":
        return {}
    solid = {"standard_solid": {"static_modulus": 1e7, "glass_modulus": 1e9, "relaxation_time": 1e-3}}
    return {"shear_modulus": None, "relaxation_time": None, "material": solid if body == "standard_solid" else TERMS}


@settings(max_examples=12, deadline=None)
@given(frequency=powers(0, 5), part=shares(3), load=shares(0.999), force=powers(-5, 2))
def test_slow_and_fast_oscillation(frequency: float, part: float, load: float, force: float) -> None:
    swing = {"shape": "oscillation", "amplitude": 0.05 * part, "frequency": frequency, "force_amplitude": force * load}
    check(protocol=swing, normal_force=force)


@pytest.mark.parametrize("hurst", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [1e-12, 1e-3])
def test_nearly_flat_and_very_rough_lines(hurst: float, roughness: float) -> None:
    steps = {"shape": "steps", "times": [0.0], "velocities": [0.06]}
    check(protocol=steps, hurst=hurst, rms_roughness=roughness)
