"""Materials, temperatures, tables and files of surfaces: what each becomes, its notes, and how it is refused."""

import numpy as np
import pytest
import record
from pydantic import ValidationError
from references.areal import areal_surface

from mdr_dask.errors import DataError
from mdr_dask.models.parts import moduli_table, surface_report
from mdr_dask.models.parts.loading_history import Jump as OneJump
from mdr_dask.models.parts.loading_history import Oscillation, Ramp, Steps, TableFile, pieces
from mdr_dask.models.parts.material import Material, fit_error, frequencies, solid_of
from mdr_dask.models.parts.rough_line import Generated, Measured, OfSurface, Smooth
from mdr_dask.models.parts.surface import Surface, lines_of, spectra_of
from mdr_dask.models.parts.surface_files import read_map
from mdr_dask.models.parts.temperature import Arrhenius, ShiftFactors, Wlf
from mdr_dask.physics.surfaces.spectrum import self_affine
from mdr_dask.units import to_si

ARRHENIUS = {"activation_energy": 1.545e5, "reference": 299.0}
WLF = {"c1": 11.0, "c2": 93.0, "reference": 301.0}
SHIFTS = "T [degC],a_T\n5,130\n25,1.7\n31,0.4\n60,0.002\n"
TWO_COLUMNS = "T [K],log10 a_T\n280,2\n320,-1\n"
LAW = {"static_modulus": 2e6, "loss_modulus": 1e5, "frequency": 700.0, "exponent": 0.3, "lowest": 2.0, "highest": 3e4}


def dma(temperatures=(283.0, 298.0, 313.0), unit="MPa", tension=1.0, tan=False, gap=1.0):
    omega = np.geomspace(0.7, 110.0, 9)
    rows = [
        f"frequency [Hz],storage modulus [{unit}],{'tan delta' if tan else f'loss modulus [{unit}]'},temperature [K]"
    ]
    for temperature in temperatures:
        factor = 10 ** ((298.0 - temperature) / 11.0)
        reduced = 1j * omega * factor * 0.01
        modulus = tension * (
            2.0 + sum(g * reduced * t / (1 + reduced * t) for g, t in ((3.0, 0.02), (5.0, 0.3), (9.0, 4.0)))
        )
        modulus = modulus * (gap if temperature > 300 else 1.0)
        last = modulus.imag / modulus.real if tan else modulus.imag
        for w, storage, loss in zip(omega, modulus.real, last, strict=True):
            rows.append(f"{w / (2 * np.pi):.9g},{storage:.9g},{loss:.9g},{temperature + 0.03 * np.log(w):.6g}")
    return "\n".join(rows) + "\n"


def made(kind, directory, **values):
    return kind.model_validate(values, context={"directory": directory, "to_si": to_si})


def logs(values):
    with np.errstate(all="ignore"):
        return np.log(values)


def words(call):
    """Return what is told of what is refused."""
    with pytest.raises((ValidationError, DataError, ValueError)) as caught:
        call()
    error = caught.value
    if not isinstance(error, ValidationError):
        return str(error)
    return "; ".join(f"{each['loc']}: {each['msg']}" for each in error.errors())


