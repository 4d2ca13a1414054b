from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.fits.curve_tables import (
    clusters,
    column_of,
    columns_to_use,
    curves_of,
    finite_rows,
    read_table,
    require_one_group,
)
from mdr_dask.fits.master_curve import FITS, friction_of_roughness, master_curve

DATA = Path(__file__).parents[1] / "data" / "dma"
EXPONENT = -0.15


def law(force, velocity):
    """Thesis eq. 3.43 with mu_low ~ (F v^EXPONENT)^(-2/3)."""
    low = (force * velocity**EXPONENT) ** (-2 / 3)
    return (1 + low**-1.5) ** (-1 / 1.5)


def store(realisations=3, noise=0.01):
    random = np.random.default_rng(0)
    force, velocity = np.geomspace(1, 100, 15), np.geomspace(1e-3, 1, 7)
    exact = law(force[:, None], velocity)[..., None]
    values = exact * (1 + noise * random.standard_normal((15, 7, realisations)))
    values[0, 0, 0] = np.nan
    return xr.Dataset(
        {
            "friction_coefficient": (("normal_force", "velocity", "realisation"), values, {"units": "1"}),
            "status": (("normal_force", "velocity", "realisation"), np.ones(values.shape, np.int8)),
        },
        coords={
            "normal_force": ("normal_force", force, {"units": "N"}),
            "velocity": ("velocity", velocity, {"units": "m/s"}),
            "shear_modulus": 1e6,
        },
    )


def test_store_gives_the_exponent_it_was_made_with():
    (fit,) = FITS
    result = fit.compute({"": store()})
    assert float(result["power_exponent_low"]) < EXPONENT < float(result["power_exponent_high"])
    assert float(result["power_exponent"]) == pytest.approx(EXPONENT, abs=0.02)
    assert result["shift_factor"].dims == ("velocity",)
    assert set(result.dims) == {"velocity"}  # one row for every velocity
    whole = master_curve(friction_of_roughness({"": store()}))
    assert whole["curve_abscissa"].attrs["units"] == "N"
    assert whole.sizes["point"] == 15 * 7


def test_friction_of_a_smooth_body_is_taken_off():
    rough, smooth = store(), store(noise=0.0)
    bulk = 0.1 * smooth["velocity"] ** 0.3 * xr.ones_like(smooth["friction_coefficient"])
    rough["friction_coefficient"] = rough["friction_coefficient"] + bulk
    smooth["friction_coefficient"] = bulk
    series = {"rough": rough.assign_coords(rms_roughness=1e-5), "smooth": smooth.assign_coords(rms_roughness=0.0)}
    (fit,) = FITS
    assert float(fit.compute(series)["power_exponent"]) == pytest.approx(EXPONENT, abs=0.02)
    assert fit.compute(dict(reversed(series.items()))).equals(fit.compute(series))
    alone = fit.compute({"rough": series["rough"]})
    assert abs(float(alone["power_exponent"]) - EXPONENT) > 0.02


def test_store_without_the_axes_is_refused():
    with pytest.raises(DataError, match="roughness and varies normal_force and velocity"):
        FITS[0].compute({"": store().isel(velocity=0)})


def test_frame_of_columns_with_other_names():
    force, velocity = (a.ravel() for a in np.meshgrid(np.geomspace(1, 100, 12), [1e-3, 1e-2, 1e-1]))
    frame = pd.DataFrame({"Load": force, "Speed": velocity, "COF": law(force, velocity)})
    result = master_curve(frame, reference=1e-3)
    assert result.attrs["ordinate"] == "COF"
    assert result["shift_factor"].sel(Speed=1e-3) == 0
    np.testing.assert_allclose(result["shift_factor"], EXPONENT * np.array([0, 1, 2]), atol=0.02)


