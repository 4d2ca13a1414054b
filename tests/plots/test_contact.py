"""Pictures of a contact against what the store says of it: share in contact, load, lines."""

import io

import numpy as np
import pytest

from mdr_dask import execute
from mdr_dask.campaign import load
from mdr_dask.errors import DataError
from mdr_dask.plots import available, style
from mdr_dask.plots.contact import contact_of
from mdr_dask.store import datasets

CAMPAIGN = """
name: contact
model: sliding_friction
seed: 7
realisations: 2
parameters:
  length: 20 mm
  points: 300
  hurst: [0.3, 0.7]
  rms_roughness: 5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  normal_force: 1 N
  velocity: [10 m/s, 1 mm/s, 1 m/s]
series:
  plane: {}
  ball: {indenter: {shape: parabola, radius: 50 mm}}
"""
DRAW = available("sliding_friction")


@pytest.fixture(scope="module")
def groups(tmp_path_factory):
    folder = tmp_path_factory.mktemp("contact")
    (folder / "contact.yaml").write_text(CAMPAIGN)
    url = str(folder / "contact.zarr")
    execute.run(load(folder / "contact.yaml"), url, execute.Resources(), lambda _: None)
    return datasets(url)


@pytest.mark.parametrize("series", ["plane", "ball"])
def test_the_picture_touches_where_the_solution_does(groups, series):
    data = groups[series]
    for place in np.ndindex(2, 3, 2):
        case = data.isel(dict(zip(("hurst", "velocity", "realisation"), place, strict=True)))
        contact = contact_of(case)
        one_place = 20 / contact.place.size
        assert contact.touching.mean() == pytest.approx(float(case["contact_fraction"]), rel=0.05, abs=one_place)


def test_the_picture_carries_the_load(groups):
    """Free elements carry nothing, so that the load of a plane is 4 G times the integral of the displacement."""
    data = groups["plane"]
    for place in np.ndindex(2, 3, 2):
        case = data.isel(dict(zip(("hurst", "velocity", "realisation"), place, strict=True)))
        contact = contact_of(case)
        pushed = contact.elastomer + float(case["indentation_depth"])
        load = 4 * 1e7 * 0.02 * pushed.mean()
        assert load == pytest.approx(1.0, rel=0.02)


def test_figures_say_what_they_hold(groups):
    figure = DRAW["contact"].figure({"plane": groups["plane"]})
    assert len(figure.axes) == 6
    assert "H$ = 0.7" in figure.get_suptitle()
    assert "1 of 2 values of hurst" in style.left_out(figure)
    assert "realisations but the first of 2" in style.left_out(figure)
    titles = [axes.get_title() for axes in figure.axes[::2]]
    assert ["0.001 m/s" in titles[0], "1 m/s" in titles[1], "10 m/s" in titles[2]] == [True] * 3
    figure.savefig(io.BytesIO(), dpi=20)


def test_the_elastomer_fills_its_panels(groups):
    figure = DRAW["contact"].figure({"plane": groups["plane"]})
    for axes in figure.axes:
        elastomer = axes.lines[1].get_ydata()
        low, high = axes.get_ylim()
        assert low < elastomer.min() < elastomer.max() < high
        drawn = np.ptp(elastomer) if axes in figure.axes[::2] else np.ptp([*elastomer, *axes.lines[0].get_ydata()])
        assert drawn > 0.7 * (high - low)
    for whole, part in zip(figure.axes[::2], figure.axes[1::2], strict=True):
        shares = [np.isfinite(axes.lines[2].get_ydata()).mean() for axes in (whole, part)]
        assert abs(shares[1] - 0.5) < 0.15 or abs(shares[1] - 0.5) < abs(shares[0] - 0.5)


def test_lines_have_the_height_of_the_campaign_and_the_same_phases(groups):
    figure = DRAW["lines"].figure({"plane": groups["plane"]})
    lines = [axes.lines[0].get_ydata() for axes in figure.axes]
    assert [np.std(line) for line in lines] == pytest.approx([5, 5], rel=1e-6)
    assert "5 µm" in figure.get_suptitle()
    assert "20 mm" in figure.get_suptitle()
    phases = [np.angle(np.fft.rfft(line)[1:100]) for line in lines]
    np.testing.assert_allclose(phases[0], phases[1], atol=1e-9)


def test_a_case_without_a_depth_is_named(groups):
    one = groups["plane"].isel(hurst=0, velocity=0, realisation=0)
    with pytest.raises(DataError, match="expected a case with a depth"):
        contact_of(one.assign(indentation_depth=np.nan))
