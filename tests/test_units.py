"""Units: conversion to SI, refused quantities, durations."""

from __future__ import annotations

import math
import re
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mdr_dask import models
from mdr_dask.campaign.fields import usual, walk
from mdr_dask.campaign.reference import output_rows, parameter_rows
from mdr_dask.errors import did_you_mean
from mdr_dask.models.base import unit_of
from mdr_dask.units import expected, likely, shown, to_si


@pytest.mark.parametrize(
    ("written", "unit", "value"),
    [
        ("20 mm", "m", 0.02),
        ("0.02", "m", 0.02),
        ("1.1 mm", "m", 0.0011),
        ("0.7 um", "m", 7e-7),
        ("0.7 µm", "m", 7e-7),
        ("0.7 micrometers", "m", 7e-7),
        ("1 %", "1", 0.01),
        ("3 ppm", "1", 3e-6),
        ("1e6 cycles", "1", 1e6),
        ("200 HV10", "Pa", 200 * 9.80665e6),
        ("180 deg", "rad", math.pi),
        ("180°", "rad", math.pi),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("20 degC", "K", 293.15),
        ("-273.15 °C", "K", 0.0),
        ("10 MPa", "Pa", 1e7),
        ("10 N/mm²", "Pa", 1e7),
        ("10 mPa s", "Pa s", 0.01),
        ("1 cP", "Pa s", 0.001),
        ("20 1/GPa", "1/Pa", 2e-8),
        ("5 /ms", "1/s", 5000.0),
        ("2 J/(g K)", "J/(kg K)", 2000.0),
        ("1 cSt", "m^2/s", 1e-6),
        ("1.5 min", "s", 90.0),
        ("1 in", "m", 0.0254),
        ("100 kJ/mol", "J/mol", 1e5),
    ],
)
def test_quantities_become_si(written, unit, value):
    assert to_si(written, unit) == pytest.approx(value, rel=4e-16, abs=0)


@pytest.mark.parametrize(
    ("written", "unit", "message"),
    [
        ("3 s", "m", r"expected a length \(such as '20 mm'\), got '3 s'"),
        ("5 %", "rad", r"expected an angle \(such as '5 deg'\), got '5 %'"),
        ("5 deg", "1", "expected a pure number, got '5 deg'"),
        ("1 Hz", "rad/s", r"angular frequency .* \(1 Hz is 6.283 rad/s\), got '1 Hz'"),
        ("3 rpm", "Hz", r"\(1 rpm is 0.01667 Hz\)"),
        ("60 HRC", "Pa", "Rockwell hardness is not a pressure"),
        ("3 Mpa", "Pa", r"unknown unit 'Mpa' \(did you mean 'MPa'\?\), got '3 Mpa'"),
        ("1,5 mm", "m", "expected a length"),
        ("1 2 mm", "m", "expected a length"),
        ("3 mm^", "m", "expected a length"),
        ("3 (", "m", "expected a length"),
        ("ten mm", "m", "expected a length"),
        ("1e400 m", "m", "expected a finite number, got '1e400 m'"),
    ],
)
def test_what_is_no_such_quantity_is_refused(written, unit, message):
    with pytest.raises(ValueError, match=message):
        to_si(written, unit)


@given(st.floats(1e-9, 1e9), st.sampled_from([("nm", -9), ("um", -6), ("mm", -3), ("cm", -2), ("km", 3), ("Gm", 9)]))
def test_decimal_units_round_once(number, unit):
    name, power = unit
    mantissa, _, exponent = f"{number!r}".partition("e")
    assert to_si(f"{number!r} {name}", "m") == float(f"{mantissa}e{int(exponent or 0) + power}")


def test_every_unit_named_in_messages_is_readable():
    for unit in ("m", "m/s", "s", "N", "N/m", "Pa", "1/Pa", "Pa s", "rad", "K", "kg/m^3", "m^2/s"):
        example = expected(unit).split("'")[1]
        assert to_si(example, unit) > 0


COHERENT = {"m", "s", "kg", "N", "Pa", "K", "rad", "J", "W", "S", "ohm", "mol", "Hz"}


@pytest.mark.parametrize("name", models.NAMES)
def test_models_declare_units_that_are_si(name):
    model = pytest.importorskip(f"mdr_dask.models.{name}").MODEL
    units = {row["unit"] for row in (*parameter_rows(model), *output_rows(model))} - {"", "1"}
    for unit in units - {"m^(1-n)"}:  # of a power-law coefficient: depends on its exponent, so a number only
        assert set(re.findall("[A-Za-zµΩ°%]+", unit)) <= COHERENT
        assert to_si(f"1 {unit}", unit) == 1.0


@pytest.mark.parametrize("name", models.NAMES)
def test_every_quantity_declares_a_usual_value(name):
    """A number without a unit is compared with the usual value. A path is also given without dimension."""
    for path, kind, info in walk(models.load(name).parameters):
        if path != "path" and unit_of(kind, path.rpartition(".")[2]) not in ("1", "m^(1-n)", None):
            assert usual(info), path


@pytest.mark.parametrize(
    "value",
    [
        "1 m**9**9**9**9",
        "1 m/s*(9**9**9**9)",
        "1 m^(9^9^9^9)/s",
        "1 m^200",
        "1 " + "x" * 100_000,
        "1e999999999 m",
        "1 m**1.5",
    ],
)
def test_units_that_would_keep_the_parser_busy_are_refused_at_once(value):
    began = time.process_time()
    with pytest.raises(ValueError, match="expected"):
        to_si(value, "m")
    assert time.process_time() - began < 1


@pytest.mark.parametrize(
    ("value", "unit", "usual", "meant"),
    [
        (1500, "rad/s", ["100 rpm"], "1500 rpm"),
        (10.5, "rad/s", ["100 rpm"], None),
        (200, "Pa", ["2 GPa", "200 HV"], "200 HV"),
        (2, "Pa", ["2 GPa", "200 HV"], "2 GPa"),
        (60, "K", ["20 degC"], "60 degC"),
        (300, "K", ["20 degC"], None),
        (20, "m", ["10 mm"], "20 mm"),
        (0.5, "m", ["10 mm"], "0.5 mm"),
        (40, "m", ["50 mm"], "40 mm"),
        (0.02, "m", ["10 mm"], None),
        (0.885, "kg/m^3", ["870 kg/m^3", "0.87 g/cm^3"], "0.885 g/cm^3"),
        (20, "1", ["0.25", "25 %"], "20 %"),
        (2, "1", ["0.25", "25 %"], None),
        (1e8, "1", ["10000"], None),
    ],
)
def test_a_number_without_a_unit_is_doubtful_where_another_unit_is_likelier(value, unit, usual, meant):
    assert likely(value, unit, usual) == (meant or "")


@pytest.mark.parametrize(
    ("word", "known", "hint"),
    [
        ("roller_diameter", ["roller_radius", "roller_width"], "'roller_radius', half the diameter?"),
        ("pressure", ["normal_force", "velocity"], "'normal_force', a load instead of a pressure?"),
        ("sliding_speed", ["normal_force", "velocity"], "'velocity'?"),
        ("normal_forse", ["normal_force", "velocity"], "'normal_force'?"),
    ],
)
def test_hints_name_related_quantities(word, known, hint):
    assert did_you_mean(word, known) == f" (did you mean {hint})"


@pytest.mark.parametrize(
    ("value", "text"), [(5e-4, "500 um"), (1e3, "1 km"), (1.701e32, "1.701e+32 m"), (3e-30, "3e-30 m")]
)
def test_sizes_beyond_the_prefixes_have_none(value, text):
    assert shown(value, "m") == text
