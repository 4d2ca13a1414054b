import re

import numpy as np
import pytest
from pydantic import ValidationError

from mdr_dask.errors import DataError
from mdr_dask.models.parts.material import Material, fit_error, fit_notes, solid_of
from mdr_dask.physics.solids import complex_modulus

TABLE = "tests/data/dma/freq_user_raw.csv"


def material(**kind):
    return Material.model_validate(kind)


def test_every_kind_is_the_solid_it_names():
    kelvin = solid_of(material(kelvin={"shear_modulus": 1e6, "relaxation_time": 1e-3}))
    assert (kelvin.static_modulus, kelvin.viscosity) == (1e6, 1e3)
    standard = solid_of(material(standard_solid={"static_modulus": 1e6, "glass_modulus": 1e7, "relaxation_time": 0.1}))
    assert standard.glass_modulus == 1e7
    prony = solid_of(
        material(prony={"static_modulus": 1.0, "moduli": [1.0, 2.0], "times": [0.1, 1.0], "viscosity": 0.5})
    )
    assert prony.moduli.tolist() == [1, 2]
    power = material(
        power_law={
            "static_modulus": 1e6,
            "loss_modulus": 1e5,
            "frequency": 1e3,
            "exponent": 0.2,
            "lowest": 1.0,
            "highest": 1e6,
        }
    )
    assert complex_modulus(solid_of(power), 1e3).imag == pytest.approx(1e5, rel=0.01)


def test_one_kind_and_one_law_only():
    kelvin = {"shear_modulus": 1e6, "relaxation_time": 1e-3}
    solid = {"static_modulus": 1e6, "glass_modulus": 1e7, "relaxation_time": 0.1}
    with pytest.raises(ValidationError, match=r"expected one of kelvin, standard_solid, .* got none"):
        material()
    with pytest.raises(ValidationError, match="got kelvin, standard_solid"):
        material(kelvin=kelvin, standard_solid=solid)
    with pytest.raises(ValidationError, match="a temperature needs wlf or arrhenius"):
        material(kelvin=kelvin, temperature=300.0)
    laws = {
        "wlf": {"c1": 17.4, "c2": 51.6, "reference": 300.0},
        "arrhenius": {"activation_energy": 1e5, "reference": 300.0},
    }
    with pytest.raises(ValidationError, match="expected wlf or arrhenius, got both"):
        material(kelvin=kelvin, temperature=300.0, **laws)


@pytest.mark.parametrize(
    ("law", "factor"),
    [
        ({"wlf": {"c1": 17.4, "c2": 51.6, "reference": 300.0}}, 10 ** (-17.4 * 10 / 61.6)),
        (
            {"arrhenius": {"activation_energy": 1e5, "reference": 300.0}},
            np.exp(1e5 / 8.31446261815324 * (1 / 310 - 1 / 300)),
        ),
    ],
)
def test_temperature_moves_relaxation_times(law, factor):
    kelvin = {"shear_modulus": 1e6, "relaxation_time": 1e-3}
    assert solid_of(material(kelvin=kelvin, temperature=310.0, **law)).viscosity == pytest.approx(1e3 * factor)


def test_table_of_one_temperature_is_fitted():
    chosen = {"file": TABLE, "table_temperature": 353.0 + 4.8, "poisson_ratio": 0.35, "arms_per_decade": 2.0}
    solid = solid_of(material(dma_table=chosen))
    # at 1 Hz and 84.9 C, from the file, tension to shear
    modulus = complex_modulus(solid, 2 * np.pi)
    assert modulus.real == pytest.approx(555e6 / 2.7, rel=0.5)
    assert solid.static_modulus > 0


def test_table_of_many_temperatures_is_superposed():
    solid = solid_of(material(dma_table={"file": TABLE, "reference": 323.0, "poisson_ratio": 0.5}))
    assert solid.times[-1] / solid.times[0] > 1e20
    assert solid.times.size > 10


def test_table_needs_a_temperature_or_a_reference():
    with pytest.raises(DataError, match="has several temperatures: name one by table_temperature, or a reference"):
        solid_of(material(dma_table={"file": TABLE}))
    with pytest.raises(DataError, match="got no rows at 500 K"):
        solid_of(material(dma_table={"file": TABLE, "table_temperature": 500.0}))


def test_the_fit_says_how_well_it_holds():
    fitted = material(dma_table={"file": TABLE, "table_temperature": 298.0, "poisson_ratio": 0.5})
    (note,) = fit_notes(fitted)
    assert re.search(rf"table {TABLE}: \d+ arms for .* rad/s, rms error [\d.]+% in G', .*% in G'', largest .*%", note)
    error = fit_error(fitted)
    assert 0.005 < error < 0.05  # the scatter of the data is 2 %
    denser = fitted.model_copy(update={"dma_table": fitted.dma_table.model_copy(update={"arms_per_decade": 3.0})})
    assert fit_error(denser) < error
    kelvin = material(kelvin={"shear_modulus": 1e6, "relaxation_time": 1e-3})
    assert fit_error(kelvin) == 0
    assert fit_notes(kelvin) == fit_notes(None) == ()


def test_missing_file_is_named():
    with pytest.raises(ValidationError, match=r"no such file: .*nowhere.csv"):
        material(dma_table={"file": "nowhere.csv"})


def moduli(tmp_path, text, **options):
    (tmp_path / "dma.csv").write_text(text)
    options = {"file": str(tmp_path / "dma.csv"), **options}
    return solid_of(Material.model_validate({"dma_table": options}))


ROWS = [(10.0**k, 1e6 * (1 + 0.4 * k), 1e5 * (1 + 0.1 * k)) for k in range(-1, 4)]


def test_columns_of_a_table_go_by_their_names(tmp_path):
    """The order of the columns does not matter; tan delta stands for the loss modulus; Hz and rad/s are told apart."""
    plain = "frequency [rad/s],storage modulus [Pa],loss modulus [Pa]\n"
    solid = moduli(tmp_path, plain + "\n".join(f"{f!r},{s!r},{loss!r}" for f, s, loss in ROWS))
    turned = "loss modulus [Pa],frequency [rad/s],E' [Pa]\n"
    again = moduli(tmp_path, turned + "\n".join(f"{loss!r},{f!r},{s!r}" for f, s, loss in ROWS))
    np.testing.assert_array_equal(again.moduli, solid.moduli)
    tangent = "frequency [rad/s],G' [MPa],tan delta [-]\n"
    close = moduli(tmp_path, tangent + "\n".join(f"{f!r},{s / 1e6!r},{loss / s!r}" for f, s, loss in ROWS))
    np.testing.assert_allclose(close.moduli, solid.moduli, rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("f [Hz],E' [MPa],tan delta [MPa]\n1,2,0.1\n", "column tan delta: expected a number"),
        ("f [Hz],E' [MPa]\n1,2\n", "expected a column loss modulus or tan delta"),
        ("1,2,3\n4,5,6\n", "column frequency: expected its unit"),
        ("f [Hz],E' [MPa],E'' [MPa],T [K]\n1,2,3,-10\n", "column temperature: expected a value above 0, got '-10 K'"),
        ("T [C],f [Hz],E' [MPa],E'' [MPa]\n20,1,2,\n", r"dma.csv:2:8: column loss modulus: expected a number"),
    ],
)
def test_a_table_that_is_no_dma_is_refused(tmp_path, text, message):
    with pytest.raises(DataError, match=message):
        moduli(tmp_path, text)
