"""Sliding friction for parameters over fifteen decades, and for very light contacts."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mdr_dask.models.base import Block, Status
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction

ALL = MODEL.with_companions([output.name for output in MODEL.outputs])
LINE = {"length": 0.02, "points": 64, "rms_roughness": 5e-7}
KELVIN = {"shear_modulus": 1e7, "relaxation_time": 1e-3}
SOLID = {"standard_solid": {"static_modulus": 1e7, "glass_modulus": 5e8, "relaxation_time": 1e-3}}
BODIES = [
    {"shape": "plane"},
    {"shape": "cone", "angle": 0.2},
    {"shape": "parabola", "radius": 0.01},
    {"shape": "power", "exponent": 4.0, "coefficient": 1e3},
]
fifteen_decades = st.floats(-7.5, 7.5)


def solved(parameters, columns=None, realisations=(0,), accuracy=None):
    columns = {name: np.asarray(values) for name, values in (columns or {}).items()}
    cases = len(next(iter(columns.values()))) if columns else 1
    block = Block(SlidingFriction.model_validate(parameters), columns, cases, realisations, 7, ALL, accuracy)
    return MODEL.compute(block)


def assert_answers_or_says_why(result):
    """Check that every result is within physical bounds, or has a status with a message and no numbers."""
    for place in np.ndindex(result.status.shape):
        found = {name: result.values[name][place] for name in ALL}
        if result.status[place] != Status.DONE:
            assert result.messages[place]
            assert np.all(np.isnan(list(found.values())))
            continue
        assert all(np.isfinite(value) for name, value in found.items() if not name.endswith("_error"))
        assert found["friction_coefficient"] >= -found["friction_coefficient_error"]
        assert 0 <= found["contact_fraction"] <= 1 + 1e-9
        assert all(found[name] >= 0 for name in found if name.endswith("_error"))


@settings(max_examples=30, deadline=None)
@example(0.0, -6.0, 3.0, 4.0, 6.0, BODIES[1], 1, "hermite", False)  # the load is lost to rounding errors of the line
@example(0.0, 0.0, 4.0, 7.0, 7.0, BODIES[0], "auto", "hermite", True)  # friction is lost to rounding errors
@given(
    hurst=st.floats(0, 1),
    force=fifteen_decades,
    velocity=fifteen_decades,
    modulus=fifteen_decades,
    rms=fifteen_decades,
    body=st.sampled_from(BODIES),
    grid=st.sampled_from([1, 4, "auto"]),
    scheme=st.sampled_from(["hermite", "backward_euler"]),
    general=st.booleans(),
)
def test_fifteen_decades_of_everything(hurst, force, velocity, modulus, rms, body, grid, scheme, general):
    numbers = {"normal_force": 10**force, "velocity": 0.1 * 10**velocity, "rms_roughness": 5e-7 * 10**rms}
    if general:
        scaled = {
            name: value * 10**modulus if name != "relaxation_time" else value
            for name, value in SOLID["standard_solid"].items()
        }
        material = {"material": {"standard_solid": scaled}}
        grid = 4 if grid == 1 else grid
    else:
        material = KELVIN | {"shear_modulus": 1e7 * 10**modulus}
    parameters = LINE | numbers | material | {"hurst": hurst, "indenter": body, "oversampling": grid, "scheme": scheme}
    assert_answers_or_says_why(solved(parameters, realisations=(0, 5)))
