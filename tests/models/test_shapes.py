"""A rounded cone slides and wears, and tends to a cone and to a parabola in its limits."""

import numpy as np
import pytest
from test_extremes import KELVIN, LINE, WEAR

from mdr_dask.models import fretting_wear, sliding_friction
from mdr_dask.models.base import Block, Status
from mdr_dask.models.fretting_wear.declaration import FrettingWear
from mdr_dask.models.sliding_friction.declaration import SlidingFriction
from mdr_dask.physics.mdr.revolution import PowerProfile, from_body
from mdr_dask.physics.mdr.transforms import forward_transform
from mdr_dask.physics.surfaces.shapes import PowerLaw, RoundedCone
from mdr_dask.physics.wear.rules import limit

STEEL = WEAR | {"amplitude": 5e-6, "cycles": 1e5, "depth": 20e-6}
RUBBER = LINE | KELVIN | {"rms_roughness": 1e-7, "normal_force": 0.2, "velocity": 0.01, "oversampling": 128}
SHARP = {"shape": "rounded_cone", "angle": 0.1, "tip_radius": 1e-8}
BLUNT = {"shape": "rounded_cone", "angle": 1.2, "tip_radius": 0.01}
CONE, PARABOLA = {"shape": "cone", "angle": 0.1}, {"shape": "parabola", "radius": 0.01}


def test_line_of_a_rounded_cone_is_the_transform_of_its_body():
    shape, x = RoundedCone(0.3, 0.5), np.array([0.1, 0.4, 0.6, 1.0, 3.0])
    found = forward_transform(lambda r: shape.body(r)[1], x, breaks=shape.breaks, tolerance=1e-12).value
    line, slope, _ = shape.at(x)
    np.testing.assert_allclose(-line, found, rtol=1e-10)
    step = 1e-6
    np.testing.assert_allclose(slope, (shape.at(x + step)[0] - shape.at(x - step)[0]) / (2 * step), rtol=1e-7)
    np.testing.assert_allclose(shape.scaled(2.0, 5.0).at(x / 2.0)[0], line / 5.0, rtol=1e-12)


@pytest.mark.parametrize("exponent", [1.0, 2.0, 3.0])
def test_a_body_pressed_to_a_depth_is_its_power_law(exponent):
    pressed, power = from_body(PowerLaw.of_body(0.7, exponent), 0.3), PowerProfile(exponent)
    x = np.linspace(0.0, 3.0, 200)
    np.testing.assert_allclose(pressed.image(x), power.image(x), atol=1e-5)
    np.testing.assert_allclose(pressed.height(x), power.height(x), atol=1e-5)
    assert limit(pressed, 0.4).wear_volume == pytest.approx(limit(power, 0.4).wear_volume, rel=1e-4)


@pytest.mark.parametrize(("body", "power"), [(SHARP, CONE), (BLUNT, PARABOLA)], ids=["cone", "parabola"])
def test_a_rounded_cone_wears_and_slides_like_what_it_tends_to(body, power):
    worn, slid = [], []
    for indenter in (body, power):
        outputs = ("wear_volume", "contact_radius", "contact_force")
        wear = FrettingWear.model_validate({**STEEL, "indenter": indenter})
        found = fretting_wear.MODEL.compute(Block(wear, {}, 1, (0,), 1, outputs))
        assert found.status[0, 0] == Status.DONE, found.messages
        worn.append([found.values[name][0, 0] for name in outputs])
        outputs = ("friction_coefficient", "indentation_depth")
        sliding = SlidingFriction.model_validate({**RUBBER, "indenter": indenter})
        found = sliding_friction.MODEL.compute(Block(sliding, {}, 1, (0,), 1, outputs))
        assert found.status[0, 0] == Status.DONE, found.messages
        slid.append([found.values[name][0, 0] for name in outputs])
    np.testing.assert_allclose(worn[0], worn[1], rtol=5e-3)
    np.testing.assert_allclose(slid[0], slid[1], rtol=5e-3)


def test_every_angle_of_an_axis_is_pressed_by_itself():
    wear = FrettingWear.model_validate({**STEEL, "indenter": {**SHARP, "tip_radius": 1e-3}, "wear_rule": "limit"})
    columns, outputs = {"indenter.angle": np.array([0.08, 0.16])}, ("contact_radius",)
    both = fretting_wear.MODEL.compute(Block(wear, columns, 2, (0,), 1, outputs)).values["contact_radius"][:, 0]
    for angle, radius in zip(columns["indenter.angle"], both, strict=True):
        one = wear.model_copy(update={"indenter": wear.indenter.model_copy(update={"angle": float(angle)})})
        assert fretting_wear.MODEL.compute(Block(one, {}, 1, (0,), 1, outputs)).values["contact_radius"][0, 0] == radius


def test_a_rounded_cone_needs_a_depth():
    with pytest.raises(ValueError, match="a rounded_cone needs a dimensional campaign: give depth"):
        FrettingWear.model_validate({"stick_radius": 0.5, "indenter": SHARP})