def test_measured_moduli_with_a_row_of_units_and_scattering_temperatures():
    table = read_table(DATA / "freq_user_raw.csv")
    assert table.attrs["units"] == {"f": "Hz", "E_stor": "MPa", "E_loss": "MPa", "T": "degC", "Set": "-"}
    kept = table[(table["T"] > 39) & (table["T"] < 80)]
    kept.attrs.update(table.attrs)
    result = master_curve(kept)
    assert (result.attrs["ordinate"], result.attrs["companion"]) == ("E_stor", "E_loss")
    assert result.attrs["vertical"].startswith("a modulus: b_T")
    assert result.sizes["T"] == 6
    assert np.all(np.diff(result["shift_factor"]) < 0)  # log10 a_T falls with temperature
    assert float(result["wlf_c1"]) > 0
    assert master_curve(kept, "f", "E_stor", "T", "none").attrs["companion"] == ""


def moduli_of_a_rubber(readings):
    """Return G' and G'' of one relaxation spectrum, shifted; readings scatter about the temperatures."""
    rows = []
    for temperature in (0.0, 15.0, 30.0, 45.0):
        for k, frequency in enumerate(np.geomspace(0.1, 30, 12)):
            w = 1j * frequency * 10 ** (-0.05 * (temperature - 30))
            modulus = 1e6 * (1 + sum(w * t / (1 + w * t) * t**-0.3 for t in np.geomspace(1e-4, 1e2, 13)))
            rows.append((frequency, modulus.real, modulus.imag, temperature + readings[k % len(readings)]))
    return rows


def test_moduli_may_be_given_by_other_columns(tmp_path):
    moduli = np.array(moduli_of_a_rubber([0.0]))
    f, storage, loss, temperature = moduli.T
    polar = [f, np.hypot(storage, loss), np.degrees(np.arctan2(loss, storage)), temperature]
    others = {
        ("f [Hz]", "|G*| [MPa]", "delta [deg]", "T [K]", "Normal force [N]"): [*polar, np.arange(f.size)],
        ("f [Hz]", "G' [MPa]", "tan d", "T [K]"): [f, storage, loss / storage, temperature],
    }
    for heads, columns in others.items():
        pd.DataFrame(dict(zip(heads, columns, strict=True))).to_csv(tmp_path / "t.csv", index=False)
        table = read_table(tmp_path / "t.csv")
        over, found, by = columns_to_use(table, None, None, None)
        np.testing.assert_allclose(table[list(found)].to_numpy(), moduli[:, 1:3])
        assert table.attrs["units"][found[1]] == "MPa"
        require_one_group(table, (over, *found, by))


def test_rounded_readings_of_one_sweep_are_one_temperature():
    table = pd.DataFrame(moduli_of_a_rubber([0.1, 0.0, -0.1, 0.0]), columns=["f", "G'", "G''", "T"])
    curve = master_curve(table)
    assert curve["T"].to_numpy() == pytest.approx([0, 15, 30, 45], abs=0.05)
    assert curve["shift_factor"].to_numpy() == pytest.approx([1.5, 0.75, 0.0, -0.75], abs=0.05)
    set_values = np.repeat([20.0, 21.0, 22.0, 40.0, 60.0], 6)
    sweep = np.tile(np.geomspace(1, 10, 6), 5)
    assert np.unique(clusters(set_values, sweep)).size == 5
    assert np.unique(clusters(np.sort(set_values), np.arange(30.0))).size == 5


def test_a_reference_between_velocities_follows_their_logarithm():
    exact = store(noise=0.0)[["friction_coefficient"]]
    middle = float(np.sqrt(exact["velocity"][2] * exact["velocity"][3]))
    curve = master_curve(exact, reference=middle)
    law_says = EXPONENT * np.log10(curve["velocity"] / middle)
    np.testing.assert_allclose(curve["shift_factor"], law_says, atol=0.01)
    assert curve.attrs["reference"] == middle


def test_tables_without_names_and_with_a_name_twice_are_refused(tmp_path):
    for text, message in (("1,2\n3,4\n", "expected names of columns"), ("a,a\n1,2\n", "column 'a' is given twice")):
        (tmp_path / "table.csv").write_text(text)
        with pytest.raises(DataError, match=message):
            read_table(tmp_path / "table.csv")


