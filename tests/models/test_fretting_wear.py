import numpy as np
import pytest
from pydantic import ValidationError

from mdr_dask.models.base import Block, Status
from mdr_dask.models.data_file import DataFile
from mdr_dask.models.fretting_wear import MODEL
from mdr_dask.models.fretting_wear.declaration import Cone, FrettingWear, LoadStep, Parabola, Power, Table
from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.wear import rules as wear
from mdr_dask.physics.wear.exact import exact

STEEL = {
    "indenter": Parabola(radius=0.01),
    "contact_modulus": 115e9,
    "effective_shear_modulus": 90e9,
    "friction": 0.6,
    "amplitude": 1e-6,
    "normal_force": 50.0,
    "hardness": 2e9,
    "wear_coefficient": 1e-4,
    "cycles": 1e5,
}
BALL = np.linspace(0, 1e-3, 201).tolist()
SCALARS = ("contact_radius", "wear_volume", "wear_volume_error", "contact_force", "stick_border")


def run(parameters, columns=None, outputs=SCALARS, realisations=(0,), seed=1):
    columns = columns or {}
    cases = len(next(iter(columns.values()))) if columns else 1
    return MODEL.compute(Block(parameters, columns, cases, realisations, seed, outputs))


@pytest.mark.parametrize("wear_rule", ["limit", "fast", "exact"])
def test_every_rule_has_every_output(wear_rule):
    outputs = MODEL.with_companions([output.name for output in MODEL.outputs])
    result = run(FrettingWear(stick_radius=0.5, cycles=0.5, wear_rule=wear_rule, cells=40), outputs=outputs)
    assert result.status[0, 0] == Status.DONE
    for name, array in result.values.items():
        shape = (1, 1, *(161 if dim != "block" else 1 for dim in MODEL.output(name).dims))
        assert array.shape == shape
        assert np.all(np.isfinite(array[..., 1:])), name
    r = MODEL.coordinates(FrettingWear(stick_radius=0.5))["radius"].values
    f, p = result.values["worn_profile"][0, 0], result.values["pressure"][0, 0]
    assert np.all(f >= r**2 / 2 - 1e-12)
    assert np.all(p[r > result.values["contact_radius"][0, 0]] == 0)
    assert result.values["worn_depth"][0, 0] == pytest.approx(np.max(f - r**2 / 2), abs=0.01)


def test_dimensional_case_is_the_dimensionless_one_in_its_units():
    result = run(FrettingWear(**STEEL, wear_rule="exact"))
    R, E, F = 0.01, 115e9, 50.0
    a0 = (3 * F * R / (4 * E)) ** (1 / 3)
    d0 = a0**2 / R
    c = np.sqrt(1 - 90e9 * 1e-6 / (0.6 * E * d0))
    N = 1e5 * 4 * 1e-6 * 1e-4 * E / (a0 * 2e9)
    worn = exact(PowerProfile(2.0), c, [N], 1e-3)[0]
    assert result.values["wear_volume"][0, 0] == pytest.approx(worn.wear_volume * a0**2 * d0, rel=1e-8)
    assert result.values["contact_force"][0, 0] == pytest.approx(worn.normal_force * E * a0 * d0, rel=1e-8)
    assert result.values["stick_border"][0, 0] == pytest.approx(c * a0, rel=1e-10)


SCATTERED = {
    # few cycles: the volume is proportional to the coefficient, and 1 - c^2 to the amplitude over the friction
    "wear_coefficient_scatter": (0.3, "wear_volume", lambda volume: volume),
    "friction_scatter": (0.02, "stick_border", lambda border: 1 / (1 - border**2)),
    "amplitude_scatter": (0.02, "stick_border", lambda border: 1 - border**2),
}


@pytest.mark.parametrize("source", SCATTERED)
def test_scatter_has_the_asked_width_and_leaves_the_mean(source):
    width, output, factor_of = SCATTERED[source]
    case = {"wear_rule": "fast", "stick_radius": 0.455, "cycles": 0.01}
    scattered, plain = (
        run(FrettingWear(**case, **scatter), outputs=(output,), realisations=tuple(range(count))).values[output][0]
        for scatter, count in (({source: width}, 4000), ({}, 1))
    )
    factor = factor_of(scattered) / factor_of(plain)
    # 5 standard errors of 4000 samples; those of a skewed factor are larger
    assert np.std(factor) == pytest.approx(width, rel=max(0.1, 5 / np.sqrt(8000)))
    assert np.mean(factor) == pytest.approx(1.0, abs=5 * width / np.sqrt(4000))


