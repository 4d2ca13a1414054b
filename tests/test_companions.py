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
    ("more", "sentence"),
    [
        (
            "",
            "a.yaml:5:11: outputs[0]: expected the output 'width', whose error is stored unless errors: false, "
            "got 'width_error'",
        ),
        ("errors: maybe\n", "a.yaml:6:9: errors: expected true or false, got 'maybe'"),
    ],
)
def test_an_error_is_not_asked_for_by_name(toy, more, sentence):
    text = STUDY.replace("[height, width]", "[width_error]" if not more else "[width]") + more
    with pytest.raises(CampaignError) as caught:
        loads(text, "a.yaml", ".")
    assert sentence in str(caught.value)


def test_rounds_go_by_outputs_and_not_by_their_errors(toy):
    text = STUDY.replace("6", "{at_most: 20, until: {width_error: 1 %}}")
    with pytest.raises(CampaignError, match="this is none of the outputs of the campaign"):
        loads(text, "a.yaml", ".")