def test_materials(tmp_path, dataframe_regression):
    (tmp_path / "several.csv").write_text(dma())
    (tmp_path / "one.csv").write_text(dma((298.0,), "kPa", 3.0, True))
    (tmp_path / "soft.csv").write_text(dma((298.0,), "uPa"))
    (tmp_path / "apart.csv").write_text(dma((283.0, 340.0), gap=0.01))
    (tmp_path / "shifts.csv").write_text(SHIFTS)
    warm = {"temperature": 311.0, "wlf": WLF}
    kinds = {
        "kelvin": {"kelvin": {"shear_modulus": 3e6, "relaxation_time": 2e-3}},
        "standard": {"standard_solid": {"static_modulus": 3e6, "glass_modulus": 7e8, "relaxation_time": 2e-3}},
        "prony": {"prony": {"static_modulus": 3e6, "moduli": [1e6, 4e7], "times": [0.3, 1e-3], "viscosity": 7.0}},
        "law": {"power_law": LAW},
        "warm law": {"power_law": LAW} | warm,
        "activated": {
            "power_law": LAW,
            "temperature": 330.0,
            "arrhenius": {"activation_energy": 9e4, "reference": 300.0},
        },
        "shifted": {"power_law": LAW, "temperature": 288.0, "shift_factors": "shifts.csv"},
        "one": {"dma_table": {"file": "one.csv", "poisson_ratio": 0.47}},
        "one warm": {"dma_table": "one.csv"} | warm,
        "one hot": {"dma_table": {"file": "one.csv", "arms_per_decade": 2.0}, "temperature": 390.0, "wlf": WLF},
        "chosen": {"dma_table": {"file": "several.csv", "table_temperature": 313.3}},
        "chosen and warm": {"dma_table": {"file": "several.csv", "table_temperature": 312.6}} | warm,
        "by curves": {"dma_table": {"file": "several.csv", "reference": 298.0}},
        "by curves and warm": {"dma_table": {"file": "several.csv", "reference": 290.0}} | warm,
        "by a law": {"dma_table": "several.csv", "temperature": 311.0, "arrhenius": ARRHENIUS},
        "by factors": {"dma_table": "several.csv", "shift_factors": "shifts.csv"},
        "no solid": {"dma_table": "soft.csv"},
    }
    found = {}
    for name, kind in kinds.items():
        one = made(Material, tmp_path, **kind)
        solid = solid_of(one)
        found[name] = logs(np.array([solid.static_modulus, solid.viscosity + 1e-9, *solid.moduli, *solid.times]))
        found[f"{name}: error"] = np.array([fit_error(one), *(logs(frequencies(one) or (1.0, 1.0)))])
        found[f"{name}: notes"] = " | ".join(one.notes())
        if one.dma_table is not None:
            curve = moduli_table.one_curve(one.dma_table, one.law)
            found[f"{name}: curve"] = logs([curve.omega, curve.storage, curve.loss])
            found[f"{name}: where"] = (
                f"{curve.superposed} {curve.temperature or 0:.6g} {np.round(curve.measured or 0, 3)}"
            )
    refused = {
        "no law": {"dma_table": "several.csv"},
        "apart": {"dma_table": {"file": "apart.csv", "reference": 300.0}},
        "no such temperature": {"dma_table": {"file": "several.csv", "table_temperature": 200.0}},
        "too cold": {"power_law": LAW, "temperature": 207.0, "wlf": WLF},
        "beyond the factors": {"power_law": LAW, "temperature": 400.0, "shift_factors": "shifts.csv"},
        "a law alone": {"power_law": LAW, "wlf": WLF},
        "two kinds": {"power_law": LAW, "dma_table": "one.csv"},
        "uneven": {"prony": {"static_modulus": 3e6, "moduli": [1e6], "times": [0.3, 1e-3]}},
        "an exponent of one": {"power_law": LAW | {"exponent": 1.0}},
        "highest first": {"power_law": LAW | {"highest": 1.0}},
        "a glass below": {"standard_solid": {"static_modulus": 3e6, "glass_modulus": 1e6, "relaxation_time": 1.0}},
    }
    for name, kind in refused.items():
        found[f"refused: {name}"] = words(lambda kind=kind: solid_of(made(Material, tmp_path, **kind)))
    record.check(dataframe_regression, found)


def test_laws_of_temperature(tmp_path, dataframe_regression):
    (tmp_path / "shifts.csv").write_text(SHIFTS)
    (tmp_path / "decades.csv").write_text(TWO_COLUMNS)
    warm, found = np.array([284.0, 299.0, 301.0, 317.0]), {}
    factors = {name: made(ShiftFactors, tmp_path, file=name) for name in ("shifts.csv", "decades.csv")}
    for name, law in {
        **factors,
        "wlf": Wlf(**WLF),
        "arrhenius": Arrhenius(activation_energy=7e4, reference=301.0),
    }.items():
        found[name], found[f"{name} at"] = logs(law.factor(warm)), law.reference
    tables = {
        "both": "T [K],a_T,log10 a_T\n280,100,2\n320,0.1,-1\n",
        "none": "T [K],other\n280,100\n320,0.1\n",
        "rises": "T [K],a_T\n280,0.1\n320,10\n",
        "same": "T [K],a_T\n280,10\n280,0.1\n",
        "one": "T [K],a_T\n280,1\n",
        "never one": "T [K],a_T\n280,10\n320,2\n",
    }
    for name, table in tables.items():
        (tmp_path / f"{name}.csv").write_text(table)
        found[f"refused: {name}"] = words(lambda name=name: made(ShiftFactors, tmp_path, file=f"{name}.csv"))
    found["refused: cold"] = words(lambda: Wlf(**WLF).factor(np.array([300.0, 208.0])))
    found["refused: outside"] = words(lambda: factors["shifts.csv"].factor(np.array([300.0, 270.0])))
    record.check(dataframe_regression, found)