def test_constant_force():
    """The force stays, depth and border grow, and the limit comes last; the fast rule is refused."""
    names = ("contact_force", "block_depth", "stick_border", "wear_volume", "worn_profile", "worn_image", "pressure")
    found = {}
    for rule in ("exact", "limit"):
        parameters = FrettingWear(stick_radius=0.5, cycles=0.3, wear_rule=rule, hold="force", cells=60, points=21)
        result = run(parameters, outputs=names)
        assert result.status[0, 0] == Status.DONE
        assert result.values["contact_force"][0, 0] == pytest.approx(4 / 3, rel=1e-3)
        assert np.all(np.isfinite(result.values["worn_profile"]))
        found[rule] = {name: float(np.ravel(result.values[name][0, 0])[0]) for name in names}
    for name in ("block_depth", "stick_border"):
        assert found["limit"][name] > found["exact"][name]
    assert found["limit"]["wear_volume"] > 10 * found["exact"]["wear_volume"]
    with pytest.raises(ValidationError, match="`wear_rule: fast` is for constant depth only"):
        FrettingWear(stick_radius=0.5, cycles=0.3, wear_rule="fast", hold="force")
    columns = {"wear_rule": np.array(["fast", "exact"]), "hold": np.array(["force", "force"])}
    mixed = run(FrettingWear(stick_radius=0.5, cycles=0.3), columns)
    assert mixed.status[:, 0].tolist() == [Status.FAILED, Status.DONE]
    assert "constant depth only" in mixed.messages[0, 0]


@pytest.mark.parametrize(
    ("settings", "outputs", "said"),
    [
        ({"extent": 1.2}, ("worn_profile",), "raise extent"),
        ({"extent": 1.2}, ("wear_volume", "pressure"), "raise extent"),
        ({"extent": 1.2}, ("wear_volume",), ""),
        ({"extent": 1.3}, ("worn_profile",), ""),
        ({"extent": 1.2, "wear_rule": "limit"}, ("worn_image",), "raise extent"),
        ({"history": (LoadStep(cycles=8.0),), "cells": 60, "extent": 1.2}, ("block_worn_profile",), "raise extent"),
    ],
)
def test_profiles_that_end_inside_the_scar_are_named(settings, outputs, said):
    """The radius of the scar is 1.24 after 8 cycles, and 1.25 in the end."""
    cycles = {} if "history" in settings else {"cycles": 8.0}
    result = run(FrettingWear(stick_radius=0.455, **cycles, **settings), outputs=outputs)
    assert result.status[0, 0] == Status.DONE
    assert said in result.messages.get((0, 0), "")
    assert bool(said) == bool(result.messages)


def test_operations_count_the_cases_of_both_kinds():
    def count(hold, columns):
        given = FrettingWear(**STEEL | {"wear_rule": "limit", "hold": hold})
        return MODEL.operations(Block(given, columns, 2, (0,), 1, ("worn_profile",)))

    separate = count("depth", {}) + count("force", {})
    both = {"hold": np.array(["depth", "force"])}
    assert count("depth", both) == count("force", both) == separate


def test_a_history_may_slip_everywhere():
    history = (LoadStep(cycles=1e4),)
    steel = {name: value for name, value in STEEL.items() if name != "cycles"} | {"amplitude": 1e-4}
    result = run(FrettingWear(**steel, wear_rule="exact", history=history, cells=60))
    assert result.status[0, 0] == Status.DONE
    assert result.values["stick_border"][0, 0] == 0.0
    assert result.values["wear_volume"][0, 0] > 0


def test_table_of_a_ball(tmp_path):
    (tmp_path / "ball.csv").write_text("radius [m],height [m]\n" + "\n".join(f"{x!r},{x**2 / 0.02!r}" for x in BALL))
    shape = Table(shape="table", file=DataFile.of(tmp_path / "ball.csv"))
    pressed = STEEL | {"normal_force": None, "depth": 4.7e-6}
    measured, smooth = run(FrettingWear(**pressed | {"indenter": shape})), run(FrettingWear(**pressed))
    for name in ("wear_volume", "contact_radius", "contact_force"):
        assert measured.values[name][0, 0] == pytest.approx(smooth.values[name][0, 0], rel=1e-5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"depth": 1e-6}, "either normal_force or depth"),
        ({"friction": None}, "missing: friction"),
        ({"indenter": Cone(shape="cone")}, "missing: indenter.angle"),
    ],
)
def test_bad_parameters(changes, message):
    with pytest.raises(ValidationError, match=message):
        FrettingWear(**{**STEEL, **changes})


