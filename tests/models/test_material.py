"""Materials: kinds of solids, tables of moduli, temperature laws and shift factors."""

import re

import numpy as np
import pytest
from pydantic import ValidationError

from mdr_dask.errors import DataError
from mdr_dask.models.parts.material import Material, fit_error, fit_notes, solid_of
from mdr_dask.models.parts.moduli_table import ModulusTable, one_curve
from mdr_dask.models.parts.sliding_body import frequency_notes
from mdr_dask.models.parts.temperature import ShiftFactors
from mdr_dask.models.sliding_friction.declaration import SlidingFriction
from mdr_dask.physics.solids import complex_modulus

TABLE = "tests/data/dma/freq_user_raw.csv"


def material(**kind):
    return Material.model_validate(kind)


def test_every_kind_is_the_solid_it_names():
    kelvin = solid_of(material(kelvin={"shear_modulus": 1e6, "relaxation_time": 1e-3}))
    assert (kelvin.static_modulus, kelvin.viscosity) == (1e6, 1e3)
    standard = solid_of(material(standard_solid={"static_modulus": 1e6, "glass_modulus": 1e7, "relaxation_time": 0.1}))
    assert standard.static_modulus + standard.moduli.sum() == 1e7
    prony = solid_of(
        material(prony={"static_modulus": 1.0, "moduli": [1.0, 2.0], "times": [0.1, 1.0], "viscosity": 0.5})
    )
    assert prony.moduli.tolist() == [1, 2]
    law = {"static_modulus": 1e6, "loss_modulus": 1e5, "frequency": 1e3, "exponent": 0.2}
    power = material(power_law=law | {"lowest": 1.0, "highest": 1e6})
    assert complex_modulus(solid_of(power), 1e3).imag == pytest.approx(1e5, rel=0.01)


def test_one_kind_and_one_law_only():
    kelvin = {"shear_modulus": 1e6, "relaxation_time": 1e-3}
    solid = {"static_modulus": 1e6, "glass_modulus": 1e7, "relaxation_time": 0.1}
    with pytest.raises(ValidationError, match=r"expected kelvin, or standard_solid, .* got none"):
        material()
    with pytest.raises(ValidationError, match="got kelvin and standard_solid"):
        material(kelvin=kelvin, standard_solid=solid)
    with pytest.raises(ValidationError, match="expected a temperature together with one of wlf"):
        material(kelvin=kelvin, temperature=300.0)
    laws = {
        "wlf": {"c1": 17.4, "c2": 51.6, "reference": 300.0},
        "arrhenius": {"activation_energy": 1e5, "reference": 300.0},
    }
    with pytest.raises(ValidationError, match="expected one of wlf, arrhenius, shift_factors, got wlf and arrhenius"):
        material(kelvin=kelvin, temperature=300.0, **laws)


def test_temperature_moves_relaxation_times():
    kelvin, reference = {"shear_modulus": 1e6, "relaxation_time": 1e-3}, 300.0
    factor = np.exp(1e5 / 8.31446261815324 * (1 / 310 - 1 / reference))
    law = {"arrhenius": {"activation_energy": 1e5, "reference": reference}}
    assert solid_of(material(kelvin=kelvin, temperature=310.0, **law)).viscosity == pytest.approx(1e3 * factor)


def test_table_needs_a_temperature_or_a_reference():
    with pytest.raises(DataError, match="has several temperatures: choose one by `table_temperature`, or superpose"):
        solid_of(material(dma_table={"file": TABLE, "poisson_ratio": 0.5}))
    assert material(dma_table=TABLE) == material(dma_table={"file": TABLE})
    with pytest.raises(DataError, match=r"expected two or more rows at 226.9 degC; the table was measured at -4"):
        solid_of(material(dma_table={"file": TABLE, "table_temperature": 500.0}))


def test_a_reference_needs_temperatures_that_enclose_it(tmp_path):
    with pytest.raises(DataError, match="expected a column 'temperature', because `reference` is given"):
        moduli(tmp_path, "f [Hz],G' [MPa],G'' [MPa]\n1,2,1\n10,3,2\n", reference=300.0)
    with pytest.raises(DataError, match=r"expected a reference between 16\.85 degC and 26\.85 degC, got -253\.1 degC"):
        solid_of(material(dma_table={"file": shifted_table(tmp_path / "x.csv", (290.0, 300.0)), "reference": 20.0}))


