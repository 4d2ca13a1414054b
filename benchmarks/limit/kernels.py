"""The hot kernels, each on a typical case small enough to be run as plain Python too."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import cut, periodic_line
from mdr_dask.physics.surfaces.waves import Waves, series

POINTS = 200


class Work(NamedTuple):
    """A kernel that is ready to be called: for how many units, and its operations where they are not counted."""

    call: Callable[[], object]
    units: float
    operations: dict[str, float] | None = None


class Kernel(NamedTuple):
    """A hot kernel.

    Parameters
    ----------
    name, unit : str
        And what its work is counted in.
    prepare : callable
        Returns its `Work`.
    is_wide : bool
        Whether its loops are vector instructions.
    """

    name: str
    unit: str
    prepare: Callable[[], Work]
    is_wide: bool = False


def _nodes(oversampling: int) -> tuple[np.ndarray, np.ndarray]:
    amplitude, phase = roughness.amplitudes(POINTS // 2, 0.7), roughness.phases(1, 0, POINTS // 2)
    height, slope = (roughness.line(amplitude, phase, POINTS * oversampling, order) for order in (0, 1))
    return height, slope


def _captured(module: ModuleType, name: str, run: Callable[[], object]) -> tuple[Any, ...]:
    """Return copies of the arguments of the last call of a function of a module."""
    original, calls = getattr(module, name), []

    def noting(*arguments: Any) -> Any:
        calls.append([each.copy() if isinstance(each, np.ndarray) else each for each in arguments])
        return original(*arguments)

    setattr(module, name, noting)
    try:
        run()
    finally:
        setattr(module, name, original)
    return tuple(calls[-1])


def preparation() -> Work:
    """Nodes with bounds and sums of their blocks."""
    from mdr_dask.physics.sliding.nodes import ends_of, nodes

    height, slope = _nodes(2)
    ends = ends_of(height, slope)
    return Work(lambda: nodes(height, slope, 0, 1, True, ends), height.size)


def node_to_node() -> Work:
    """Twenty speeds at one load."""
    from mdr_dask.physics.sliding import vectorised, walk
    from mdr_dask.physics.sliding.nodes import BLOCK, IN_A_TILE, weights

    deborah, loads = np.geomspace(1e-4, 1e2, 20), np.full(20, 0.3)
    line, _, fine = vectorised.begin(*_nodes(2), deborah, loads, 1e-3)
    n = 2 * POINTS
    workspace, tile = np.zeros(walk.ROWS * walk.LANES), np.empty((IN_A_TILE, BLOCK + 3))
    queue, table = np.empty(walk.LANES, np.int64), weights(1)

    for k in range(deborah.size):
        walk.load_case(workspace, k, fine.depth[k] + line.top, deborah[k] * n, BLOCK)
    return Work(lambda: walk.sweep(line, table, tile, workspace, queue, deborah.size), n * deborah.size)


def _sweep(load: float) -> Work:
    from mdr_dask.physics.sliding.kelvin import SUMS, barriers_for, blocks_of, places_for, sweep_cells
    from mdr_dask.physics.sliding.steady import steady_on_cells

    cells = cut(periodic_line(*_nodes(4)))
    blocks, n, deborah = blocks_of(cells), 4 * POINTS, 0.02
    depth = steady_on_cells(cells, blocks, np.array([deborah]), np.array([load])).depth[0] + cells.top
    barriers, sums, unwritten = barriers_for(n), np.empty(SUMS), places_for(0)

    def call() -> None:
        sweep_cells(cells, blocks, barriers, deborah * n, depth, sums, unwritten)

    call()
    return Work(call, n)


def papers_steps() -> Work:
    """Backward Euler with steps of a cell, twenty speeds; one sweep over all nodes."""
    from mdr_dask.physics.sliding import backward_euler
    from mdr_dask.physics.sliding.steady import stepped_sliding

    deborah, loads = np.geomspace(1e-4, 1e2, 20), np.full(20, 0.3)
    line = periodic_line(*_nodes(2))
    arguments = _captured(backward_euler, "_newton", lambda: stepped_sliding(line, deborah, loads))
    line, (deborah, _), _, depths, _, _ = arguments
    moving = backward_euler.Moving(deborah, deborah / (1 + deborah), depths)
    lanes = backward_euler.lanes_for(depths.size)
    return Work(lambda: backward_euler._sweep(line, moving, lanes), line.height.size * depths.size)


def general_solid() -> Work:
    """Three arms, all sweeps of a solution."""
    from mdr_dask.physics.sliding import viscoelastic
    from mdr_dask.physics.solids import prony

    solid = prony(1.0, np.full(3, 3.0), np.geomspace(1e-3, 1.0, 3))
    line = periodic_line(_nodes(2)[0], None)
    run = lambda: viscoelastic.steady_viscoelastic_sliding(line, solid, 0.3)  # noqa: E731
    fixed = _captured(viscoelastic, "solve_sliding", run)
    start = fixed[5].copy()

    def call() -> Any:
        fixed[5][:] = start
        return viscoelastic.solve_sliding(*fixed)

    return Work(call, fixed[0].size * 3 * call()[1])


def search_after_jump() -> Work:
    """One search of the contact in the middle of a march."""
    from mdr_dask.physics.transients import velocity_jump as jumps
    from mdr_dask.physics.transients.contact_search import touch
    from mdr_dask.physics.transients.ends import PreparedLine, ends_on
    from mdr_dask.physics.transients.free_flight import Instant
    from mdr_dask.physics.transients.march import Finish, march_depth
    from mdr_dask.physics.transients.patches import History

    line, loads, deborah = PreparedLine.of(periodic_line(*_nodes(4))), np.array([0.3]), np.array([[0.02, 0.024]])
    ends = ends_on(line, loads, deborah)
    asked = jumps.Transient(np.geomspace(1e-4, 8, 30), np.pi * POINTS, 6.0)
    case = jumps._Relaxation.of(line, loads[0], deborah[0], ends, 0, asked)
    marching, found, work = case.begun(next(case.limits(case.depth)), 3000)
    finish = Finish(case.depth[1], case.after, 1e-3 * abs(case.depth[1] - case.depth[0]), 1e-3)
    now = march_depth(marching, case.pace, finish, found, work)[0] // 2
    history = History(found.time, found.depth, found.rate, now + 1, 1.0)
    time = float(found.time[now])
    moment = Instant(marching.track, marching.first, history, time, marching.deborah, np.exp(-time))
    return Work(lambda: touch(moment, marching.reachable, work), touch(moment, marching.reachable, work))


def elements() -> Work:
    """A Kelvin foundation of two elements for every Nyquist point, sixteen steps at one speed."""
    from mdr_dask.physics.transients.elements.follow import follow_line, steady_start
    from mdr_dask.physics.transients.elements.foundation import KELVIN
    from mdr_dask.physics.transients.elements.steps import Schedule

    height, slope = _nodes(2)
    line, steps = periodic_line(height, slope), 16
    state, depth, _ = steady_start(line, KELVIN, 0.0, 0.3)
    moments, one = np.arange(steps + 1) / height.size / 0.1, np.ones(steps + 1)
    schedule = Schedule(moments, 0.1 * moments, 0.1 * one, 0.3 * one)
    return Work(lambda: follow_line(line, KELVIN, schedule, state, depth), height.size * steps)


def limit_rule() -> Work:
    """Scars of parabolas at the end of all wear."""
    from mdr_dask.physics.wear.rules import limit_cases

    stick = np.linspace(0.1, 0.9, 64)
    return Work(lambda: limit_cases(np.full(64, 2.0), stick), stick.size)


def exact_wear() -> Work:
    """What the slip zone remembers in one residual of a step under constant force."""
    from mdr_dask.physics.mdr.revolution import PowerProfile
    from mdr_dask.physics.wear import forced_slip
    from mdr_dask.physics.wear.exact import exact

    run = lambda: exact(PowerProfile(2.0), 0.455, [0.1], 1e-2, constant_force=True, errors=False)  # noqa: E731
    fixed = _captured(forced_slip, "remember", run)
    return Work(lambda: forced_slip.remember(*fixed), fixed[4].size // 2)


class _State(NamedTuple):
    """Nodes of a grid with Hertz' pressure and a film over them."""

    nodes: np.ndarray
    pressure: np.ndarray
    film: np.ndarray


