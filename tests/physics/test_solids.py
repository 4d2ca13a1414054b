"""Linear solids: closed forms, recovery, power laws, fits, temperature laws."""

import numpy as np
import pytest

from mdr_dask.physics.solids import (
    arrhenius_factor,
    at_temperature,
    complex_modulus,
    fit_series,
    kelvin,
    power_law_series,
    prony,
    standard_solid,
    wlf_factor,
)

ROUNDING = 1e-12


def test_kelvin_and_standard_solid_are_their_closed_forms():
    omega = np.geomspace(1e-3, 1e6, 20)
    np.testing.assert_allclose(complex_modulus(kelvin(2e6, 1e-3), omega), 2e6 * (1 + 1j * omega * 1e-3), rtol=ROUNDING)
    wanted = 1e6 + 9e6 * 1j * omega * 0.1 / (1 + 1j * omega * 0.1)
    np.testing.assert_allclose(complex_modulus(standard_solid(1e6, 1e7, 0.1), omega), wanted, rtol=ROUNDING)


def test_equal_times_merge_and_empty_terms_vanish():
    solid = prony(1.0, [1.0, 2.0, 0.0, 4.0], [5.0, 5.0, 1.0, 0.5])
    assert solid.times.tolist() == [0.5, 5.0]
    assert solid.moduli.tolist() == [4.0, 3.0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0, [], []), "static modulus must be positive and finite, got 0.0"),
        ((1.0, [1.0], []), "got 1 moduli and 0 times"),
        ((1.0, [-1.0], [1.0]), "must not be negative, got \\[-1.0\\]"),
        ((1.0, [1.0], [0.0]), "relaxation times must be positive and finite, got \\[0.0\\]"),
        ((1.0, [], [], -1.0), "viscosity must be finite and must not be negative, got -1.0"),
    ],
)
def test_impossible_solids_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        prony(*arguments)
    with pytest.raises(ValueError, match="glass modulus must not be below"):
        standard_solid(2.0, 1.0, 1.0)


@pytest.mark.parametrize("exponent", [0.05, 0.1, 0.3, 0.5, 0.9])
def test_power_law_series_keeps_its_promise(exponent):
    fit = power_law_series(1e6, 2e5, 1e3, exponent, 1e-2, 1e7)
    omega = np.geomspace(1e-2, 1e7, 777)
    error = complex_modulus(fit.solid, omega).imag / (2e5 * (omega / 1e3) ** exponent) - 1
    assert np.abs(error).max() < 0.01  # promised for two Prony terms a decade
    assert fit.largest_error == pytest.approx(np.abs(error).max(), rel=0.2)


def test_power_law_series_refuses_what_is_no_power_law():
    with pytest.raises(ValueError, match=r"between 0 and 1, got 1.0"):
        power_law_series(1.0, 1.0, 1.0, 1.0, 1.0, 10.0)
    with pytest.raises(ValueError, match="positive and ascending, got"):
        power_law_series(1.0, 1.0, 1.0, 0.5, 10.0, 1.0)


def test_fitted_series_recovers_moduli_it_was_made_from():
    made = power_law_series(1e6, 1e6, 1.0, 0.4, 1e-4, 1e7).solid
    omega = np.geomspace(1e-2, 1e5, 60)
    modulus = complex_modulus(made, omega)
    fit = fit_series(omega, modulus.real, modulus.imag, 2)
    assert fit.largest_error < 0.02  # two Prony terms a decade and half a decade beyond the table
    assert max(fit.storage_error, fit.loss_error) <= fit.largest_error
    assert fit.range == pytest.approx((1e-2, 1e5))


def test_tables_that_cannot_be_fitted_are_refused():
    with pytest.raises(ValueError, match="got 2 frequencies, 1 storage and 2 loss moduli"):
        fit_series([1, 2], [1], [1, 2])
    with pytest.raises(ValueError, match="must be positive and finite"):
        fit_series([1, 2], [1, -1], [1, 2])


def test_temperature_laws_agree_with_their_definitions():
    assert wlf_factor(300.0, 300.0, 17.4, 51.6) == 1
    assert np.log10(wlf_factor(310.0, 300.0, 17.4, 51.6)) == pytest.approx(-17.4 * 10 / 61.6, rel=ROUNDING)
    assert np.log(arrhenius_factor(350.0, 300.0, 8.31446261815324e4)) == pytest.approx(1e4 * (1 / 350 - 1 / 300))
    with pytest.raises(ValueError, match=r"valid above 248\.4 K only"):
        wlf_factor(248.0, 300.0, 17.4, 51.6)
    with pytest.raises(ValueError, match="absolute temperatures must be positive"):
        arrhenius_factor(0.0, 300.0, 1e4)


def test_shifted_solid_has_the_moduli_of_the_shifted_frequency():
    solid, omega = prony(1.0, [2.0, 3.0], [0.1, 1.0], 0.5), np.geomspace(1e-3, 1e3, 9)
    shifted = complex_modulus(at_temperature(solid, 7.0), omega)
    np.testing.assert_allclose(shifted, complex_modulus(solid, 7.0 * omega), rtol=ROUNDING)