def test_table_temperature_is_the_temperature_of_a_table_without_temperatures(tmp_path):
    rows = "".join(f"{f},{m / 1e6},{s / 1e6}\n" for f, m, s in ROWS)
    (tmp_path / "dma.csv").write_text(f"f [Hz],G' [MPa],G'' [MPa]\n{rows}")
    law = {"c1": 10.0, "c2": 100.0, "reference": 300.0}

    def times(**table):
        return solid_of(
            material(dma_table={"file": str(tmp_path / "dma.csv"), **table}, wlf=law, temperature=320.0)
        ).times

    shift = 10 ** (-10 * 20 / 120)
    assert times(table_temperature=320.0) * shift == pytest.approx(times(table_temperature=300.0), rel=1e-12)
    assert times() == pytest.approx(times(table_temperature=300.0), rel=1e-12)


def test_a_note_states_the_error_of_the_fit():
    fitted = material(dma_table={"file": TABLE, "table_temperature": 298.0, "poisson_ratio": 0.5})
    (note,) = fit_notes(fitted)
    assert re.search(
        rf"table {TABLE}: \d+ Prony terms .* rad/s, rms error [\d.]+% in G', .*% in G'', largest .*%", note
    )
    error = fit_error(fitted)
    assert 0.005 < error < 0.05  # the scatter of the data is 2 %
    denser = fitted.model_copy(update={"dma_table": fitted.dma_table.model_copy(update={"terms_per_decade": 3.0})})
    assert fit_error(denser) < error
    kelvin = material(kelvin={"shear_modulus": 1e6, "relaxation_time": 1e-3})
    assert fit_error(kelvin) == 0
    assert fit_notes(kelvin) == ()


def moduli(tmp_path, text, **options):
    (tmp_path / "dma.csv").write_text(text)
    options = {"file": str(tmp_path / "dma.csv"), **options}
    return solid_of(Material.model_validate({"dma_table": options}))


ROWS = [(10.0**k, 1e6 * (1 + 0.4 * k), 1e5 * (1 + 0.1 * k)) for k in range(-1, 4)]


