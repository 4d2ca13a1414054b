"""Whole blocks of mixed lubrication on record: every output with its error, every rule, oil, surface and warning."""

import itertools

import numpy as np
import record
from flattened import flat, of_result

from mdr_dask.models import load
from mdr_dask.models.base import Block
from mdr_dask.models.mixed_lubrication import points
from mdr_dask.models.mixed_lubrication.declaration import seconds
from mdr_dask.models.mixed_lubrication.operation import operation_of
from mdr_dask.models.mixed_lubrication.turn import creeping, rolling
from mdr_dask.physics.surfaces.spectrum import self_affine

MODEL = load("mixed_lubrication")
ALL = tuple(output.name for output in MODEL.outputs)
NUMBERS = tuple(output.name for output in MODEL.outputs if not output.dims)
FILM = ("film", "film_ratio", "asperity_load_share", "friction_coefficient")
#: A short line, on which everything is quick: 2a is 110 um of 6.9 mm.
SMALL = {
    "rms_roughness": 2.1e-7,
    "points": 6001,
    "roller_radius": 1.1e-3,
    "roller_width": 0.011,
    "normal_force": 107.0,
    "rotation_speed": 13.0,
    "temperature": 331.0,
    "cutoff_force": 93.0,
    "trace_points": 37,
}
OIL = {"temperature_1": 300.0, "viscosity_1": 3.1e-4, "temperature_2": 360.0, "viscosity_2": 2.9e-5, "density": 869.0}


def block(outputs=ALL, columns=None, accuracy=None, realisations=(0, 3), **changes):
    columns = {name: np.asarray(column) for name, column in (columns or {}).items()}
    cases = len(next(iter(columns.values()))) if columns else 1
    parameters = MODEL.parameters(**SMALL | changes)
    return Block(parameters, columns, cases, realisations, 77, MODEL.with_companions(outputs), accuracy)


def solved(*arguments, **changes):
    return of_result(MODEL.compute(block(*arguments, **changes)))


def test_turns(dataframe_regression):
    """Films given from near to far, light and heavy, with and without creep; the rules of edges."""
    films = {"film_thickness": [1.7e-7, 4.3e-7, 6.1e-7, 9e-6]}
    found = {"rolling": solved(columns=films), "creep": solved(columns=films, slide_roll_ratio=0.23)}
    for rule in ("part", "clip", "whole", "inside"):
        creep = {"slide_roll_ratio": [0.0, -0.4], "film_thickness": [3.7e-7, 3.3e-7]}
        result = solved(("breakthrough_probability", "contact_length"), creep, edge_rule=rule)
        found |= {rule: {name: value for name, value in result.items() if name not in ("status", "messages")}}
    found |= {
        "rough": solved(NUMBERS, film_thickness=4e-7, longest_wavelength=3e-3, shortest_wavelength=4.1e-6, hurst=0.3)
    }
    found |= {"strong": solved(NUMBERS, film_thickness=4e-7, layer_shear_strength=3e8, realisations=(0,))}
    record.check(dataframe_regression, flat("", found))


def test_films_and_their_errors(dataframe_regression):
    """Formulas, and the solution at two accuracies, whose error passes to shares and friction."""
    columns = {"normal_force": [11.0, 107.0, 2030.0], "rotation_speed": [130.0, 900.0, 1700.0]}
    found, thin = {}, {"rms_roughness": 5e-8, "rotation_speed": 900.0}
    for formula in ("pan_hamrock", "pan_hamrock_minimum", "dowson_higginson"):
        found |= {formula: solved(FILM, columns, film_formula=formula, slide_roll_ratio=0.07, rms_roughness=5e-8)}
    for accuracy, law in itertools.product((1e-2, 3e-4), ("barus", "roelands")):
        changes = {"film_formula": "ehl", "slide_roll_ratio": 0.07, "viscosity_law": law, "rms_roughness": 5e-8}
        found |= {f"ehl {accuracy} {law}": solved(FILM, columns, accuracy, **changes)}
    for alpha in (1.7e-8, "oil", "gold_mineral", "gold_ester", "gold_polyglycol", "wooster"):
        found |= {f"alpha {alpha}": solved(FILM[:1], pressure_viscosity=alpha, realisations=(0,), **thin)}
    found |= {"own oil": solved(FILM, oil=OIL, realisations=(0, 1), **thin)}
    found |= {"thick": solved(FILM, rotation_speed=9e5, realisations=(1, 0), film_formula="ehl")}
    found |= {"none": solved(FILM, film_formula="ehl", rotation_speed=1e-9, rms_roughness=1e-12)}
    record.check(dataframe_regression, flat("", found))


