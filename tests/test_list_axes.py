"""A parameter that is itself a list varies like any other: load histories, Prony series."""

from pathlib import Path

import numpy as np
import pytest
from test_execute import run

from mdr_dask import store
from mdr_dask.campaign import loads
from mdr_dask.cli import main
from mdr_dask.errors import CampaignError
from mdr_dask.questions import selection

HISTORIES = {
    "once": "[{cycles: 10}]",
    "harder": "[{cycles: 5}, {cycles: 5, amplitude_factor: 2}]",
    "softer": "[{cycles: 5}, {cycles: 5, amplitude_factor: 0.5}]",
}
WEAR = """
name: histories
model: fretting_wear
parameters: {stick_radius: 0.5, history: LISTS}
outputs: [wear_volume]
"""


def histories(*names, text=WEAR):
    return loads(text.replace("LISTS", f"[{', '.join(HISTORIES[name] for name in names)}]"), "", ".")


def volumes(url):
    data = store.datasets(url)[""]
    return dict(zip(data.history.to_numpy(), data.wear_volume.to_numpy().ravel(), strict=True))


def test_lists_are_an_axis_that_grows_and_keeps_its_values(tmp_path):
    url = str(tmp_path / "wear.zarr")
    run(histories("once", "harder"), url)
    before = volumes(url)
    assert run(histories("softer"), url).kept == 0
    assert run(histories("harder", "once", "softer"), url).done == 0
    after = volumes(url)
    assert list(after) == [HISTORIES[name] for name in ("once", "harder", "softer")]
    assert {name: after[name] for name in before} == before
    alone = loads(WEAR.replace("LISTS", HISTORIES["harder"]), "", ".")
    run(alone, str(tmp_path / "alone.zarr"))
    assert store.datasets(str(tmp_path / "alone.zarr"))[""]["wear_volume"] == after[HISTORIES["harder"]]
    assert after[HISTORIES["harder"]] > after[HISTORIES["once"]] > after[HISTORIES["softer"]]


def test_questions_and_figures_take_lists(tmp_path):
    url, csv, figure = (str(tmp_path / name) for name in ("wear.zarr", "a.csv", "f.png"))
    run(histories("once", "harder", "softer"), url)
    wanted = f"history={HISTORIES['harder']}, {HISTORIES['once']}"
    found = selection.select(store.datasets(url)[""], [wanted])
    assert set(found.history.to_numpy()) == {HISTORIES["harder"], HISTORIES["once"]}
    assert main(["show", url, "wear_volume", "--group-by", "history", "-o", csv]) == 0
    assert Path(csv).read_text().count("amplitude_factor") == 2
    assert main(["plot", url, "wear_volume", "--over", "history", "-o", figure]) == 0
    assert "cycles" not in store.datasets(url)[""].coords  # a history replaces them


TERMS = """
name: terms
model: sliding_friction
sampling: zip
parameters:
  {length: 2 mm, points: 200, hurst: 0.7, rms_roughness: 1 um, normal_force: 1 N, velocity: 1 m/s,
   material: {prony: {static_modulus: 1 MPa, moduli: MODULI, times: TIMES}}}
"""


def test_lists_of_a_structure_vary_together(tmp_path):
    def terms(moduli, times):
        return loads(TERMS.replace("MODULI", moduli).replace("TIMES", times), "", ".")

    found = terms("[[1 MPa], [1 MPa, 20 kPa]]", "[[1 ms], [0.001, 1 s]]")
    assert [axis.values for axis in found.series[0].axes] == [((1e6,), (1e6, 2e4)), ((1e-3,), (1e-3, 1.0))]
    url = str(tmp_path / "arms.zarr")
    run(found, url)
    friction = store.datasets(url)[""].friction_coefficient.to_numpy()
    assert np.isfinite(friction).all()
    run(terms("[[3 MPa, 1 kPa, 1 kPa]]", "[[1 ms, 1 s, 2 s]]"), url)  # restores Prony terms of other numbers
    assert np.array_equal(store.datasets(url)[""].friction_coefficient.to_numpy()[:2], friction)


MISTAKES = [
    ("[[{cycles: 10}], {cycles: 5}]", "4:59: parameters.history: expected a list, got a mapping"),
    ("[[{cycles: 10}], [{cycles: 10.0}]]", "4:59: parameters.history: this value is given twice: [{cycles: 10.0}]"),
    ("[[{cycles: 10}]], cycles: [1, 2]", "`history` replaces `cycles`: leave out one of them"),
    ("[[{cycles: 10}], [{cycles: -1}]]", "4:69: parameters.history[0].cycles: expected a number of at least 0, got -1"),
]


@pytest.mark.parametrize(("lists", "message"), MISTAKES)
def test_mistakes_in_lists_of_lists(lists, message):
    with pytest.raises(CampaignError) as caught:
        loads(WEAR.replace("LISTS", lists), "", ".")
    assert message in str(caught.value)


def test_parameters_that_set_coordinates_cannot_vary():
    text = WEAR.replace("history: LISTS", "extent: [1.2, 1.6]")
    assert len(loads(text, "", ".").series[0].axes) == 1
    message = (
        "parameters.extent: expected one value, because the values of the axis 'radius' of the output "
        r"'worn_profile' depend on this parameter \(write a series for each value\)"
    )
    with pytest.raises(CampaignError, match=message):
        loads(text.replace("wear_volume", "worn_profile"), "", ".")
