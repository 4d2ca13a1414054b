"""What a master curve says of its curves and of the law of their shifts."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from mdr_dask.fits.collapse import laws_of, with_verdict
from mdr_dask.fits.master_curve import master_curve

TEMPERATURES = np.arange(0.0, 61.0, 10.0)  # degrees Celsius
REFERENCE = 30.0


def wlf(temperature):
    return -8.0 * (temperature - REFERENCE) / (100.0 + temperature - REFERENCE)


def modulus(seed, scatter, *, shift=wlf, tilt=0.0):
    """Return a table of moduli on one sigmoid, shifted; `tilt` bends each curve in its own way."""
    rng = np.random.default_rng(seed)
    rows = []
    for number, temperature in enumerate(TEMPERATURES):
        x = np.linspace(-1.0, 1.0, 25)
        y = 6.0 + 1.5 * np.tanh((x + shift(temperature)) / 2.0) + tilt * (-1) ** number * (x**2 - 0.4)
        y += scatter * rng.standard_normal(x.size)
        rows += [(10**a, 10**b, temperature) for a, b in zip(x, y, strict=True)]
    return pd.DataFrame(rows, columns=["frequency", "modulus", "temperature"])


def step(temperature):
    return wlf(temperature) + (0.6 if temperature > 25.0 else 0.0)


@pytest.mark.parametrize(
    ("case", "verdicts"),
    [
        ({}, ("approximately: ", "the curves collapse: yes", "wlf: approximately: departs by")),
        ({"shift": step}, ("no: ", "the curves collapse: yes", "wlf: no", "arrhenius: no")),
        ({"tilt": 0.3}, ("not tested: ", "the curves collapse: not tested: shift factors are not determined")),
    ],
    ids=["as planted", "a step in the shifts", "curves of their own shape"],
)
def test_what_is_planted_is_told(case, verdicts):
    sentence = master_curve(modulus(1, 0.01, **case))["law_holds"].item()
    assert sentence.startswith(verdicts[0]), sentence
    assert all(verdict in sentence for verdict in verdicts[1:]), sentence


@pytest.mark.slow
def test_a_law_that_holds_is_rarely_contradicted():
    """Each of two tests rejects what holds with a chance of 5 %. Scatter of 2 % is too large to confirm the law."""
    sentences = [master_curve(modulus(seed, 0.02))["law_holds"].item() for seed in range(8)]
    assert sum(sentence.startswith("no: ") for sentence in sentences) <= 1, sentences


def test_shift_factors_that_are_not_determined_contradict_no_law():
    curve = xr.Dataset(attrs={"undetermined": "not determined between 0 and 30"})
    assert with_verdict(curve, {"wlf": "no: departs by 90 % rms"})["law_holds"].item().startswith("not tested: ")


def test_too_few_curves_leave_a_law_untested():
    table = modulus(1, 0.01)
    sentence = master_curve(table[table["temperature"].isin([20.0, 30.0])])["law_holds"].item()
    assert sentence.startswith("not tested: the curves collapse: yes")
    assert "law of the shifts: not tested: the law arrhenius needs more than 1 shift factors" in sentence


def test_degrees_celsius_and_kelvin_follow_the_same_laws():
    random = np.random.default_rng(0)
    draws = wlf(TEMPERATURES) + np.where(TEMPERATURES == REFERENCE, 0, 0.01 * random.standard_normal((200, 7)))
    result = SimpleNamespace(groups=TEMPERATURES, horizontal=wlf(TEMPERATURES), draws=draws)
    warmer = SimpleNamespace(**vars(result) | {"groups": TEMPERATURES + 273.15})
    celsius, _ = laws_of(result, "frequency", "degC", REFERENCE, is_temperature=True)
    kelvin, _ = laws_of(warmer, "frequency", "K", REFERENCE + 273.15, is_temperature=True)
    for one, other in zip(celsius, kelvin, strict=True):
        for name, values in one.constants.items():
            assert values == pytest.approx(other.constants[name], rel=1e-6), name
    arrhenius, williams = celsius
    assert williams.constants["c2"][0] == pytest.approx(100.0, rel=1e-3)
    rise = np.polyfit(1 / (TEMPERATURES + 273.15), np.log(10) * wlf(TEMPERATURES), 1)[0]
    assert arrhenius.constants["activation_energy"][0] == pytest.approx(8.314462618 * rise, rel=0.05)
