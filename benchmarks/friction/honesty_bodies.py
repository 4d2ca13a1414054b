"""Honesty of errors beyond cubic cells on planes: ``python -m benchmarks friction honesty_bodies [cases [seed]]``.

Random cases of four kinds: indenters of the Kelvin body by cubic cells, the other schemes on planes and indenters,
materials of up to five arms with or without a dashpot, and measured lines with spikes and steps. The reference is the
cubic sweep at oversampling 128, or for materials and measured lines the extrapolated solution at 64.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from mdr_dask.models.base import Block
from mdr_dask.models.parts.indenter import Power
from mdr_dask.models.parts.material import Material
from mdr_dask.models.parts.surface import Surface
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces import shapes as indenter

OUTPUTS = ("friction_coefficient", "friction_coefficient_error")
POINTS = (100, 400, 1600)
ROUNDING = 1e-9


def line_and_body(generator, rough, on_plane):
    """Return parameters of a random line and the force number of a load that it carries without leaving the line."""
    hurst = float(generator.choice([0, 1, generator.uniform(), generator.uniform()]))
    points = int(generator.choice(POINTS))
    slope = roughness.spectral_slope(roughness.amplitudes(points // 2, hurst))
    line = {"length": 1.0, "points": points, "hurst": hurst, "rms_roughness": 1.0 if rough else 0.0}
    if on_plane:
        return line, 10 ** generator.uniform(-3, 3), slope
    exponent = float(generator.choice([1, 2, generator.uniform(1, 6)]))
    half = 10 ** generator.uniform(-1.7, -0.5)  # of the contact without roughness, over the length
    steepness = 10 ** generator.uniform(-1.5, 1.5)  # of the body at its edge, over that of the roughness
    mapped = steepness * slope / (exponent * half ** (exponent - 1))
    force = 8 * exponent / (exponent + 1) * mapped * half ** (exponent + 1)
    body = Power(shape="power", exponent=exponent, coefficient=mapped / indenter.mapped(exponent))
    return line | {"indenter": body}, force, slope


def kelvin_case(generator, rough, on_plane):
    line, force, slope = line_and_body(generator, rough, on_plane)
    deborah = 10 ** generator.uniform(-2, 3) / slope if generator.uniform() < 0.8 else 10 ** generator.uniform(-8, 2)
    kelvin = {"shear_modulus": 1.0, "relaxation_time": 1.0, "normal_force": force, "velocity": float(deborah)}
    return SlidingFriction(**line, **kelvin)


def random_series(generator):
    """Return a material of up to five arms with or without a dashpot, and a speed on a line of length 1."""
    arms = generator.integers(0, 6)
    series = {
        "static_modulus": 1.0,
        "moduli": tuple(10 ** generator.uniform(-2, 2, arms)),
        "times": tuple(10 ** generator.uniform(-6, 3, arms)),
        "viscosity": float(10 ** generator.uniform(-6, 0)) if arms == 0 or generator.uniform() < 0.5 else 0.0,
    }
    velocity = float(10 ** generator.uniform(-5, 2))
    return {"material": Material.model_validate({"prony": series}), "velocity": velocity}


def material_case(generator, on_plane, rough=True):
    line, force, _ = line_and_body(generator, rough, on_plane)
    line["points"] = min(line["points"], 400)
    return SlidingFriction(**line, **random_series(generator), normal_force=force)


def measured_case(generator, shape, path):
    """Return a case on a line of 64 to 512 samples with the rms height 1, written to a file."""
    count = int(generator.choice([64, 200, 512]))
    heights = {
        "spikes": np.where(generator.uniform(size=count) < 0.05, generator.exponential(1, count), 0.0),
        "steps": np.repeat(generator.standard_normal(8), count // 8),
        "noise": generator.standard_normal(count),
    }[shape]
    heights = (heights - heights.mean()) / max(float(heights.std()), 1e-3)
    np.savetxt(
        path,
        np.column_stack([np.arange(count) / count, heights]),
        delimiter=",",
        header="x [m],z [m]",
        comments="",
        fmt="%.17g",
    )
    surface = Surface.model_validate({"profile": str(path)})
    return SlidingFriction(surface=surface, **random_series(generator), normal_force=10 ** generator.uniform(-3, 3))


def solve(case, realisation, accuracy=None, **changes):
    block = Block(case.model_copy(update=changes), {}, 1, (realisation,), 1, OUTPUTS, accuracy)
    result = MODEL.compute(block)
    friction, error = (result.values[name].item() for name in OUTPUTS)
    return friction, error / friction


def judge(found, exact, doubts=0.0):
    """Return the share of errors below their estimate, and the median of estimate over error, of cases with results.

    A closed form, as in full contact, is nearer than the reference: `doubts` are the relative errors of that.
    """
    (friction, estimates), exact = np.array(found).T, np.array(exact)
    known = np.isfinite(friction) & np.isfinite(exact) & (exact != 0)
    errors, estimates, doubts = np.abs(friction / exact - 1)[known], estimates[known], (0.0 * exact + doubts)[known]
    over = np.median((estimates / np.maximum(errors, 1e-12))[errors > ROUNDING]) if np.any(errors > ROUNDING) else 1.0
    return float(np.mean(errors <= estimates + doubts + ROUNDING)), float(over), int(known.sum())


def indenters(cases, seed, accuracies=(0.05, 0.01, 0.002)):
    """Yield the judgement of rough indenters of the Kelvin body for every accuracy, and of smooth ones."""
    for name, rough in (("rough", True), ("smooth", False)):
        generator = np.random.default_rng(seed)
        drawn = [kelvin_case(generator, rough, False) for _ in range(cases)]
        if not rough:  # a roughness without height is solved like any other, instead of in closed form
            exact = [solve(case, 0)[0] for case in drawn]
            drawn = [case.model_copy(update={"rms_roughness": 1e-12}) for case in drawn]
        else:
            exact = [solve(case, k, oversampling=128)[0] for k, case in enumerate(drawn)]
        for accuracy in accuracies:
            found = [solve(case, k, accuracy) for k, case in enumerate(drawn)]
            yield f"{name} indenters, cubic cells, {accuracy:g}", judge(found, exact)


def schemes(cases, seed, accuracies=(0.05, 0.01)):
    """Yield the judgement of the other schemes, on planes and rough indenters."""
    for body in ("plane", "indenter"):
        generator = np.random.default_rng(seed)
        drawn = [kelvin_case(generator, True, body == "plane") for _ in range(cases)]
        exact = [solve(case, k, oversampling=128)[0] for k, case in enumerate(drawn)]
        for scheme in ("piecewise_linear", "backward_euler"):
            for accuracy in accuracies:
                found = [solve(case, k, accuracy, scheme=scheme) for k, case in enumerate(drawn)]
                yield f"{body}, {scheme}, {accuracy:g}", judge(found, exact)
            found = [solve(case, k, scheme=scheme, oversampling=1) for k, case in enumerate(drawn)]
            yield f"{body}, {scheme}, grid 1", judge(found, exact)


def materials(cases, seed, grids=(4, 8, 16)):
    """Yield the judgement of general materials on every grid, on planes and on rough and smooth indenters."""
    for body in ("plane", "indenter", "smooth indenter"):
        generator = np.random.default_rng(seed)
        drawn = [material_case(generator, body == "plane", body != "smooth indenter") for _ in range(cases)]
        yield from on_grids(f"{body}, material", drawn, grids)


def measured(cases, seed, grids=(4, 8, 16)):
    """Yield the judgement of measured lines on every grid."""
    with tempfile.TemporaryDirectory() as folder:
        for shape in ("spikes", "steps", "noise"):
            generator = np.random.default_rng(seed)
            drawn = [measured_case(generator, shape, Path(folder, f"{shape}_{k}.csv")) for k in range(cases)]
            yield from on_grids(f"measured {shape}", drawn, grids)


def on_grids(name, drawn, grids):
    """Yield the judgement of cases on every grid, and by `auto` at 1 %, against grid 64."""
    reference = np.array([solve(case, k, oversampling=64) for k, case in enumerate(drawn)]).T
    yield f"{name}, 0.01", judge([solve(case, k, 0.01) for k, case in enumerate(drawn)], *reference)
    for grid in grids:
        found = [solve(case, k, oversampling=grid) for k, case in enumerate(drawn)]
        yield f"{name}, grid {grid}", judge(found, *reference)


def main(cases=200, seed=0):
    print("| cases | error below the estimate | estimate / error, median | number |\n|---|---|---|---|")
    for kind in (indenters, schemes, materials, measured):
        for name, (share, over, number) in kind(int(cases), int(seed)):
            print(f"| {name} | {share:.1%} | {over:.1f} | {number} |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
