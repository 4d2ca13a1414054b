"""Steady states of many lines, bodies, solids and schemes as they were found, with their stated errors."""

import numpy as np
import pytest
import record

from mdr_dask.physics.sliding import backward_euler, displacement, full_contact, laws, vectorised
from mdr_dask.physics.sliding.accuracy import COLUMNS, Ladder
from mdr_dask.physics.sliding.kelvin import SUMS, barriers_for, blocks_of, patches_at
from mdr_dask.physics.sliding.nodes import NO_ENDS, ends_of, nodes, weights, with_summit
from mdr_dask.physics.sliding.problem import Aim, Arms, solve
from mdr_dask.physics.sliding.steady import steady_on_cells, steady_sliding
from mdr_dask.physics.sliding.viscoelastic import ViscoelasticLadder
from mdr_dask.physics.solids import prony
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import cut
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.shapes import PowerLaw, RoundedCone
from mdr_dask.physics.surfaces.waves import Waves

DEBORAH = np.array([3e-5, 7e-4, 0.011, 0.4, 17.0])
LOADS = np.array([4e-4, 0.023, 0.31, 1.7, 9.0])
INVALID = np.array([[np.nan, 0.1], [0.1, np.nan], [0.0, 0.2], [0.3, 0.0], [-0.1, 0.3], [0.1, np.inf], [1e300, 1e300]])
ARMS = Arms((3.1, 0.7), (0.02, 0.3))
BODIES = {
    "plane": (37, 0.63, None),
    "spiky plane": (53, 0.0, None),
    "parabola": (29, 0.81, PowerLaw(35.0, 2.0)),
    "wedge": (31, 0.4, PowerLaw(9.0, 1.0)),
    "cone": (23, 0.7, RoundedCone(11.0, 0.07)),
}


def rough(modes, hurst, body=None, realisation=2):
    amplitude = roughness.amplitudes(modes, hurst)
    return RoughLine(Waves(0.5 * amplitude * roughness.phase_factors(5, realisation, modes), 2 * modes), body)


def cases(deborah=DEBORAH, loads=LOADS, wrong=INVALID):
    deborah, loads = (each.ravel() for each in np.meshgrid(deborah, loads))
    return np.append(deborah, wrong[:, 0]), np.append(loads, wrong[:, 1])


def sizes(values):
    with np.errstate(all="ignore"):
        return np.log10(np.abs(values))


def columns(found, loads=1.0):
    """Return all that is known of states: logarithms where sizes differ by orders, so that every case counts."""
    steady, errors = found
    told = {name: sizes(getattr(steady, name)) for name in COLUMNS}
    told |= {"drag": sizes(steady.drag / loads), "depth": np.arcsinh(steady.depth)}
    told["errors"] = np.array([sizes(getattr(errors, name)) for name in COLUMNS])
    unknown = [[np.isinf(each), np.isnan(each)] for each in errors]
    return told | {"outcome": np.append(np.sum(unknown, axis=2), steady.status)}


def joined(*scenes):
    return {name: np.concatenate([np.ravel(scene[name]) for scene in scenes]) for name in scenes[0]}


def keyed(**scenes):
    return {f"{scene}: {name}": value for scene, found in scenes.items() for name, value in found.items()}


@pytest.mark.parametrize("body", ["plane", "wedge", "cone"])
def test_states_of_every_scheme_and_aim(body, dataframe_regression):
    line, (deborah, loads) = rough(*BODIES[body]), cases()
    found = {}
    for scheme in ("hermite", "piecewise_linear", "backward_euler"):
        aims = [Aim(COLUMNS, 0.01, 3, scheme), Aim(("contact_slope", "depth"), 0.01, 1, scheme)]
        found[f"{scheme} on grids"] = joined(*(columns(solve(line, None, deborah, loads, aim), loads) for aim in aims))
        found[scheme] = columns(solve(line, None, deborah, loads, Aim(("drag",), 0.1, scheme=scheme)), loads)
    found["hermite to more"] = columns(solve(line, None, deborah, loads, Aim(accuracy=0.02)), loads)
    found["no errors"] = columns(solve(line, None, deborah, loads, Aim(oversampling=2, with_errors=False)), loads)
    record.check(dataframe_regression, keyed(**found))