def _films() -> tuple[Any, Any, Any]:
    from mdr_dask.physics.lubrication import grids, line_contact
    from mdr_dask.physics.lubrication.newton import Grid, film_on

    case = line_contact.line_contact((2.0452e-5, 1e-11, 5007.0), 115.385e9)
    nodes = grids.first_grid(0.1, grids.inlet_position(0.1), 121)
    grid, pressure = Grid.of(nodes), grids.first_pressure(nodes, 0.1)
    return case, _State(nodes, pressure, film_on(grid, pressure, 0.1)), grid


def film_balance() -> Work:
    """Balance of the lubricant in every volume with its derivatives."""
    from mdr_dask.physics.lubrication.newton import Imbalance, balance

    case, state, _ = _films()
    n = state.nodes.size
    workspace = np.empty((4, n)), Imbalance(np.empty(n), np.empty((n, 4)), np.empty((n, 4)))
    fixed = state.nodes, case.liquid, case.film_number, state.pressure, state.film
    return Work(lambda: balance(*fixed, *workspace), n)


def film_equations() -> Work:
    """The dense equations of a Newton step."""
    from mdr_dask.physics.lubrication.newton import Imbalance, _fill_active, _fill_equations, balance

    case, state, grid = _films()
    n = state.nodes.size
    found = Imbalance(np.empty(n), np.empty((n, 4)), np.empty((n, 4)))
    balance(grid.nodes, case.liquid, case.film_number, state.pressure, state.film, np.empty((4, n)), found)
    listed = np.empty(n, np.int64)
    active = listed[: _fill_active(grid.influence, state.pressure, found, listed)]
    A, b = np.empty((active.size + 1, active.size + 1)), np.empty(active.size + 1)
    fixed = grid, state.pressure, found, active, A, b
    return Work(lambda: _fill_equations(*fixed), A.size)