def test_points_chosen_by_accuracy(dataframe_regression):
    found = {}
    changes = {"points": "auto", "shortest_wavelength": 7e-6, "film_thickness": 3.9e-7}
    columns = {"slide_roll_ratio": [0.0, 0.0, 0.31], "layer_thickness": [5e-9, 2e-8, 6e-9]}
    for accuracy in (None, 0.3, 0.04):
        found |= {f"{accuracy}": solved(("breakthrough_probability", "contact_length"), columns, accuracy, **changes)}
        if accuracy != 0.04:
            continue
        operations = [operation_of(block(columns=columns, **changes).case(case), accuracy) for case in range(3)]
        chosen = [points.first(operation, accuracy) for operation in operations]
        found |= {f"{accuracy} first": [str(operation.source.points) for operation in chosen]}
        found |= {f"{accuracy} coarse": [operation.coarseness for operation in chosen]}
        for name, one in zip(("rolling", "other", "creep"), chosen, strict=True):
            lines = one.source.lines(77, 0), one.source.lines(77, 0, True)
            if name == "creep":
                turn, other, first = creeping(one, lines[0]), creeping(one, lines[1], 1), creeping(one, lines[1], 4)
            else:
                sums = one.source.together(77, 0), one.source.together(77, 0, True)
                turn, other, first = rolling(one, sums[0]), rolling(one, sums[1], 1), rolling(one, sums[1], 4)
            errors = turn.errors(first)
            found |= {f"{accuracy} {name}": (turn.probability, turn.length, turn.scatter, turn.unit, turn.parts)}
            found |= {
                f"{accuracy} {name} errors": (*turn.errors(other), *errors, turn._unseen(), first.parts, turn.apart)
            }
            found |= {f"{accuracy} {name} judged": points.judged_by(turn)}
            asked = (("breakthrough_probability",), ("contact_length",))
            found |= {f"{accuracy} {name} miss": [points.miss(turn, errors, 0.01, outputs) for outputs in asked]}
            for factor in (1e-3, 0.5, 1.2, 100.0):
                finer = points.finer(one, turn, lambda errors=errors, factor=factor: factor * errors, 0.02, asked[1])
                found |= {f"{accuracy} {name} finer {factor}": str(finer and finer.source.points)}
    record.check(dataframe_regression, flat("", found))


def profile(path, spacing, size, phase):
    x = np.arange(size)
    heights = 3e-7 * np.sin(0.071 * x + phase) + 2e-7 * np.cos(0.23 * x * (1 + 1e-4 * x) + phase) + 1e-10 * x
    path.write_text("x [m],z [m]\n" + "".join(f"{k * spacing:.9g},{z:.9g}\n" for k, z in zip(x, heights, strict=True)))
    return {"profile": {"file": path.name, "detrend": "none"}}


def spectrum(path, hurst, rms):
    one = self_affine(hurst, 1e-3, 2e-6, rms)
    rows = zip(one.wavenumber, one.density, strict=True)
    path.write_text("wavenumber [rad/m],C2D [m^4]\n" + "".join(f"{q:.12g},{density:.12g}\n" for q, density in rows))
    return {"spectrum": path.name}


def test_measured_surfaces(dataframe_regression, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    profiles = {"surface_1": profile(tmp_path / "one.csv", 1.1e-6, 2301, 0.3)}
    profiles |= {"surface_2": profile(tmp_path / "two.csv", 1.1e-6, 2250, 1.7)}
    spectra = {
        "surface_1": spectrum(tmp_path / "a.csv", 0.7, 2e-7),
        "surface_2": spectrum(tmp_path / "b.csv", 0.4, 9e-8),
    }
    others = {"hurst": None, "film_thickness": 4.1e-7, "slide_roll_ratio": 0.11}
    found = {"profiles": solved(ALL, rms_roughness=None, **profiles, **others)}
    found |= {"scaled": solved(NUMBERS, **profiles, **others | {"slide_roll_ratio": 0.0})}
    found |= {"spectra": solved(NUMBERS, rms_roughness=None, **spectra, **others | {"film_thickness": 6e-8})}
    for name, surfaces, rms in (("profiles", profiles, None), ("scaled", profiles, 1e-7), ("spectra", spectra, None)):
        source = MODEL.parameters(**SMALL | {"rms_roughness": rms} | surfaces | others).source()
        perimeter = 2 * np.pi * 1.1e-3
        numbers = (
            source.points,
            source.per_wave,
            source.combined_rms(),
            source.slope(perimeter),
            source.spacing(perimeter),
        )
        found |= {f"{name} source": numbers, f"{name} lines": [*source.lines(5, 1), *source.lines(5, 1, True)]}
    record.check(dataframe_regression, flat("", found))


def test_what_is_refused(dataframe_regression):
    """As a case among good ones, each by its sentence."""
    good = block(NUMBERS, film_thickness=4e-7).parameters
    bad = {"rms_roughness": None, "hurst": None, "temperature": 420.0, "points": 64, "normal_force": 1e8}
    bad |= {"shortest_wavelength": 1e-9, "longest_wavelength": 1e-6}
    found = {}
    for name, value in bad.items():
        one = good.model_copy(update={"points": "auto"}) if name == "shortest_wavelength" else good
        column = {name: np.array([getattr(one, name), value], dtype=object)}
        found |= {name: of_result(MODEL.compute(Block(one, column, 2, (0,), 3, ("film",))))}
    record.check(dataframe_regression, flat("", found))


def test_estimates_of_time(dataframe_regression):
    columns = {
        "normal_force": [90.0, 110.0, 120.0],
        "slide_roll_ratio": [0.0, 0.2, 0.0],
        "cutoff_force": [80.0, 80.0, 81.0],
    }
    blocks = {"plain": block(("film",)), "drawn": block(), "columns": block(("film",), columns)}
    blocks |= {"auto": block(("film",), columns, points="auto"), "fine": block(("film",), None, 1e-4, points="auto")}
    blocks |= {
        "waves": block(("film",), points="auto", shortest_wavelength=3e-6),
        "ehl": block(("film",), film_formula="ehl"),
    }
    found = {name: [seconds(one), MODEL.memory(one)] for name, one in blocks.items()}
    found |= {"coordinates": MODEL.coordinates(block().parameters)}
    record.check(dataframe_regression, flat("", found))