def test_states_to_accuracies_of_the_whole_way(dataframe_regression):
    """From node to node, cubic cells, and both; light to heavy cases, one and many."""
    found = {}
    deborah, loads = cases(np.geomspace(2e-6, 3.0, 9), np.geomspace(3e-5, 40.0, 11))
    few, many = [rough(37, 0.63), rough(53, 0.0)], [rough(640, 0.33)]
    for asked in (0.3, 0.03, 4e-3, 3e-4, 1e-4, 0.9e-4):
        wanted = ("depth",) if asked == 3e-4 else COLUMNS if asked > 0.01 else ("drag", "contact_fraction")
        for lines in [few, many] if asked >= 4e-3 else [few]:
            ladders = [Ladder(line, "hermite", deborah, loads, wanted) for line in lines]
            states = [columns(ladder.to_accuracy(asked), loads) for ladder in ladders]
            found[f"{lines[0].points} {asked}"] = joined(*states)
    alone = Ladder(rough(37, 0.63), "hermite", np.array([0.02]), np.array([0.07]))
    found["one"] = columns(alone.to_accuracy(0.01))
    found["none"] = columns(alone.only(np.zeros(1, bool)).to_accuracy(0.01))
    record.check(dataframe_regression, keyed(**found))


@pytest.mark.parametrize("body", ["plane", "cone"])
def test_states_of_general_solids(body, dataframe_regression):
    line = rough(*BODIES[body])
    wrong = np.vstack([INVALID[:-1], [[0.0, 1e-9], [0.3, 1e9]]])
    deborah, loads = cases(np.array([0.0, 2e-4, 0.03, 5.0]), LOADS[1:], wrong)
    found = {}
    for name, arms in {
        "two arms": ARMS,
        "an arm too short": Arms((2.0, 4.0), (1e-13, 0.05)),
        "no arms": Arms(),
    }.items():
        for oversampling, asked in ((4, 0.01), (7, 0.01), ("auto", 0.1), ("auto", 0.008)):
            if name != "two arms" and oversampling not in (4,):
                continue
            aim = Aim(("drag", "depth"), asked, oversampling)
            found[f"{name} {oversampling} {asked}"] = columns(solve(line, arms, deborah, loads, aim), loads)
    record.check(dataframe_regression, keyed(**found))


def test_lines_without_roughness(dataframe_regression):
    deborah, loads = cases()
    found = {}
    for name, body in {
        "plane": None,
        "parabola": PowerLaw(35.0, 2.0),
        "wedge": PowerLaw(2.0, 1.0),
        "cone": BODIES["cone"][2],
    }.items():
        line = RoughLine(Waves(np.zeros(20, complex), 40), body)
        found[name] = columns(solve(line, None, deborah, loads, Aim()), loads)
    record.check(dataframe_regression, keyed(**found))


@pytest.mark.parametrize(("modes", "hurst"), [(150, 0.0), (700, 0.9)])
def test_cases_from_node_to_node(modes, hurst, dataframe_regression):
    line, (deborah, loads) = (
        rough(modes, hurst),
        cases(np.geomspace(1e-6, 30, 9), np.geomspace(1e-5, 60, 9), INVALID[:0]),
    )
    grid = 4 * modes
    height, slope = line.heights(grid), line.slopes(grid)
    found = {}
    whole, *grids = vectorised.begin(height, slope, deborah, loads, 1e-4)
    for refinement in (0, 1, 2, 8):
        if refinement > 1:
            grids = grids[-1], vectorised.settle(whole, refinement, deborah, loads, tuple(grids), 1e-5)
        state = grids[min(refinement, 1)]
        found[f"refined {refinement}"] = {
            "drag": sizes(state.drag / loads),
            "depth": np.arcsinh(state.depth),
            "contact fraction": sizes(state.contact_fraction),
            "contact slope": sizes(state.contact_slope),
            "rates": np.arcsinh(state.rates),
            "doubts": sizes(np.maximum(state.doubts, 1e-9)),
        }
    found["line"] = {
        "top": whole.top,
        "rise": whole.rise,
        "blocks": whole.blocks,
        "height": whole.height,
        "slope": whole.slope,
    }
    found["line"] |= {"ends": whole.ends[0], "other ends": whole.ends[1]}
    record.check(dataframe_regression, keyed(**found))


@pytest.mark.parametrize("resolved", [True, False])
def test_nodes_of_a_line(resolved, dataframe_regression):
    line = rough(101, 0.2)
    height, slope = line.heights(610), line.slopes(610)
    found = {}
    for first, stride, ends in (
        (0, 1, NO_ENDS),
        (609, 1, ends_of(height, slope)),
        (417, 2, NO_ENDS),
        (31, 5, NO_ENDS),
        (300, 7, NO_ENDS),
    ):
        taken = nodes(height, slope, first, stride, resolved, ends)
        scene = found[f"from {first} by {stride}"] = {
            name: getattr(taken, name) for name in ("height", "slope", "top", "rise")
        }
        scene |= {f"ends {k}": each for k, each in enumerate(taken.ends)}
        scene["blocks"] = taken.blocks / np.sqrt(np.mean(taken.blocks**2, axis=0))
        scene["sizes of blocks"] = np.log(np.mean(taken.blocks**2, axis=0))
        scene["rise with the summit"] = with_summit(taken).rise
    for refinement in (1, 2, 8):
        table = weights(refinement)
        found[f"weights {refinement}"] = {f"{a} {b}": table[a, b] for a in range(2) for b in range(0, refinement, 3)}
    record.check(dataframe_regression, keyed(**found))