def test_columns_of_a_table_go_by_their_names(tmp_path):
    """Columns in any order, tan delta instead of the loss modulus, Hz and rad/s."""
    plain = "frequency [rad/s],storage modulus [Pa],loss modulus [Pa]\n"
    solid = moduli(tmp_path, plain + "\n".join(f"{f!r},{s!r},{loss!r}" for f, s, loss in ROWS))
    turned = "loss modulus [Pa],frequency [rad/s],G' [Pa]\n"
    again = moduli(tmp_path, turned + "\n".join(f"{loss!r},{f!r},{s!r}" for f, s, loss in ROWS))
    np.testing.assert_array_equal(again.moduli, solid.moduli)
    tangent = "frequency [rad/s],G' [MPa],tan delta [-]\n"
    close = moduli(tmp_path, tangent + "\n".join(f"{f!r},{s / 1e6!r},{loss / s!r}" for f, s, loss in ROWS))
    np.testing.assert_allclose(close.moduli, solid.moduli, rtol=1e-6, atol=1e-3)
    polar = [(f, np.hypot(s, loss) / 1e6, np.degrees(np.arctan2(loss, s))) for f, s, loss in ROWS]
    close = moduli(tmp_path, "f [rad/s],|G*| [MPa],delta [deg]\n" + "\n".join(f"{f},{g},{d}" for f, g, d in polar))
    np.testing.assert_allclose(close.moduli, solid.moduli, rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize(
    ("heading", "cells"),
    [("tan d", ""), ("|G*| [MPa]", "invalid"), ("Raw phase [deg]", "3"), ("Complex viscosity [Pa s]", "-1")],
)
def test_what_is_not_needed_and_incomplete_rows_are_left_out(tmp_path, heading, cells):
    names, rows = "f [rad/s],G' [Pa],G'' [Pa]", [f"{f},{s},{loss}" for f, s, loss in ROWS]
    solid = moduli(tmp_path, "\n".join([names, *rows]))
    rows.insert(2, "0.5,---,---")
    more = moduli(tmp_path, "\n".join([f"{names},{heading}", *(f"{row},{cells}" for row in rows)]))
    np.testing.assert_array_equal(more.moduli, solid.moduli)
    read = ModulusTable.model_validate(str(tmp_path / "dma.csv"))
    used, left_out = read.notes()[0].split("; ")
    assert used.endswith(f"not used: {heading.partition(' [')[0]}")
    assert left_out == "rows without a number are left out: 1"


def test_an_isotherm_may_drift_by_a_kelvin(tmp_path):
    rows = [f"{f},{s},{loss}" for f, s, loss in ROWS]
    solid = moduli(tmp_path, "f [rad/s],G' [Pa],G'' [Pa]\n" + "\n".join(rows))
    logged = "\n".join(f"{row},{t}" for row, t in zip(rows, np.linspace(59.3, 60.4, 5), strict=True))
    drifting = moduli(tmp_path, "f [rad/s],G' [Pa],G'' [Pa],T [degC]\n" + logged)
    np.testing.assert_array_equal(drifting.moduli, solid.moduli)


#: Curves of one solid at several temperatures, shifted by the law of Williams, Landel and Ferry and divided by b_T.
LAW = {"c1": 10.0, "c2": 100.0, "reference": 300.0}


def b_t(temperature):
    return LAW["reference"] / temperature * (1 + 6e-4 * (temperature - LAW["reference"]))


def shifted_table(path, temperatures, decades=3):
    omega = np.logspace(-decades / 2, decades / 2, 4 * decades + 1)
    lines = ["omega [rad/s],G' [Pa],G'' [Pa],T [K]"]
    for temperature in temperatures:
        difference = temperature - LAW["reference"]
        reduced = omega * 10 ** (-LAW["c1"] * difference / (LAW["c2"] + difference))
        modulus = 1e6 * (1 + (1j * reduced) ** 0.3) / b_t(temperature)
        lines += [
            f"{w!r},{s!r},{ls!r},{temperature!r}"
            for w, s, ls in zip(omega.tolist(), modulus.real.tolist(), modulus.imag.tolist(), strict=True)
        ]
    path.write_text("\n".join(lines))
    return str(path)


def test_known_shift_factors_superpose_a_table(tmp_path):
    """The law and a table of the same factors give one curve, which the law moves as it moves the data."""
    file = shifted_table(tmp_path / "dma.csv", (280.0, 300.0, 330.0))
    at_reference = solid_of(material(dma_table={"file": file}, wlf=LAW))
    omega = np.logspace(-4, 3, 8)
    np.testing.assert_allclose(complex_modulus(at_reference, omega), 1e6 * (1 + (1j * omega) ** 0.3), rtol=0.05)
    rows = [(t, -LAW["c1"] * (t - 300.0) / (LAW["c2"] + t - 300.0)) for t in (280.0, 300.0, 310.0, 330.0)]
    for heading, write in (("log aT", lambda k: k), ("a_T", lambda k: 10**k)):
        factors = tmp_path / "shifts.csv"
        factors.write_text(f"T [K],{heading}\n" + "\n".join(f"{t!r},{write(k)!r}" for t, k in rows))
        same = material(dma_table={"file": file}, shift_factors=str(factors))
        np.testing.assert_allclose(solid_of(same).moduli, at_reference.moduli, rtol=1e-6, atol=1.0)
        warm = solid_of(same.model_copy(update={"temperature": 310.0}))
        np.testing.assert_allclose(warm.times, at_reference.times * 10 ** rows[2][1], rtol=1e-9)


def test_moduli_of_a_table_are_proportional_to_density_times_temperature(tmp_path):
    """The curves at three temperatures are found again, at a measured temperature and at the reference."""
    file = shifted_table(tmp_path / "dma.csv", (280.0, 300.0, 330.0))
    omega = np.logspace(-1, 1, 5)
    for temperature in (280.0, 300.0, 330.0):
        warm = material(dma_table={"file": file, "terms_per_decade": 2.0}, temperature=temperature, wlf=LAW)
        difference = temperature - LAW["reference"]
        reduced = omega * 10 ** (-LAW["c1"] * difference / (LAW["c2"] + difference))
        expected = 1e6 * (1 + (1j * reduced) ** 0.3) / b_t(temperature)
        np.testing.assert_allclose(complex_modulus(solid_of(warm), omega), expected, rtol=0.02)
        assert any("moduli are divided by b_T = rho0 T0 / (rho T)" in note for note in warm.notes())
    assert "multiplied by b_T = rho0 T0 / (rho T), with an expansion of 0.0006 1/K" in warm.notes()[0]
    plain = material(dma_table={"file": file, "vertical": "none"}, temperature=330.0, wlf=LAW)
    assert "not multiplied by b_T" in plain.notes()[0]
    assert abs(complex_modulus(solid_of(plain), 1.0) / complex_modulus(solid_of(warm), 1.0) - 1) > 0.01
    shifted = material(dma_table={"file": file, "reference": 300.0})
    np.testing.assert_allclose(complex_modulus(solid_of(shifted), omega), 1e6 * (1 + (1j * omega) ** 0.3), rtol=0.05)


def test_shift_factors_across_a_gap_are_not_determined(tmp_path):
    file = shifted_table(tmp_path / "dma.csv", (280.0, 400.0), decades=2)
    table = ModulusTable.model_validate({"file": file, "reference": 300.0})
    assert "not determined in the range 6.85 degC to 126.9 degC: give wlf" in one_curve(table, None).superposed


def test_a_gap_of_one_modulus_is_closed_by_the_other(tmp_path):
    omega, lines = np.geomspace(0.3, 3, 15), ["f [rad/s],G' [Pa],G'' [Pa],T [K]"]
    for temperature, shift in ((280.0, 10.0), (300.0, 0.1)):
        modulus = 1e6 * (1 + 100j * omega * shift / (1 + 1j * omega * shift))
        lines += [f"{w},{g.real},{g.imag},{temperature}" for w, g in zip(omega, modulus, strict=True)]
    (tmp_path / "dma.csv").write_text("\n".join(lines))
    table = ModulusTable.model_validate({"file": str(tmp_path / "dma.csv"), "reference": 300.0})
    assert "superposed at" in one_curve(table, None).superposed


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("300,1\n310,2\n", "values of a_T that decrease with the temperature"),
        ("300,1\n", "expected two or more different temperatures"),
        ("300,1\n310,0.1\n", r"expected a temperature in the range of the table, 26.85 degC to 36.85 degC, got 46.85"),
    ],
)
def test_shift_factors_that_are_none_and_temperatures_beyond_them_are_refused(tmp_path, text, message):
    (tmp_path / "shifts.csv").write_text(f"T [K],a_T\n{text}")
    kelvin = {"shear_modulus": 1e6, "relaxation_time": 1e-3}
    with pytest.raises((DataError, ValueError), match=message):
        solid_of(material(kelvin=kelvin, temperature=320.0, shift_factors=str(tmp_path / "shifts.csv")))


