"""The model ehl_line: parameters, units, sharing, failures as data."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from mdr_dask.models.base import Block, Status
from mdr_dask.models.ehl_line import MODEL, STEEL, EhlLineParameters, compute, coordinates, distinct, seconds

CHECKED = {"load_parameter": 2.0452e-5, "speed_parameter": 1e-11, "material_parameter": 5007.0}
#: The same contact in units: R = 20 mm, eta0 = 0.1 Pa s.
DIMENSIONAL = {
    "line_load": 2.0452e-5 * 2 * STEEL * 0.02,
    "mean_velocity": 1e-11 * 2 * STEEL * 0.02 / 0.1,
    "pressure_viscosity": 5007.0 / (2 * STEEL),
    "radius": 0.02,
    "viscosity": 0.1,
}


def block(
    outputs: tuple[str, ...], columns: dict[str, Any] | None = None, realisations: int = 1, **given: Any
) -> Block:
    columns = {name: np.asarray(values) for name, values in (columns or {}).items()}
    cases = max((len(values) for values in columns.values()), default=1)
    parameters = EhlLineParameters(**(given or CHECKED))
    return Block(parameters, columns, cases, tuple(range(realisations)), 1, outputs)


def test_outputs_have_names_of_their_own() -> None:
    assert len({output.name for output in MODEL.outputs}) == len(MODEL.outputs)


def test_checked_figures() -> None:
    result = compute(block(("central_film", "minimum_film", "discretisation_error")))
    assert result.status.tolist() == [[Status.DONE]]
    assert result.values["central_film"][0, 0] == pytest.approx(2.54033e-5, rel=1e-3)  # the accuracy asked for
    assert result.values["minimum_film"][0, 0] == pytest.approx(2.13780e-5, rel=1e-3)
    assert 0 < result.values["discretisation_error"][0, 0] <= 1e-3


def test_units_change_nothing() -> None:
    films = ("central_film", "minimum_film", "central_film_thickness", "minimum_film_thickness")
    here, there = compute(block(films)), compute(block(films, **DIMENSIONAL))
    for name in films[:2]:
        np.testing.assert_allclose(there.values[name], here.values[name], rtol=1e-9)
        np.testing.assert_allclose(there.values[f"{name}_thickness"], 0.02 * there.values[name], rtol=1e-14)
    assert np.isnan(here.values["central_film_thickness"]).all()
    assert "needs radius" in here.messages[0, 0]
    assert not there.messages


@pytest.mark.parametrize("factor", [2.0**-10, 2.0**10])
def test_scaling_lengths_at_the_same_stress_scales_the_films(factor: float) -> None:
    """Radius, line load and velocity by a power of two: every pure number keeps its bits, every length scales."""
    names = ("central_film", "minimum_film", "pressure", "traction_coefficient", "central_film_thickness")
    given = DIMENSIONAL | {"slide_roll_ratio": 0.01}
    scaled = given | {name: factor * given[name] for name in ("radius", "line_load", "mean_velocity")}
    here, there = compute(block(names, **given)).values, compute(block(names, **scaled)).values
    for name in names[:4]:
        np.testing.assert_array_equal(there[name], here[name])
    np.testing.assert_array_equal(there["central_film_thickness"], factor * here["central_film_thickness"])


def test_scaling_stress_and_viscosity_keeps_the_incompressible_film() -> None:
    """Contact modulus, load and viscosity by f, alpha by 1/f: W, U, G and the film stay, pressures scale."""
    names = ("central_film", "minimum_film", "pressure")
    given = DIMENSIONAL | {"compressible": False, "contact_modulus": STEEL}
    scaled = given | {name: 4 * given[name] for name in ("contact_modulus", "line_load", "viscosity")}
    scaled["pressure_viscosity"] = given["pressure_viscosity"] / 4
    here, there = compute(block(names, **given)).values, compute(block(names, **scaled)).values
    for name, factor in zip(names, (1, 1, 4), strict=True):
        np.testing.assert_array_equal(there[name], factor * here[name])


def test_profiles_lie_on_the_positions() -> None:
    result = compute(block(("film", "pressure", "minimum_film", "minimum_position", "spike_position")))
    position = coordinates(EhlLineParameters(**CHECKED))["position"].values
    film, pressure = result.values["film"][0, 0], result.values["pressure"][0, 0]
    assert film.shape == pressure.shape == position.shape == (241,)
    assert film.min() == pytest.approx(result.values["minimum_film"][0, 0], rel=5e-3)  # spacing 0.025
    assert position[np.argmin(film)] == pytest.approx(result.values["minimum_position"][0, 0], abs=0.025)
    p0 = 2 * STEEL * np.sqrt(2.0452e-5 / (2 * np.pi))
    half_width = 0.02 * np.sqrt(8 * 2.0452e-5 / np.pi)
    load = np.trapezoid(pressure, position) * half_width
    assert load == pytest.approx(DIMENSIONAL["line_load"], rel=0.01)  # what lies upstream of -4
    assert pressure.max() > p0


def test_no_film_upstream_of_the_oil() -> None:
    film = compute(block(("film",), **CHECKED, inlet=-1.5)).values["film"][0, 0]
    position = coordinates(EhlLineParameters(**CHECKED))["position"].values
    np.testing.assert_array_equal(np.isnan(film), position < -1.5)


def test_cases_share_what_is_the_same() -> None:
    columns = {
        "slide_roll_ratio": [0.0, 0.02, 0.02],
        "shear_law": np.array(["newtonian", "newtonian", "eyring"], object),
    }
    asked = block(("central_film", "traction_coefficient"), columns)
    result = compute(asked)
    assert result.solves == distinct(asked) == 1
    assert len(set(result.values["central_film"][:, 0])) == 1
    assert result.values["traction_coefficient"][0, 0] == 0
    assert 0 < result.values["traction_coefficient"][2, 0] < result.values["traction_coefficient"][1, 0]


def test_a_value_does_not_depend_on_its_block() -> None:
    columns = {"load_parameter": [2e-6, 5e-5, 5e-4], "viscosity_law": np.array(["barus", "roelands", "barus"], object)}
    outputs = ("central_film", "minimum_film", "film", "pressure", "traction_coefficient")
    whole = block(outputs, columns, 2, **(CHECKED | {"viscosity": 0.05, "slide_roll_ratio": 0.01}))
    together = compute(whole)
    for index in range(3):
        alone = compute(whole.part(index, 1))
        for name in outputs:
            assert together.values[name][index, 1].tobytes() == alone.values[name][0, 0].tobytes()
    assert together.solves == 3


def test_neighbours_change_a_film_within_its_accuracy_and_whatever_the_block() -> None:
    speeds = np.geomspace(1e-12, 1e-11, 6)
    films = ("central_film", "discretisation_error")
    alone = compute(block(films, {"speed_parameter": speeds}))
    swept = compute(block(films, {"speed_parameter": speeds}, **CHECKED, neighbours=True))
    np.testing.assert_allclose(swept.values["central_film"], alone.values["central_film"], rtol=2e-3)
    assert np.all(swept.values["discretisation_error"] <= 1e-3)
    part = compute(block(films, {"speed_parameter": speeds[4:2:-1], "neighbours": [True, False]}))
    assert part.values["central_film"][0, 0] == swept.values["central_film"][4, 0]
    assert part.values["central_film"][1, 0] == alone.values["central_film"][3, 0]


def test_extremes_are_data_not_warnings() -> None:
    """No case of an absurd box raises, warns, or gives a film that is not positive."""
    random = np.random.default_rng(3)
    columns = {
        "load_parameter": 10 ** random.uniform(-9, -1, 12),
        "speed_parameter": 10 ** random.uniform(-18, -4, 12),
        "material_parameter": 10 ** random.uniform(0, 5, 12),
        "inlet": np.array([None, -0.01, -1.0, -1e6] * 3, object),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = compute(block(tuple(output.name for output in MODEL.outputs), columns))
    films = result.values["minimum_film"][:, 0]
    done = result.status[:, 0] == Status.DONE
    assert np.all(films[done] > 0)
    assert np.all(np.isnan(films[~done]))
    assert all((index, 0) in result.messages for index in np.flatnonzero(~done))


def test_formula_is_given_with_its_range() -> None:
    result = compute(block(("formula_central_film",), {"load_parameter": [2e-6, 1e-4]}, **CHECKED))
    assert "W = 2e-06 is outside" in result.messages[0, 0]
    assert (1, 0) not in result.messages


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "expected either load_parameter or line_load, got neither"),
        (CHECKED | {"line_load": 1.0}, "got load_parameter and line_load"),
        ({k: v for k, v in DIMENSIONAL.items() if k != "radius"}, "line_load needs radius"),
        (CHECKED | {"viscosity_law": "roelands"}, "roelands needs viscosity"),
        (CHECKED | {"speed_parameter": 0.0}, "greater than 0"),
        (CHECKED | {"inlet": 1.0}, "less than 0"),
        (CHECKED | {"profile_start": 3.0}, "expected profile_end above profile_start 3, got 2"),
    ],
)
def test_bad_parameters(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        EhlLineParameters(**given)


def test_estimate_grows_with_cases_and_accuracy() -> None:
    one = block(("central_film",))
    many = block(("central_film",), {"load_parameter": np.full(10, 1e-5)})
    assert seconds(many) == pytest.approx(10 * seconds(one))


def test_the_example_of_the_page_runs(capsys: pytest.CaptureFixture[str]) -> None:
    page = (Path(__file__).parents[2] / "docs/ehl.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", page, flags=re.M | re.S)
    assert len(blocks) == 1
    exec(blocks[0], {})
    assert re.match(r"h_c/R = 2\.54\de-05, h_min/R = 2\.13\de-05\n", capsys.readouterr().out)