@pytest.mark.parametrize("body", ["spiky plane", "wedge"])
def test_sweeps_at_depths(body, dataframe_regression):
    """Sums and patches: within cells, over blocks, free and pressed for long, and at no contact at all."""
    line = rough(*BODIES[body])
    found = {}
    for oversampling in (1, 3):
        cells = cut(line.cubic(oversampling * line.points))
        blocks, n = blocks_of(cells), cells.mean.size - 1
        known = {
            name: getattr(cells, name)
            for name in ("height", "enter", "leave", "peak", "mean", "stretch", "start", "top")
        }
        found[f"{oversampling} cells"] = known | {
            f"blocks {name}": each for name, each in zip(("peak", "mean", "stretch"), blocks, strict=True)
        }
        rows, touches, leaves, idle, pressed = [], [], [], [], []
        for deborah in (0.013, 0.7, 21.0, 900.0):
            barriers = barriers_for(n)
            for depth in (1e-5, 0.031, 0.4, 1.3, 2.9, 7.0, 60.0):
                sums = np.empty(SUMS)
                starts, stops = patches_at(cells, blocks, barriers, deborah, depth, sums)
                rows.append(sums)
                touches.append(np.append(starts, starts.size))
                leaves.append(stops)
            written = ~np.isnan(barriers.block[: n // 16])
            idle.append(barriers.idle[: 16 * written.size][np.repeat(written, 16)])
            pressed.append(barriers.cell[: 16 * written.size][np.repeat(written, 16)])
        names = ("displacement", "stiffness", "drag", "drag rate", "length", "stretch", "outside")
        scene = {name: np.arcsinh(1e3 * each) for name, each in zip(names, np.transpose(rows), strict=True)}
        scene |= {"touches": np.concatenate(touches), "leaves": np.concatenate(leaves)}
        found[f"{oversampling} sums"] = scene | {"idle": np.concatenate(idle), "pressed": np.concatenate(pressed)}
    record.check(dataframe_regression, keyed(**found))


def test_sweeps_from_guesses(dataframe_regression):
    line, (deborah, loads) = rough(37, 0.63).cubic(222), cases()
    exact = steady_sliding(line, deborah, loads)
    found = {"searched": {name: np.arcsinh(each) for name, each in vars(exact).items()}}
    cells = cut(line)
    for close in (0.0, 1e-4, 0.01, 0.3):
        near = exact.depth * (1 + 0.003) + 0.001
        state = steady_on_cells(cells, blocks_of(cells), deborah, loads, near, close)
        found[f"near {close}"] = {name: np.arcsinh(each) for name, each in vars(state).items()}
    broken = line._replace(height=np.where(np.arange(223) == 5, np.nan, line.height))
    found["not finite"] = {"status": steady_sliding(broken, deborah, loads).status}
    record.check(dataframe_regression, keyed(**found))


@pytest.mark.parametrize("periodic", [True, False])
def test_the_steps_of_the_papers(periodic, dataframe_regression):
    body = None if periodic else PowerLaw(30.0, 1.7)
    found = {}
    for points, hurst in ((37, 0.6), (210, 0.2), (1300, 0.8)):
        line = rough(points, hurst, body).straight(2 * points)
        heights = line.height[:-1] if periodic else line.height
        top = int(np.argmax(heights))
        below = (np.roll(heights, -1 - top) if periodic else heights) - heights[top]
        deborah, loads = cases(np.array([0.02, 0.9, 30.0, 2e4]), np.geomspace(0.01, 3e3, 9), INVALID[:0])
        depths, drags, outside = backward_euler.steady_by_steps(below, periodic, deborah, loads)
        touched, slope = np.empty((2, loads.size))
        backward_euler.contact(below, periodic, deborah, depths, touched, slope)
        found[f"{points}"] = {
            "depths": sizes(depths),
            "drags": sizes(drags / loads),
            "outside": outside,
            "touched": sizes(touched),
            "slope": sizes(slope),
        }
    record.check(dataframe_regression, keyed(**found))


def test_general_solids_on_ever_finer_lines(dataframe_regression):
    """A ladder of one case: light to heavy, with and without an end, arms from none to five, long, short and stiff."""
    solids = {
        "kelvin": prony(1.0, [], [], 0.03),
        "standard": prony(2.0, [7.0], [0.2]),
        "five": prony(1.0, [1e3, 0.3, 2.0, 0.5, 9.0], [1e-6, 1e-3, 0.04, 0.6, 30.0], 1e-4),
        "tiny arm": prony(1.0, [4.0, 1.0], [1e-12, 0.1]),
        "elastic": prony(1.0, [], []),
    }
    told = {}
    for body in ("spiky plane", "wedge", "cone"):
        line = rough(*BODIES[body]).from_summit()
        for name, solid in solids.items():
            values, errors, other = [], [], []
            for load in (1e-5, 3e-3, 0.4, 6.0):
                ladder = ViscoelasticLadder(solid, load)
                for cells in (line.points * 2 // 4 * 4, line.points * 2 // 4 * 8):
                    state = ladder.on(line.straight(cells))
                    values.append(state.values)
                    errors.append(state.errors)
                    other.append([state.status, state.sweeps])
            drag, depth, fraction, slope = np.transpose(values)
            scene = {"drag": np.arcsinh(drag), "depth": np.arcsinh(depth), "fraction": fraction, "slope": slope}
            scene["errors"] = sizes(np.maximum(np.transpose(errors), 1e-12))
            told[f"{body} {name}"] = scene | {"status and sweeps": np.transpose(other)}
    record.check(dataframe_regression, keyed(**told))


def test_full_contact_of_waves(dataframe_regression):
    waves = rough(29, 0.5).roughness
    deborah, loads = cases(loads=np.array([0.3, 3.9, 4.1, 9.0, 80.0, 3e3, 2e6]))
    found = {}
    for name, arms in {"kelvin": [], "two": [(3.1, 0.02), (0.7, 0.3)]}.items():
        for grid in (59, 116, 300):
            on_nodes = waves.heights(grid), waves.slopes(grid)
            state = full_contact.steady_full_contact(waves, arms, on_nodes, deborah, loads)
            found[f"{name} {grid}"] = (
                {} if state is None else {key: np.arcsinh(each) for key, each in vars(state).items()}
            )
            light = full_contact.steady_full_contact(waves, arms, on_nodes, deborah, np.full(loads.size, 0.5))
            found[f"{name} {grid}"]["light"] = str(light)
    record.check(dataframe_regression, keyed(**found))


def test_laws_and_pictures(dataframe_regression):
    force, velocity = np.array([0.02, 0.7, 9.0]), np.array([0.003, 0.4, 5.0])
    lines = rough(31, 0.4)
    found = {
        "force number": laws.force_number(force, 3.0, 0.2, 7.0),
        "velocity number": laws.velocity_number(velocity, 0.3, 1.7, 0.2),
        "alpha": laws.alpha(np.array([0.0, 0.3, 1.0])),
        "zone one": laws.zone_one(force, velocity, 0.4, 1.5),
        "full contact": laws.full_contact(force, velocity),
        "interpolation": laws.interpolation(force, velocity, 0.4, 1.5),
        "crossover": laws.crossover(force, 0.4, 1.5),
        "regions": np.array(laws.regions(force, 0.4, 1.5)),
        "other regions": np.array(laws.regions(force, 0.4, 1.5, 0.7)),
        "low": laws.indenter_low(0.3, velocity, 0.2, 7.0, force, 1.3),
        "indenter": laws.indenter(velocity),
        "indenter of an exponent": laws.indenter(velocity, 2.3),
        "constants": np.array([laws.INDENTER_EXPONENT, laws.BETA]),
    }
    for periodic in (True, False):
        for deborah in (0.4, 13.0):
            found[f"pushed {periodic} {deborah}"] = displacement.displacement(
                lines.heights(93) + 0.2, deborah, periodic
            )
    record.check(dataframe_regression, found)


def test_a_state_that_a_finer_grid_has_not_has_errors_without_bound():
    """Neither grid has one of a load that is no number; of the finer line nothing is known where it is broken."""
    line = rough(20, 0.5)
    ladder = Ladder(line, "hermite", np.array([0.1, 0.1]), np.array([0.3, np.nan]))
    errors = ladder._errors(ladder.on_grid(2), ladder._nodes(4))
    assert [np.isfinite(each).tolist() for each in errors] == 4 * [[True, False]]
    assert not np.any(np.isnan(errors))
    height, slope = ladder._nodes(4)
    lost = ladder._errors(ladder.on_grid(2), (np.where(height > 0, np.nan, height), slope))
    assert np.all(np.isposinf(lost))