def test_columns_of_one_quantity_that_agree_are_one():
    frame = pd.DataFrame({"Frequency": [1.0, 10.0, 100.0], "Angular frequency": [6.28, 62.8, 628.0]})
    assert column_of(frame, "frequency") == "Frequency"
    assert column_of(frame.assign(Frequency=[1.0, 10.0, 90.0]), "frequency") is None
    warm = pd.DataFrame({"Temp.": [20.0, 40.0], "T": [293.15, 313.15]})
    assert column_of(warm, "temperature") == "Temp."


def test_tables_that_are_ambiguous_or_incomplete_are_refused():
    frame = pd.DataFrame({"force": [1.0, 2, 1, 2], "mu": [1.0, 2, 3, 4], "velocity": [1.0, 1, 2, 2]})
    with pytest.raises(DataError, match="varies in 'temperature' too"):
        master_curve(frame.assign(temperature=[1.0, 2, 3, 4]))
    with pytest.raises(DataError, match="varies in 'force' too"):
        master_curve(frame.rename(columns={"velocity": "frequency"}).assign(T=[1.0, 1, 2, 2]), "frequency", "mu", "T")
    with pytest.raises(DataError, match="expected a column 'hardness'"):
        master_curve(frame, ordinate="hardness")
    with pytest.raises(DataError, match=r"row 1: 'mu' must be positive, .*, got -1$"):
        master_curve(frame.assign(mu=[1.0, -1, 1, 1]))
    with pytest.raises(DataError, match="expected a reference between 1 and 2, got 50"):
        master_curve(frame, reference=50.0)
    with pytest.raises(DataError, match="two or more values of 'velocity', got one value"):
        master_curve(frame.assign(velocity=1.0))


def plateau(temperatures, points, noise=0.005):
    """Modulus over frequency that runs into a plateau; neighbours of ten kelvin lie 1.4 decades apart."""
    random, rows = np.random.default_rng(0), []
    for kelvin in temperatures:
        frequency = np.geomspace(0.1, 10, points)
        modulus = 1 / (1 + frequency * 10 ** (0.14 * (kelvin - 300.0)))
        rows.extend((f, m, kelvin) for f, m in zip(frequency, modulus, strict=True))
    table = pd.DataFrame(rows, columns=["frequency", "modulus", "temperature"])
    return table.assign(modulus=table["modulus"] * (1 + noise * random.standard_normal(len(table))))


def test_rows_without_a_finite_number_are_counted():
    table = plateau(np.arange(290.0, 340.0, 10), 12)
    table.loc[3, "modulus"], table.loc[20, "modulus"], table.loc[40, "frequency"] = np.nan, np.inf, np.nan
    kept, sentence = finite_rows(table, ["frequency", "modulus"])
    assert len(kept) == len(table) - 3
    assert sentence == "rows without a finite number are left out: 3 of 60 ('frequency' in 1, 'modulus' in 2)"
    assert finite_rows(kept, ["frequency", "modulus"])[1] == ""


@pytest.mark.parametrize(
    "temperatures", [[300.0, 310.0, 320.0, 330.0], [300.0, 310.0, 350.0], [300.0, 304.0, 330.0, 331.0]]
)
def test_two_points_a_curve_are_groups_of_their_own(temperatures):
    """Set temperatures that occur twice each are no scatter about one, however they are spaced."""
    assert curves_of(plateau(temperatures, 2), "frequency", ["modulus"], "temperature")[0].tolist() == temperatures


def test_steps_of_a_plateau_are_named_and_the_curves_do_not_count_as_collapsed():
    table = plateau(np.arange(260.0, 341.0, 10), 12)
    curve = master_curve(table, reference=300.0, vertical="none")
    assert curve.attrs["undetermined"].startswith("not determined between 260 and ")
    assert "the curves collapse: not tested" in curve["law_holds"].item()
    truth = 0.14 * (curve["temperature"] - 300)
    assert np.all((curve["shift_factor_low"] <= truth) & (truth <= curve["shift_factor_high"]))
    determined = master_curve(plateau(np.arange(300.0, 351.0, 10), 12), vertical="none")
    assert determined.attrs["undetermined"] == ""
    assert "the curves collapse: yes" in determined["law_holds"].item()
