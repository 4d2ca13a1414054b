"""Every element through histories of velocity and load, as it was found."""

import numpy as np
import record

from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.shapes import PowerLaw
from mdr_dask.physics.surfaces.waves import Waves
from mdr_dask.physics.transients.elements.follow import follow_line, steady_start, untouched
from mdr_dask.physics.transients.elements.foundation import KELVIN, foundation
from mdr_dask.physics.transients.elements.loading_history import Piece, trace
from mdr_dask.physics.transients.elements.steps import Schedule

SOLIDS = {
    "kelvin": KELVIN,
    "standard": foundation([3.0], [0.25], 0.0),
    "three": foundation([0.7, 2.0, 3.3], [0.3, 0.04, 1.1], 0.0),
    "three and a dashpot": foundation([3.0, 2.0, 1.0], [0.03, 0.1, 0.25], 0.013),
}
TIMES = np.array([0.0, 0.003, 0.07, 0.2, 0.31, 0.9, 1.3])
HISTORIES = {
    "jump": (0.05, [Piece(0.0, np.inf, (0.09, 0.09), (0.2, 0.2))]),
    "ramps": (
        0.08,
        [
            Piece(0.0, 0.2, (0.08, 0.03), (0.3, 0.45)),
            Piece(0.2, 0.7, (0.03, 0.03), (0.2, 0.2)),
            Piece(0.7, np.inf, (0.06, 0.06), (0.25, 0.25)),
        ],
    ),
    "swing": (0.0, [Piece(0.0, np.inf, (0.07, 0.07), (0.2, 0.2), (0.02, 0.05, 7.0))]),
    "rest and back": (
        0.06,
        [Piece(0.0, 0.31, (0.0, 0.0), (0.1, 0.1)), Piece(0.31, np.inf, (-0.05, -0.05), (0.1, 0.1))],
    ),
}


def lines():
    modes = 17
    amplitude = roughness.amplitudes(modes, 0.7)
    waves = Waves(0.5 * amplitude * roughness.phase_factors(3, 1, modes), 2 * modes)
    bowl = RoughLine(Waves(0.2 * waves.coefficients, 2 * modes), PowerLaw(14.0, 2.0))
    return {"plane": RoughLine(waves).cubic(102), "indenter": bowl.cubic(103)}


def keyed(**scenes):
    return {f"{scene}: {name}": value for scene, found in scenes.items() for name, value in found.items()}


def test_traces_of_histories(dataframe_regression):
    found = {}
    for shape, line in lines().items():
        for solid in SOLIDS:
            for history, (before, pieces) in HISTORIES.items():
                told = trace(line, SOLIDS[solid], before, pieces, TIMES, 7.0)
                scene = found.setdefault(f"{shape} {solid}", {})
                scene[history] = np.concatenate(
                    [[told.before, told.at, told.after], told.friction, told.depth, [told.outcome]]
                )
    far = [Piece(0.0, np.inf, (3.0, 3.0), (0.2, 0.2))]
    heavy = [Piece(0.0, np.inf, (0.01, 0.01), (90.0, 90.0))]
    endless = [Piece(0.0, np.inf, (1e9, 1e9), (0.2, 0.2))]
    for name, pieces in (("far", far), ("heavy", heavy), ("endless", endless)):
        told = trace(lines()["indenter"], KELVIN, 0.01, pieces, TIMES[:3], 7.0)
        found[f"under an indenter, {name}"] = {
            "all": np.concatenate([told[:3], told.friction, told.depth]),
            "why": told.outcome.sentence,
        }
    record.check(dataframe_regression, keyed(**found))