def test_loading_histories(tmp_path, dataframe_regression):
    (tmp_path / "way.csv").write_text("time [ms],velocity [mm/s],force [N]\n0,1,2\n3,5,2\n3,7,4\n9,7,1\n")
    (tmp_path / "short.csv").write_text("time [s],velocity [m/s]\n0,1\n3,5\n")
    for name, table in {"late": "t [s],v [m/s]\n1,1\n3,5\n", "back": "t [s],v [m/s]\n0,1\n3,5\n2,5\n"}.items():
        (tmp_path / f"{name}.csv").write_text(table)
    rest = {"start": "rest"}
    steps = {"shape": "steps", "times": (0.2, 0.5), "velocities": (3.0, 4.0), "forces": (5.0, 6.0)}
    found = {}
    for name, protocol in {
        "jump": OneJump(),
        "steps": Steps(**steps),
        "from rest": Steps(**steps | rest | {"forces": None}),
        "ramp": Ramp(shape="ramp", duration=0.3, velocity=0.7),
        "heavier": Ramp(shape="ramp", duration=0.3, force=9.0, **rest),
        "swing": Oscillation(shape="oscillation", amplitude=0.3, frequency=7.0, force_amplitude=1.0),
        "table": made(TableFile, tmp_path, shape="table", file="way.csv"),
        "short table": made(TableFile, tmp_path, shape="table", file="short.csv", **rest),
    }.items():
        before, parts = pieces(protocol, 0.11, 2.3, 0.2)
        found[name] = f"{before} " + " ".join(map(str, parts))
    for name in ("late", "back"):
        found[f"refused: {name}"] = words(
            lambda name=name: made(TableFile, tmp_path, shape="table", file=f"{name}.csv")
        )
    heavy = Oscillation(shape="oscillation", amplitude=0.3, frequency=7.0, force_amplitude=2.3)
    found["refused: heavy"] = words(lambda: pieces(heavy, 0.11, 2.3, 0.2))
    record.check(dataframe_regression, found)


LENGTH, POINTS = 1.3e-3, 96


def surface_files(directory):
    """Write a map, rougher in x, one with damage, a scan, and tables of spectra."""
    spectrum = self_affine(0.7, LENGTH / 4, LENGTH / 24, 1e-6)
    height = areal_surface(spectrum, (POINTS, POINTS), (LENGTH, LENGTH), 1, 0)
    np.save(directory / "map.npy", height.T * 1e6)
    damaged = height + 2e-8 * np.random.default_rng(3).standard_normal(height.shape)
    damaged[40, 50], damaged[60:62, 30:33] = 1e-3, np.nan
    np.save(directory / "damaged.npy", damaged.T * 1e6)
    np.save(
        directory / "grooved.npy", (height + 2e-6 * np.sin(40 * np.pi * np.arange(POINTS) / POINTS)[:, None]).T * 1e6
    )
    place = np.arange(POINTS) * LENGTH / POINTS
    steps = height + 1.2e-7 * np.sign(np.sin(34 * np.pi * (np.arange(POINTS) + 0.5) / POINTS))[None, :]
    np.save(directory / "steps.npy", steps.T * 1e6)
    scan = "\n".join(f"{1e3 * x:.9g};{1e6 * z:.9g}" for x, z in zip(place, height[:, 7] + 2e-3 * place, strict=True))
    (directory / "scan.csv").write_text("x [mm];z [um]\n" + scan)
    q = np.geomspace(2e4, 2e6, 30)
    for name, head, density in (
        ("areal", "q [rad/m],C2D [m^4]", 3e-4 * q**-3.4),
        ("line", "q [rad/m],C1D [m^3]", 3e-4 * q**-2.4),
        ("cut", "q [rad/m],C cut [m^3]", 3e-4 * q**-2.4),
    ):
        (directory / f"{name}.csv").write_text(
            "\n".join([head, *(f"{a:.9g},{b:.9g}" for a, b in zip(q, density, strict=True))])
        )
    waves = "wavelength [um],C2D [m^4]\n" + "\n".join(f"{2e6 * np.pi / a:.9g},{3e-4 * a**-3.4:.9g}" for a in q)
    (directory / "waves.csv").write_text(waves)