def test_the_table_of_a_master_curve_is_a_table_of_shift_factors(tmp_path):
    """The columns that `master-curve -o` writes beside log10 a_T are not mistaken for it."""
    (tmp_path / "x.csv").write_text(
        "T [degC],shift_factor,shift_factor_low,log10 a_T\n0,-1,-1,1\n20,0,0,0\n40,1,1,-1\n"
    )
    factors = ShiftFactors.model_validate(str(tmp_path / "x.csv"))
    assert factors.reference == pytest.approx(293.15)
    assert factors.factor(303.15) == pytest.approx(10**-0.5)


def test_a_note_compares_the_frequencies_of_a_study_with_the_data(tmp_path):
    file = shifted_table(tmp_path / "dma.csv", (280.0, 300.0, 330.0))
    body = {"length": 1e-2, "points": 1000, "rms_roughness": 1e-6, "normal_force": 1.0}
    sets = [
        SlidingFriction(**body, velocity=v, material=material(dma_table={"file": file}, temperature=t, wlf=LAW))
        for t in (300.0, 330.0)
        for v in (1e-6, 1e4)
    ]
    cold, warm = frequency_notes(sets)
    assert cold.startswith("roughness excites 0.00063 to 3.1e+09 rad/s at 26.85 degC, data from")
    assert "extrapolated" in cold
    assert "decades above" in warm
    assert "at 56.85 degC" in warm