@pytest.mark.parametrize("hold", ["depth", "force"])
@pytest.mark.parametrize("c", [0.9999, 1 - 1e-6, 1 - 1e-9])
def test_next_to_full_stick_little_is_worn_and_nothing_fails(hold, c):
    """Few cycles wear N p0 s0, many the limit; the reason of a failure is never an exception's own text."""
    width = np.sqrt(1 - c * c)  # the time in which such a contact changes
    cycles = np.array([1e-3 * width, 3.0])
    result = run(FrettingWear(stick_radius=c, hold=hold), {"cycles": cycles})
    assert np.all(result.status == Status.DONE)
    assert result.messages == {}
    limit = wear.limit(PowerProfile(2.0), c).wear_volume
    # to first order V = 2 N int (1 - g0)(g0 - g_c) / eta dx, next to full stick N eta (1 - c) / 3
    first = cycles[0] * (1 - c * c) * (1 - c) / 3
    assert result.values["wear_volume"][0, 0] == pytest.approx(first, rel=3e-3 + 2 * (1 - c))
    assert result.values["wear_volume"][1, 0] == pytest.approx(limit, rel=2e-3)


def test_a_relative_accuracy_is_met_or_the_output_that_misses_it_is_named():
    names = ("wear_volume", "wear_volume_error", "worn_profile")
    parameters = FrettingWear(stick_radius=0.455)
    for accuracy in (1e-2, 1e-8):
        columns = {"cycles": np.array([0.5, 2.0])}
        result = MODEL.compute(Block(parameters, columns, 2, (0, 1), 1, names, accuracy))
        share = result.values["wear_volume_error"] / result.values["wear_volume"]
        assert np.all(result.status == Status.DONE)
        if accuracy == 1e-2:
            assert np.all(share <= accuracy)
            assert result.messages == {}
        else:
            assert set(result.messages) == {(case, position) for case in (0, 1) for position in (0, 1)}
            assert all("wear_volume " in text and "worn_profile " in text for text in result.messages.values())
            assert all("an accuracy of 1e-08 is missed; " in text for text in result.messages.values())
        alone = MODEL.compute(Block(parameters, {"cycles": columns["cycles"][1:]}, 1, (0,), 1, names, accuracy))
        assert alone.values["wear_volume"][0, 0] == result.values["wear_volume"][1, 0]


LISTED = {"indenter", "amplitude", "cycles"}


@pytest.mark.parametrize(
    ("indenter", "path", "values"),
    [
        (Parabola(radius=0.01), "indenter.radius", [0.005, 0.02]),
        (Cone(shape="cone", angle=0.1), "indenter.angle", [0.05, 0.2]),
        (Power(shape="power", coefficient=20.0, exponent=3.0), "indenter.coefficient", [1e5, 4e5]),
        (Power(shape="power", coefficient=20.0, exponent=3.0), "indenter.exponent", [1.5, 2.5]),
        *((STEEL["indenter"], name, [0.1 * STEEL[name], 0.2 * STEEL[name]]) for name in ("amplitude", "cycles")),
        *((STEEL["indenter"], name, [0.9 * STEEL[name], 0.8 * STEEL[name]]) for name in STEEL if name not in LISTED),
    ],
)
def test_an_axis_over_any_number_gives_what_single_cases_give(indenter, path, values):
    given = FrettingWear(**STEEL | {"indenter": indenter, "amplitude": 2e-7, "wear_rule": "fast"})
    together = run(given, {path: np.array(values)})
    assert np.all(together.status == Status.DONE)
    assert np.ptp(together.values["wear_volume"]) > 1e-3 * np.max(together.values["wear_volume"])
    *_, name = path.split(".")
    for case, value in enumerate(values):
        changed = {"indenter": indenter.model_copy(update={name: value})} if "." in path else {name: value}
        alone = run(given.model_copy(update=changed))
        for output in SCALARS:
            assert together.values[output][case] == pytest.approx(alone.values[output][0], rel=1e-9, nan_ok=True)
