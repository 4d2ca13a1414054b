"""Errors of outputs, from the campaign file through the store to aggregates and the command line."""

import numpy as np
import pytest
import xarray as xr

from mdr_dask.campaign import loads
from mdr_dask.cli import main
from mdr_dask.errors import CampaignError

STUDY = """\
name: study
model: toy
realisations: 6
parameters: {position: [1, 2]}
outputs: [height, width]
"""


@pytest.fixture
def filled(toy, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.yaml").write_text(STUDY)
    assert main(["run", "study.yaml", "--quiet"]) == 0
    capsys.readouterr()
    return "results/study.zarr"


def test_an_output_with_an_error_brings_it_into_the_store(filled):
    opened = xr.open_zarr(filled)
    assert opened.width.attrs["ancillary_variables"] == "width_error"
    assert opened.width_error.attrs["units"] == opened.width.attrs["units"] == "m"
    assert "absolute" in opened.width_error.attrs["long_name"]
    np.testing.assert_allclose(opened.width_error, 0.005 * abs(opened.width))
    assert "ancillary_variables" not in opened.height.attrs


def test_errors_false_leaves_them_and_their_work_out(toy):
    with_errors, without = loads(STUDY, "a.yaml", "."), loads(STUDY + "errors: false\n", "a.yaml", ".")
    assert with_errors.outputs == ("height", "width", "width_error")
    assert without.outputs == ("height", "width")


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            "[height, width]",
            "[width_error]",
            "outputs.0.: expected the output 'width' .its error is stored too, except",
        ),
        ("[height, width]", "[width]\nerrors: maybe", "errors: expected true or false, got 'maybe'"),
        ("6", "{at_most: 20, until: {width_error: 1 %}}", "this is not an output of the campaign"),
    ],
)
def test_an_error_is_not_asked_for_by_name(toy, old, new, sentence):
    with pytest.raises(CampaignError, match=sentence):
        loads(STUDY.replace(old, new), "a.yaml", ".")
