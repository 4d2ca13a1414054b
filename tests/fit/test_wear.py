import json

import numpy as np
import pytest
import xarray as xr

from mdr_dask.errors import DataError, FitError
from mdr_dask.fit.wear import FITS, best_xi, wear_coefficient
from mdr_dask.models.base import DataFile
from mdr_dask.models.fretting_wear import MODEL
from mdr_dask.models.fretting_wear.parameters import FrettingWear
from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.wear import worn as wear
from mdr_dask.physics.wear.factor import at_cycles, fit_factor, volume_curve
from mdr_dask.physics.wear.forced import exact_forced
from mdr_dask.physics.wear.forced_fast import fast_forced

PARABOLA = PowerProfile(2.0)


def named(path):
    from hashlib import sha256

    return DataFile(name=path.name, path=str(path), sha256=sha256(path.read_bytes()).hexdigest())


def group(parameters):
    assert MODEL.name in FITS[0].models
    return {"": xr.Dataset(attrs={"parameters": parameters.model_dump_json()})}


def test_volume_curve_is_the_exact_solution():
    curve = volume_curve(PARABOLA, 0.455)
    np.testing.assert_allclose(at_cycles(curve, [2.0, 8.0]), [0.310754, 0.872404], atol=1e-4)  # tolerance of the curve
    assert at_cycles(curve, 1e6) == pytest.approx(0.9181587, abs=2e-4)


def test_interval_covers_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(3)
    curve = volume_curve(PARABOLA, 0.455, "fast", 0.8)
    cycles = np.linspace(0.3, 8, 12)
    truth = at_cycles(curve, 1.4 * cycles)
    hits = 0
    for _ in range(200):
        factor = fit_factor(lambda s: at_cycles(curve, s * cycles), truth + rng.normal(0, 0.02, 12))
        hits += factor.low < 1.4 < factor.high
    assert abs(hits - 190) < 5 * np.sqrt(200 * 0.95 * 0.05)


def test_wear_coefficient_from_a_table_of_volumes(tmp_path):
    true = 3.7e-4
    settings = {
        "curvature_radius": 0.01,
        "modulus": 115e9,
        "shear_modulus": 90e9,
        "friction": 0.6,
        "amplitude": 1e-6,
        "load": 50.0,
        "hardness": 2e9,
    }
    cycles = np.geomspace(1e3, 3e5, 9)
    from mdr_dask.models.base import Block

    case = FrettingWear(**settings, wear_coefficient=true, method="exact")
    volume = MODEL.compute(Block(case, {"cycles": cycles}, 9, (0,), 0, ("wear_volume",))).values["wear_volume"][:, 0]
    rng = np.random.default_rng(5)
    path = tmp_path / "volume.csv"
    noisy = volume * (1 + 0.02 * rng.normal(size=9))
    path.write_text(
        "# measured\ncycles, volume\n"
        + "\n".join(f"{n!r},{v!r}" for n, v in zip(cycles.tolist(), noisy.tolist(), strict=False))
    )
    result = wear_coefficient(group(case.model_copy(update={"wear_coefficient": 1e-4, "measured": named(path)})))
    assert result["wear_coefficient_low"][0] < true < result["wear_coefficient_high"][0]
    assert result["wear_coefficient"][0] == pytest.approx(true, rel=0.1)
    assert result["explained"][0] > 0.99
    assert result["wear_coefficient"].attrs["units"] == "1"


def test_xi_from_a_profile(tmp_path):
    r = np.linspace(0, 1.4, 80)
    f = wear.fast(PARABOLA, 0.455, 3.0, 0.93).height(r)
    path = tmp_path / "profile.csv"
    path.write_text("radius,height\n" + "\n".join(f"{a!r},{b!r}" for a, b in zip(r.tolist(), f.tolist(), strict=False)))
    result = best_xi(group(FrettingWear(stick_radius=0.455, cycles=3.0, measured=named(path))))
    assert result["xi"][0] == pytest.approx(0.93, rel=1e-3)
    assert result["residual"][0] < 1e-4


def test_cycle_factor_of_a_dimensionless_campaign(tmp_path):
    path = tmp_path / "volume.csv"
    path.write_text("cycles,volume\n1000,0.310754\n4000,0.872404\n")
    result = wear_coefficient(group(FrettingWear(stick_radius=0.455, method="exact", measured=named(path))))
    assert result["cycle_factor"][0] == pytest.approx(0.002, rel=1e-3)


def test_no_table_and_bad_tables(tmp_path):
    with pytest.raises(FitError, match="no series names a table"):
        best_xi(group(FrettingWear(stick_radius=0.455)))
    path = tmp_path / "bad.csv"
    for text, message in (
        ("a,b\n1,2\n", "expected the columns"),
        ("cycles,volume\n1,x\n", "could not convert"),
        ("cycles,volume\n1,nan\n", "must be finite"),
    ):
        path.write_text(text)
        with pytest.raises(DataError, match=message):
            best_xi(group(FrettingWear(stick_radius=0.455, measured=named(path))))
    path.write_text("cycles,volume\n1,0.1\n")
    with pytest.raises(FitError, match="at least 2"):
        best_xi(group(FrettingWear(stick_radius=0.455, measured=named(path))))
    path.write_text("cycles,volume\n0,0\n0,0\n")
    with pytest.raises(FitError, match="do not depend"):
        best_xi(group(FrettingWear(stick_radius=0.455, measured=named(path))))


def test_parameters_come_back_from_a_store():
    text = FrettingWear(stick_radius=0.4, shape="cone").model_dump_json()
    assert FrettingWear.model_validate(json.loads(text)).shape == "cone"


@pytest.mark.parametrize("method", ["fast", "exact"])
def test_volume_curve_under_constant_force(method):
    """As the model has it, and far beyond the limit of constant depth."""
    curve = volume_curve(PARABOLA, 0.5, method, 0.8, constant_force=True)
    if method == "fast":
        expected = [fast_forced(PARABOLA, 0.5, n, 0.8).wear_volume for n in (2.0, 30.0)]
    else:
        expected = [worn.wear_volume for worn in exact_forced(PARABOLA, 0.5, [2.0, 30.0], 1e-3)]
    np.testing.assert_allclose(at_cycles(curve, [2.0, 30.0]), expected, rtol=2e-3)  # a spline over 80 values of N
    assert expected[1] > 1.2 * wear.limit(PARABOLA, 0.5).wear_volume