def test_energies_and_states_of_elements(dataframe_regression):
    found = {}
    moments = np.append(0.0, np.cumsum(np.geomspace(1e-4, 0.06, 25)))
    for shape, line in lines().items():
        for name, solid in SOLIDS.items():
            for deborah in (0.0, 0.06):
                state, depth, status = steady_start(line, solid, deborah, 0.21)
                told = {"start": np.append(state.displacement, [depth, status])}
                told["arms at the start"] = np.append(state.arms, state.free_arms)
                told["free at the start"] = np.concatenate(
                    [state.free, state.touching, state.edges.place, state.edges.gap]
                )
                speed = 0.03 + 0.1 * np.sin(3 * moments)
                travel = 0.03 * moments + 0.1 / 3 * (1 - np.cos(3 * moments))
                schedule = Schedule(moments, travel, speed, 0.21 + 0.08 * moments)
                after = follow_line(line, solid, schedule, state, depth)
                told |= {each: getattr(after, each) for each in ("drag", "depth", "contact", "displacement")}
                told["rate"] = np.arcsinh(after.rate)
                told["energies"] = np.array([after.stored, after.work, after.dissipated])
                told["edges"] = np.append(after.state.edges.place, after.state.edges.gap)
                told["free"] = np.append(after.state.free, after.status)
                for each, value in told.items():
                    found.setdefault(f"{shape} {name}", {}).setdefault(each, []).append(np.ravel(value))
    joined = {scene: {key: np.concatenate(each) for key, each in told.items()} for scene, told in found.items()}
    record.check(dataframe_regression, keyed(**joined))


def test_untouched_elements_come_under_a_load(dataframe_regression):
    found, moments = {}, np.linspace(0.0, 1.7, 29)
    for shape, line in lines().items():
        n = line.height.size - 1
        for name, solid in SOLIDS.items():
            schedule = Schedule(moments, 0.04 * moments, 0.04 + 0 * moments, 0.05 + 0.1 * moments)
            after = follow_line(line, solid, schedule, untouched(n, solid.times.size), -0.3)
            found[f"{shape} {name}"] = np.concatenate(
                [after.drag, after.depth, after.contact, after.stored, after.work, after.dissipated]
            )
            found[f"{shape} {name} status"] = after.status.sentence
        for light, fast in ((1e-9, 1e-4), (3e-4, 40.0), (5.0, 0.3)):
            state, depth, status = steady_start(line, SOLIDS["three"], fast, light)
            found[f"{shape} {light}"] = np.concatenate([np.arcsinh(1e3 * state.displacement), [depth, status]])
    record.check(dataframe_regression, found)


def test_moments_of_pieces(dataframe_regression):
    found = {}
    for name, piece in {
        "constant": Piece(0.3, np.inf, (0.2, 0.2), (1.0, 1.0)),
        "still": Piece(0.0, np.inf, (0.0, 0.0), (1.0, 1.0)),
        "ramp": Piece(0.1, 1.3, (0.2, -0.7), (1.0, 3.0)),
        "load only": Piece(0.1, 1.3, (0.2, 0.2), (1.0, 3.0)),
        "swing": Piece(0.2, 2.0, (0.2, 0.3), (1.0, 1.1), (0.05, 0.3, 11.0)),
        "too fast": Piece(0.0, np.inf, (1e7, 1e7), (1.0, 1.0)),
    }.items():
        for nodes, per_decade in ((40, 12.0), (7, 3.0)):
            found[f"{name} {nodes}"] = np.array(piece.moments(piece.start, 1.3, nodes, per_decade), dtype=float)
        found[f"{name} at once"] = np.array(piece.moments(1.3, 1.3, 40, 12.0), dtype=float)
        for part, each in zip(("travel", "velocity", "load"), piece.at(np.array([0.3, 0.5, 1.1])), strict=True):
            found[f"{name} {part}"] = each
        scaled = piece.scaled(2.0, 5.0, 7.0)
        found[f"{name} scaled"] = np.array(
            [scaled.start, scaled.end, *scaled.velocity, *scaled.force, *scaled.swing, piece.changes_in]
        )
    record.check(dataframe_regression, found)


def test_modes_of_solids(dataframe_regression):
    found = {}
    for name, solid in SOLIDS.items():
        for each in ("moduli", "times", "viscosity", "rates", "outward", "inward", "push"):
            found[f"{name} {each}"] = getattr(solid, each)
    record.check(dataframe_regression, found)