def test_measured_surfaces(tmp_path, dataframe_regression):
    surface_files(tmp_path)
    maps = {"files": ["map.npy"], "spacing": LENGTH / POINTS, "unit": "um"}
    kinds = {
        "map": {"map": maps},
        "periodic": {"map": maps | {"window": "none", "detrend": "mean"}},
        "stretched": {"map": maps | {"spacing_y": 1.1 * LENGTH / POINTS, "direction": "y", "detrend": "parabola"}},
        "damaged": {"map": maps | {"files": ["damaged.npy"], "direction": "x"}},
        "filled": {"map": maps | {"files": ["damaged.npy"], "outliers": "fill"}},
        "grooved": {"map": maps | {"files": ["grooved.npy"], "direction": "x"}},
        "steps": {"map": maps | {"files": ["steps.npy"], "direction": "x"}},
        "two": {"map": maps | {"files": ["map.npy", "damaged.npy"], "outliers": "fill"}},
        "scan": {"scan": "scan.csv"},
        "closed scan": {"scan": {"files": ["scan.csv"], "window": "none", "detrend": "parabola"}},
        "areal": {"spectrum": "areal.csv", "shortest_wavelength": 1e-5, "longest_wavelength": 2e-4},
        "further": {"spectrum": "areal.csv", "shortest_wavelength": 1e-6, "extrapolate": True},
        "line": {"spectrum": "line.csv"},
        "cut": {"spectrum": "cut.csv"},
        "waves": {"spectrum": "waves.csv"},
    }
    found = {}
    for name, kind in kinds.items():
        one = made(Surface, tmp_path, **kind)
        found[f"{name}: notes"] = " | ".join(one.notes())
        spectra = spectra_of(one)
        found[name] = logs(
            [value for each in spectra for value in (each.rms_height(), each.rms_gradient(), *each.wavelengths)]
        )
        found[f"{name}: lines"] = logs(np.concatenate(lines_of(one, 1e-3, 60)) + 1e-12)
        line = OfSurface(one, 120, 1e-3)
        found[f"{name}: waves"] = np.array(
            [line.height() * 1e6, line.slope(0), line.slope(3), *line.waves(2, 3).heights(120)[:5]]
        )
        if one.map is not None:
            heights = read_map(one.map.files[0], one.map)
            found[f"{name}: heights"] = np.append(heights.height * 1e6, np.array(heights.size) * 1e3)
    report = surface_report.reports(made(Surface, tmp_path, **kinds["filled"]))[0]
    report_of_scan = surface_report.reports(made(Surface, tmp_path, **kinds["scan"]))[0]
    for name, each in (("filled", report), ("scan", report_of_scan)):
        numbers = [value for key, value in each.row.items() if key != "file"]
        found[f"report of {name}"] = logs(np.array(numbers, dtype=float))
        found[f"bins of {name}"] = logs([each.bins.wavenumber, each.bins.density])
        for key, cut in each.cuts.items():
            found[f"cut of {name} along {key}"] = logs(np.array(cut) + 1e-300)
    found["units of reports"] = str(surface_report.UNITS)
    q, mean, error = surface_report.mean_spectrum(spectra_of(made(Surface, tmp_path, **kinds["two"])))
    found["mean of two"] = logs([q, mean, error])
    refused = {
        "grooved": {"map": maps | {"files": ["grooved.npy"]}},
        "too long": {"spectrum": "areal.csv", "longest_wavelength": 1.0},
        "too short": {"spectrum": "areal.csv", "shortest_wavelength": 1e-9},
        "nothing to reach": {"spectrum": "areal.csv", "extrapolate": True},
        "two kinds": {"spectrum": "areal.csv", "scan": "scan.csv"},
        "cut profile": {"profile": "scan.csv", "shortest_wavelength": 1e-5},
        "no spacing": {"map": {"files": ["map.npy"], "unit": "um"}},
        "no unit": {"map": {"files": ["map.npy"], "spacing": 1e-5}},
        "no such unit": {"map": {"files": ["map.npy"], "spacing": 1e-5, "unit": "parsley"}},
        "no heights": {"spectrum": "scan.csv"},
    }
    for name, kind in refused.items():
        found[f"refused: {name}"] = words(lambda kind=kind: made(Surface, tmp_path, **kind))
    far = made(Surface, tmp_path, **kinds["areal"])
    found["refused: no wave fits"] = words(lambda: lines_of(far, 1e-6, 8))
    record.check(dataframe_regression, found)


def test_lines_by_their_kind(tmp_path, dataframe_regression):
    surface_files(tmp_path)
    found = {}
    profiles = [
        {"file": "scan.csv"},
        {"file": "scan.csv", "detrend": "parabola", "taper": 0.2},
        {"file": "scan.csv", "detrend": "none", "shortest_wavelength": 6e-5, "longest_wavelength": 7e-4},
    ]
    for k, profile in enumerate(profiles):
        one = made(Surface, tmp_path, profile=profile)
        line = Measured(one.profile)
        found[f"profile {k}"] = np.array(
            [line.points, line.height() * 1e6, line.slope(2), *line.waves(1, 2).heights(96)[:4]]
        )
        found[f"profile {k}: notes"] = " | ".join(one.profile.notes())
        found[f"profile {k}: random"] = f"{line.is_random}"
    made_line, smooth = Generated(0.6, 40, 3.3, 1.7), Smooth(40)
    found["generated"] = np.append(made_line.waves(3, 1).heights(80), made_line.slope(0))
    found["smooth"] = np.append(smooth.waves(3, 1).heights(80), smooth.slope(0))
    found["kinds"] = f"{made_line.is_random} {smooth.is_random} {smooth.waves(1, 1).points}"
    record.check(dataframe_regression, found)
