"""The model ehl_line: parameters, units, shared solutions, errors and failed cases."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from mdr_dask.models.base import Block, Status
from mdr_dask.models.ehl_line.declaration import MODEL, STEEL, EhlLineParameters, coordinates
from mdr_dask.models.ehl_line.solve import compute
from mdr_dask.physics.lubrication.line_contact import ACCURACY

CHECKED = {"load_parameter": 2.0452e-5, "speed_parameter": 1e-11, "material_parameter": 5007.0}
#: The same contact by quantities with units: R = 20 mm, eta0 = 0.1 Pa s.
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
    return Block(parameters, columns, cases, tuple(range(realisations)), 1, MODEL.with_companions(outputs))


def test_checked_figures() -> None:
    result = compute(block(("central_film", "minimum_film")))
    assert result.status.tolist() == [[Status.DONE]]
    assert result.values["central_film"][0, 0] == pytest.approx(2.54033e-5, rel=1e-3)  # the accuracy of the model
    assert result.values["minimum_film"][0, 0] == pytest.approx(2.13780e-5, rel=1e-3)
    for name in ("central_film", "minimum_film"):
        assert 0 < result.values[f"{name}_error"][0, 0] <= ACCURACY * result.values[name][0, 0]
    assert not result.messages


def test_units_change_nothing() -> None:
    films = ("central_film", "minimum_film", "central_film_thickness", "minimum_film_thickness")
    here, there = compute(block(films)), compute(block(films, **DIMENSIONAL))
    for name in films[:2]:
        np.testing.assert_allclose(there.values[name], here.values[name], rtol=1e-9)
        np.testing.assert_allclose(there.values[f"{name}_thickness"], 0.02 * there.values[name], rtol=1e-14)
    assert np.isnan(here.values["central_film_thickness"]).all()
    assert "needs the parameter `radius`" in here.messages[0, 0]
    assert not there.messages


def test_profiles_lie_on_the_positions() -> None:
    result = compute(block(("film", "pressure", "minimum_film")))
    position = coordinates(EhlLineParameters(**CHECKED))["position"].values
    film, pressure = result.values["film"][0, 0], result.values["pressure"][0, 0]
    assert film.shape == pressure.shape == position.shape == (241,)
    assert film.min() == pytest.approx(result.values["minimum_film"][0, 0], rel=5e-3)  # spacing 0.025
    p0 = 2 * STEEL * np.sqrt(2.0452e-5 / (2 * np.pi))
    half_width = 0.02 * np.sqrt(8 * 2.0452e-5 / np.pi)
    load = np.trapezoid(pressure, position) * half_width
    assert load == pytest.approx(DIMENSIONAL["line_load"], rel=0.01)  # the load upstream of x/a = -4 is missing
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
    assert result.solves == 1
    assert len(set(result.values["central_film"][:, 0])) == 1
    assert result.values["traction_coefficient"][0, 0] == 0
    assert 0 < result.values["traction_coefficient"][2, 0] < result.values["traction_coefficient"][1, 0]


def test_an_impossible_traction_has_a_message() -> None:
    columns = {"slide_roll_ratio": [0.1, 0.1], "shear_law": np.array(["newtonian", "eyring"], object)}
    asked = block(("traction_coefficient",), columns, **(CHECKED | {"load_parameter": 1e-4}))
    result = compute(asked)
    assert result.values["traction_coefficient"][0, 0] > 1 > result.values["traction_coefficient"][1, 0]
    assert "use shear_law: eyring" in result.messages[0, 0]
    assert (1, 0) not in result.messages


def test_errors_are_absolute_and_in_the_unit_of_their_output() -> None:
    """Errors of films are converted from h/R to m. Errors of a profile contain the difference to a finer solution."""
    names = ("central_film", "minimum_film", "central_film_thickness", "film", "pressure", "spike_position")
    asked = block(names, **DIMENSIONAL)
    here = compute(asked).values
    np.testing.assert_allclose(here["central_film_thickness_error"], 0.02 * here["central_film_error"], rtol=1e-14)
    fine = compute(dataclasses.replace(asked, accuracy=5e-5)).values
    for name in names:
        error = here[f"{name}_error"] + fine[f"{name}_error"]
        assert here[f"{name}_error"].shape == here[name].shape
        assert np.mean(np.abs(here[name] - fine[name]) <= error) > 0.95, name
        assert np.all(np.isfinite(here[f"{name}_error"]) == np.isfinite(here[name])), name


def test_a_film_thicker_than_a_tenth_of_the_radius_is_warned_of() -> None:
    result = compute(
        block(("central_film",), {"speed_parameter": [1e-9, 1e-6]}, **(CHECKED | {"load_parameter": 1e-6}))
    )
    assert (0, 0) not in result.messages
    assert "thicker than 0.1 of the radius" in result.messages[1, 0]
    assert result.values["central_film"][1, 0] > 0.1


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "expected either load_parameter or line_load, got neither"),
        (CHECKED | {"line_load": 1.0}, "got load_parameter and line_load"),
        ({k: v for k, v in DIMENSIONAL.items() if k != "radius"}, "line_load needs radius"),
        (CHECKED | {"viscosity_law": "roelands"}, "roelands` needs the parameter `viscosity`"),
        (CHECKED | {"speed_parameter": 0.0}, "greater than 0"),
        (CHECKED | {"inlet": 1.0}, "less than 0"),
        (CHECKED | {"profile_start": 3.0}, "expected a profile_end above the profile_start 3, got 2"),
    ],
)
def test_bad_parameters(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        EhlLineParameters(**given)


def test_the_example_of_the_page_runs(capsys: pytest.CaptureFixture[str]) -> None:
    page = (Path(__file__).parents[2] / "docs/ehl.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", page, flags=re.M | re.S)
    assert len(blocks) == 1
    exec(blocks[0], {})
    assert re.match(r"h_c/R = 2\.54\de-05, h_min/R = 2\.13\de-05\n", capsys.readouterr().out)