def breakthrough() -> Work:
    """Clusters of a line and the contact lengths of every window."""
    from mdr_dask.physics.lubrication import breakthrough as layers
    from mdr_dask.physics.lubrication import clusters

    waves = 10_000
    line = 0.2e-6 * roughness.line(roughness.amplitudes(waves, 0.7), roughness.phases(1, 0, waves), 3 * waves, 0)
    strength = float(layers.layer_strength(1e6, 115.385e9, 5e-9))

    def call() -> object:
        return layers.contact_lengths(clusters.find_clusters(line, 2e-7, 1e-6, strength), 14.1)

    return Work(call, line.size)


def phase_factors() -> Work:
    """Cosine and sine of random phases."""
    shares, factors = np.random.default_rng(0).random(4096), np.empty((4096, 2))
    return Work(lambda: roughness._turn(shares, factors), 4096)


def fourier_line() -> Work:
    """One line from its waves."""
    nodes = 20_000
    coefficients = np.ones(nodes // 4, np.complex128)
    flops = 2.5 * nodes * np.log2(nodes) / 2
    return Work(lambda: series(coefficients, nodes), nodes, {"add": flops, "multiply": flops})


def rms_slope() -> Work:
    """The slope of a line from its waves."""
    waves = Waves(np.ones(10_000, np.complex128), 20_000)
    return Work(waves.rms_slope, 10_000, {"add": 2e4, "multiply": 3e4, "load": 2e4})


def transform() -> Work:
    """The height of a body from its image on a uniform grid."""
    from mdr_dask.physics.mdr.uniform_grid import uniform_grid

    grid = uniform_grid(1000, 2.0)
    image, n = np.ones(grid.nodes.size), grid.nodes.size
    return Work(lambda: grid.inverse @ image, n * n, {"add": n * n, "multiply": n * n, "load": n * n})


KERNELS = (
    Kernel("bounds and sums of blocks", "node", preparation, is_wide=True),
    Kernel("node to node", "node and case", node_to_node),
    Kernel("cubic sweep, light contact", "node", lambda: _sweep(0.01)),
    Kernel("cubic sweep, transition", "node", lambda: _sweep(0.3)),
    Kernel("cubic sweep, nearly full contact", "node", lambda: _sweep(10.0)),
    Kernel("the papers' steps", "node and case", papers_steps, is_wide=True),
    Kernel("general solid", "node, arm and sweep", general_solid),
    Kernel("search after a jump", "patch", search_after_jump),
    Kernel("elements of a history", "element and step", elements),
    Kernel("limit rule of wear", "case", limit_rule),
    Kernel("exact wear: memory", "node", exact_wear),
    Kernel("film: balance", "node", film_balance),
    Kernel("film: equations", "entry", film_equations, is_wide=True),
    Kernel("breakthrough", "point", breakthrough),
    Kernel("phase factors", "wave", phase_factors, is_wide=True),
    Kernel("line from waves", "node", fourier_line, is_wide=True),
    Kernel("slope from waves", "wave", rms_slope, is_wide=True),
    Kernel("image to body", "node and node", transform, is_wide=True),
)
