"""Oil data: values of the oil in the thesis, and identities of the laws."""

import numpy as np
import pytest

from mdr_dask.physics.lubrication import oil

XMP = oil.OILS["mobilgear_shc_xmp_320"]


def test_walther_constants_of_the_thesis_oil():
    A, B = oil.walther_constants((XMP.T1, XMP.T2), (XMP.nu1, XMP.nu2))
    assert pytest.approx((6.983057, 2.636733), abs=1e-6) == (A, B)
    assert oil.kinematic_viscosity([XMP.T1, XMP.T2], A, B) == pytest.approx([335e-6, 38.3e-6], rel=1e-12)


def test_viscosity_of_the_thesis_oil_over_temperature():
    temperature = 273.15 + np.array([40.0, 50.0, 60.0, 70.0, 80.0])
    # five digits checked independently; the last one is rounded
    assert XMP.dynamic(temperature) == pytest.approx([0.28265, 0.17641, 0.11559, 0.07900, 0.05601], rel=1e-4)


def test_pressure_viscosity_of_the_thesis_oil():
    assert XMP.alpha([313.15, 353.15]) == pytest.approx([1.604e-8, 1.298e-8], rel=1e-3)


def test_density_falls_and_meets_its_reference():
    assert oil.density_at(288.7, 860.0, 288.7) == pytest.approx(860.0)
    slope = np.diff(oil.density_at([300.0, 301.0], 860.0, 288.7))[0]
    assert -0.70 < slope < -0.55  # lubricating oils lose 0.6 to 0.65 kg/m^3 a kelvin


@pytest.mark.parametrize("name", oil.GOLD)
def test_every_correlation_rises_with_viscosity(name):
    alpha = oil.pressure_viscosity(name, np.array([10e-6, 100e-6]))
    assert 1e-9 < alpha[0] < alpha[1] < 4e-8


def test_an_unknown_correlation_names_the_known_ones():
    with pytest.raises(ValueError, match=r"expected one of the correlations gold_mineral.*got 'barus'"):
        oil.pressure_viscosity("barus", 1e-4)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (((313.15, 313.15), (335e-6, 38e-6)), "viscosities at two temperatures or more"),
        (((313.15, 373.15), (335e-6, 400e-6)), "viscosities that fall with temperature"),
        (((313.15, 373.15), (335e-6, 1e-6)), "at least 2 mm"),
    ],
)
def test_impossible_viscosities_are_refused(data, message):
    with pytest.raises(ValueError, match=message):
        oil.walther_constants(*data)


def test_temperature_outside_the_data_is_named():
    assert XMP.outside(333.15) == ""
    assert "313.15 to 373.15 K, got 293 K" in XMP.outside(293.0)
