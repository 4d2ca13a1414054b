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


@pytest.mark.parametrize("name", oil.CORRELATIONS)
def test_every_correlation_rises_with_viscosity(name):
    alpha = oil.pressure_viscosity(name, np.array([10e-6, 100e-6]), np.array([8.6e-3, 86e-3]))
    assert 1e-9 < alpha[0] < alpha[1] < 4e-8


def test_unknown_laws_name_the_known_ones():
    with pytest.raises(ValueError, match=r"expected one of the correlations gold_mineral.*got 'barus'"):
        oil.pressure_viscosity("barus", 1e-4, 0.1)
    with pytest.raises(ValueError, match="expected the viscosity law barus or roelands, got 'free volume'"):
        oil.log_viscosity("free volume", 1e8, 0.1, 2e-8)


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


def test_roelands_has_the_slope_of_barus_and_stays_below_it():
    pressure = np.array([0.0, 1e3, 1e8, 1e9])
    b, r = (np.exp(oil.log_viscosity(law, pressure, 0.1, 2e-8)) for law in ("barus", "roelands"))
    assert r[0] == pytest.approx(0.1)
    assert np.log(r[1] / r[0]) / 1e3 == pytest.approx(2e-8, rel=1e-4)  # linear in p up to p/p_r = 5e-6
    assert np.all(r[2:] < b[2:])
