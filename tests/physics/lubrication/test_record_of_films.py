"""Whole results of closed forms, grids, limits and films on record: a number that moves is seen."""

import itertools

import numpy as np
import record
from flattened import flat

from mdr_dask.physics.lubrication import film_formulas, grids, limits, newton, oil, traction
from mdr_dask.physics.lubrication import load_sharing as sharing
from mdr_dask.physics.lubrication.deformation import film, influence_matrix
from mdr_dask.physics.lubrication.grid_solution import GridSolution, expected
from mdr_dask.physics.lubrication.line_contact import SETTINGS, LineContact, _next_rung, line_contact, solve_film

#: Ascending nodes of unequal cells, and a pressure on them with a spike.
NODES = np.array([-3.1, -2.0, -1.45, -1.1, -0.83, -0.52, -0.2, 0.07, 0.31, 0.58, 0.79, 0.88, 0.93, 1.02, 1.13, 1.3])
PRESSURE = np.array([0, 0.01, 0.05, 0.2, 0.55, 0.8, 0.95, 1, 0.93, 0.74, 0.52, 0.6, 0.41, 0.1, 0, 0])
LIQUIDS = {"barus": newton.Liquid(7.3, 0.0, 0.0, 0.31, 0.87), "roelands": newton.Liquid(7.3, 0.41, 0.62, 0.31, 0.87)}


def test_closed_forms_of_films(dataframe_regression):
    W, U = np.array([3e-6, 2.1e-5, 3.3e-4, 0.02]), np.array([3e-13, 1.3e-11, 7e-10, 2e-8])
    G = np.array([0.3, 900, 4321, 2e4])
    found = {"hertz": film_formulas.hertz_line([1e4, 3.3e5], 1.15e11, [0.013, 0.4])}
    found |= {"gap": film_formulas.hertz_gap(np.linspace(-1.7, 2.3, 9) * 3e-4, 3e-4, 0.013)}
    found |= {"groups": film_formulas.dimensionless_groups(1.1e5, 0.083, 1.7, 2.1e-8, 1.15e11, 0.013)}
    for name, formula in film_formulas.FORMULAS.items():
        found |= {name: formula, f"{name} films": formula(W, U, G)}
        edges = zip(formula.load_range, formula.speed_range, formula.material_range, strict=True)
        points = (*zip(W, U, G, strict=True), *edges)
        found |= {f"{name} outside": [formula.outside(*point) or "inside" for point in points]}
    points = list(itertools.product(W, U, G))
    found |= {"limiting": list(film_formulas.limiting_films(W, U, G)), "moes": film_formulas.moes_parameters(W, U, G)}
    found |= {"regime": film_formulas.regime(*np.array(points).T), "regimes": film_formulas.REGIMES}
    pairs = itertools.product([0.3, 7.0, 900.0], [0.0, 2.0, 30.0])
    found |= {"expected": [film_formulas.expected_film(M, L) for M, L in pairs]}
    found |= {"thick": [film_formulas.thick_film(film) or "thin" for film in (0.09, 0.1, 0.101, 3.456)]}
    record.check(dataframe_regression, flat("", found))


def test_friction_of_a_uniform_film(dataframe_regression):
    contact = film_formulas.hertz_line(1.1e5, 1.15e11, 0.013)
    cases = itertools.product(("barus", "roelands"), (0.0, -0.013, 2.3), (3e4, 5e6), (0.37, 1.0))
    found = {}
    for law, velocity, stress, share in cases:

        def log_viscosity(pressure, law=law):
            return oil.log_viscosity(law, pressure, 0.083, 2.1e-8)

        friction = film_formulas.fluid_friction(contact, 1.7e-7, velocity, log_viscosity, stress, share)
        found[f"{law} {velocity} {stress} {share}"] = friction
    record.check(dataframe_regression, found)


def test_oils(dataframe_regression):
    T = np.array([288.15, 313.15, 341.0, 373.15])
    fit = oil.walther_fit(np.array([373.15, 293.0, 333.3]), np.array([9.1e-6, 310e-6, 41e-6]))
    found = {"fit": fit, "constants": oil.walther_constants(313.15, 3.2e-4, 371.0, 2.4e-5)}
    found |= {"named": oil.OILS, "kinematic": oil.kinematic_viscosity(T, *fit)}
    found |= {"density": oil.density_at(T, 871.0, 288.15), "correlations": oil.CORRELATIONS}
    for correlation in oil.CORRELATIONS:
        found |= {correlation: oil.pressure_viscosity(correlation, np.array([9e-6, 3e-4]), np.array([8e-3, 0.27]))}
    for name, one in oil.OILS.items():
        found |= {f"{name} values": (one.kinematic(T), one.dynamic(T), one.alpha(T))}
        found |= {f"{name} outside": [one.outside(t) or "inside" for t in (313.14, 313.15, 340.0, 373.15, 373.16)]}
    for law in ("barus", "roelands"):
        found |= {law: oil.log_viscosity(law, np.array([0.0, 3e7, 1.3e9]), 0.083, 2.1e-8)}
    found |= {"plain": (oil.barus(2e8, 0.083, 2.1e-8), oil.roelands(2e8, 0.083, 2.1e-8))}
    record.check(dataframe_regression, flat("", found))


def test_grids(dataframe_regression):
    density, found = 1.3 + np.cos(2.1 * NODES) ** 2, {}
    for central in (3e-5, 0.02, 0.49, 0.51, 6.0):
        inlet, outlet = grids.inlet_position(central), grids.outlet_position(central)
        nodes = grids.first_grid(central, inlet, 83)
        pressure = grids.first_pressure(nodes, central)
        asked = grids.adapted_density(nodes, pressure, central + 0.3 * nodes**2, central)
        found |= {f"{central}": (np.array([inlet, outlet]), nodes, pressure, asked)}
    found |= {"starved": grids.first_grid(0.02, -1.3, 61), "sampled": grids.sample(NODES, density, 23)}
    for count, rupture, front in (
        (31, 1.2, np.nan),
        (31, 1.2, 1.05),
        (203, 1.25, 0.2),
        (11, 0.4, 0.9),
        (47, 1.3, 1.29),
    ):
        found |= {f"aligned {count} {rupture} {front}": grids.aligned(NODES, density, count, rupture, front)}
    found |= {
        "halved": [grids._halved_by(share, cells) for share in (0.3, 0.77, 0.913, 0.999) for cells in (7, 41, 640)]
    }
    found |= {"ladder": grids.ladder(SETTINGS.nodes), "curved": grids.second_derivative(NODES, PRESSURE)}
    record.check(dataframe_regression, flat("", found))


def test_limits(dataframe_regression):
    """Powers, their sums, values that turn back, repeat, grow or are not there; three grids and four, of any ratios."""
    found = {}
    for spacing in (np.array([1.0, 0.5, 0.25, 0.125]), np.array([0.9, 0.61, 0.4, 0.31])):
        values = np.stack([1 + 0.3 * spacing**order for order in (0.15, 0.9, 1.49, 1.55, 1.8, 2.0, 2.5, 2.7, 4.0)], 1)
        mixed = np.stack([2 - spacing**2 * (1 + cube * spacing) for cube in (-3.0, -0.4, 0.7, 2.0)], 1)
        odd = np.array(
            [
                [1, 1, 1, 1, np.nan, np.nan],
                [2, 1, 3, 1.5, np.nan, 1],
                [2.5, 2, 2, 1.7, 1, 2],
                [2.6, 1, 2, 2.1, 1.1, 2.2],
            ]
        )
        for name, rows in (("powers", values), ("mixed", mixed), ("odd", odd)):
            for number in (3, 4):
                key = f"{name} {number} {spacing[1]}"
                found |= {key: limits.extrapolate(rows[-number:], spacing[-number:])}
                found |= {f"{key} of films": limits.extrapolate(rows[-number:], spacing[-number:], 0.07, 2.0)}
    found |= {"scaled": limits.extrapolate(values[:, 4], spacing).scaled(3.0)}
    record.check(dataframe_regression, flat("", found))


def test_shared_loads(dataframe_regression):
    gaps = [1e-320, 1e-290, 1e-9, 0.05, 0.3989, 0.399, 0.7, 3.3, 8.99, 9.01, 40.0]
    found = {"overlap": [sharing.mean_overlap(d) for d in (-37.0, -2.0, -0.1, 0.0, 0.7, 5.0, 12.0)]}
    found |= {"distance": [sharing.distance_of_means(gap) for gap in gaps]}
    asperities = sharing.Asperities(3.3e-7, 2.1e-4, 1.15e11)
    found |= {"pressure": [asperities.pressure(film) for film in (1e-9, 1.3e-7, 6e-7, 2e-6)]}
    for factor, tolerance, thinnest in itertools.product((1e-9, 0.03, 0.8, 30.0, 1e80), (1e-9, 1e-2), (0.0, 0.2)):

        def film_at(share, thinnest=thinnest):
            return 2.3 / share**0.21 if share > thinnest else 0.0

        shared = sharing.share_load(film_at, lambda film, factor=factor: factor * np.exp(-film), tolerance)
        found |= {f"shared {factor} {tolerance} {thinnest}": [float(part) for part in shared]}
    record.check(dataframe_regression, flat("", found))


def test_equations_of_a_film(dataframe_regression):
    """The parts of one Newton step, and where iterations end that are cut short, torn or led astray."""
    grid, found = newton.Grid.of(NODES), {}
    H = newton.film_on(grid, PRESSURE, 0.37)
    found |= {"grid": grid, "film": H, "between": film(np.array([-4.0, -0.9, 0.0, 0.4, 2.2]), NODES, PRESSURE, 0.37)}
    found |= {"influence": influence_matrix(NODES[::3])}
    found |= {"mobility": [newton._mobility(0.7, 0.7 + rise) for rise in (0.0, 9.9e-4, -9.9e-4, 1.1e-3, -3.0, 5.0)]}
    for name, liquid in LIQUIDS.items():
        n = NODES.size
        parts = newton.Imbalance(np.empty(n), np.empty((n, 4)), np.empty((n, 4)))
        newton.balance(NODES, liquid, 0.23, PRESSURE, H, np.empty((4, n)), parts)
        found |= {f"{name} viscosity": newton.log_viscosities(PRESSURE, liquid)}
        found |= {f"{name} value": parts.value, f"{name} by pressure": parts.by_pressure}
        found |= {f"{name} by film": parts.by_film}
        active = np.empty(n, np.int64)
        active = active[: newton._fill_active(grid.influence, PRESSURE, parts, active)]
        A, b = np.empty((active.size + 1,) * 2), np.empty(active.size + 1)
        newton._fill_equations(grid, PRESSURE, parts, active, A, b)
        found |= {f"{name} active": active, f"{name} matrix": A.copy(), f"{name} right": b.copy()}
        newton._fill_imbalance(grid, PRESSURE, parts.value, active, b)
        found |= {f"{name} imbalance": b}
    for clip, change in itertools.product((0.02, 0.7, 50.0), (0.1, -0.3, -40.0)):
        step, P, there = 0.2 * np.sin(3 * NODES), PRESSURE.copy(), H.copy()
        share = newton._step_length(grid, P, there, step, change, clip)
        taken = newton._take_step(grid, clip, P, 0.37, there, step, change)
        found |= {f"step {clip} {change}": (share, np.array(taken), P, there)}
    record.check(dataframe_regression, flat("", found))


def test_iterations_of_a_film(dataframe_regression):
    found = {}
    for (name, liquid), K, central in itertools.product(LIQUIDS.items(), (0.003, 0.23, 9.0), (0.05, 0.6)):
        nodes = grids.first_grid(central, -7.0, 41)
        grid, guess = newton.Grid.of(nodes), grids.first_pressure(nodes, central)
        for pace in (newton.Pace(0.12, 80), newton.Pace(0.5, 5), newton.Pace(0.04, 200, 1e-7), newton.Pace(3.0, 30)):
            end = newton.newton(grid, liquid, K, guess, central, pace)
            found |= {f"{name} {K} {central} {pace}": [end.outcome.name, str(end.steps), f"{end.central:.6g}"]}
            if pace.clip == 0.12:
                found |= {f"{name} {K} {central}": end}
    record.check(dataframe_regression, flat("", found))


def test_readings_of_a_grid(dataframe_regression):
    """A film with a spike, one without, one torn to its last node and one that is lowest at an end."""
    found, places = {}, np.linspace(-3.5, 1.7, 23)
    shapes = {"spike": PRESSURE, "none": np.minimum(PRESSURE, 0.52), "single": np.where(PRESSURE == 1, 0.7, 0.0)}
    shapes |= {
        "to the end": np.append(PRESSURE[:-2], [0.07, 0.03]),
        "low spike": np.where(NODES == 0.88, 0.525, PRESSURE),
    }
    for name, pressure in shapes.items():
        heights = 0.2 + 0.1 * (NODES - 0.93) ** 2 * (1 + 0.3 * np.sin(5 * NODES))
        grid = GridSolution(NODES, pressure, heights, 0.31, 7, 0.02)
        found |= {f"{name} film": grid.film_between(places), f"{name} pressure": grid.pressure_between(places)}
        for reading in ("density", "central_film", "minimum", "spike", "front", "rupture", "cut"):
            found |= {f"{name} {reading}": getattr(grid, reading)}
        for front in (np.nan, 0.9, 1.0):
            found |= {f"{name} carried {front}": grid.pressure_carried(np.sort(np.append(NODES, places[3:20])), front)}
    for slope in (-1.0, 0.0, 1.0):
        grid = GridSolution(NODES, PRESSURE, 2 + slope * 0.3 * NODES, 0.31, 7)
        found |= {f"straight {slope}": (grid.minimum, grid.cut, grid.spacing)}
    two = [GridSolution(NODES, PRESSURE, factor + NODES**2, factor, 7, h) for factor, h in ((1.0, 0.2), (1.3, 0.11))]
    found |= {f"expected {order}": expected(two, lambda grid: grid.film, 0.07, order) for order in (2.0, 4.0)}
    found |= {"expected of one": expected(two[:1], lambda grid: grid.central, 0.07, 2.0)}
    record.check(dataframe_regression, flat("", found))


CASES = {
    "rigid": LineContact(0.07, 0.0),
    "soft": LineContact(31.0, 0.4),
    "usual": line_contact((2.1e-5, 1.3e-11, 4321.0), 1.15e11),
    "roelands": line_contact((1.3e-4, 2e-11, 4321.0), 1.15e11, viscosity_law="roelands", viscosity=0.083),
    "incompressible": line_contact((2.1e-5, 1.3e-10, 2100.0), 1.15e11, compressible=False),
    "starved": line_contact((2.1e-5, 1.3e-11, 4321.0), 1.15e11, inlet=-1.7),
    "sharp": line_contact((6e-5, 1.3e-11, 5321.0), 1.15e11),
    "thin": LineContact(3000.0, 40.0),
    "thinner": LineContact(1e4, 40.0),
    "none": LineContact(3e6, 0.1),
}


def test_films(dataframe_regression):
    found = {}
    for (name, case), accuracy in itertools.product(CASES.items(), (3e-3, 1e-4)):
        film = solve_film(case, accuracy)
        key = f"{name} {accuracy}"
        found |= {f"{key} end": [film.outcome.name, film.reason, str(film.steps)]}
        found |= {f"{key} central": film.central_film, f"{key} least": film.minimum_film}
        found |= {f"{key} grids": [f"{grid.nodes.size} {grid.steps}" for grid in film.grids]}
        if film.grids:
            found |= {f"{key} error": film.error, f"{key} spacing": [grid.spacing for grid in film.grids]}
    record.check(dataframe_regression, flat("", found))


def test_readings_of_films(dataframe_regression):
    found = {name: (case, case.film_number, case.log_viscosity) for name, case in CASES.items()}
    for name in ("soft", "usual", "roelands", "starved", "sharp"):
        film = solve_film(CASES[name], 3e-4)
        found |= {f"{name} finest": film.finest}
        for place in ("rupture", "front", "cut", "central_film"):
            found |= {f"{name} {place}": film.position(lambda grid, place=place: getattr(grid, place))}
        for place in ("minimum", "spike"):
            found |= {f"{name} {place}": film.estimate(lambda grid, place=place: np.array(getattr(grid, place)))}
        for stress in (None, 0.004):
            shear = traction.shear_stress(film.case, film.finest, 2e-5, 0.03, stress)
            coefficient = traction.sliding_coefficient(film.case, film.finest, 2e-5, 0.03, stress)
            found |= {f"{name} traction {stress}": (np.log(coefficient), np.log1p(shear))}
        found |= {f"{name} rolling": traction.rolling_coefficient(film.finest, 2e-5)}
    record.check(dataframe_regression, flat("", found))


def test_rungs(dataframe_regression):
    film, found, rungs = solve_film(CASES["soft"], 3e-3), {}, grids.ladder(SETTINGS.nodes)
    sharp = solve_film(CASES["sharp"], 3e-3)
    for (name, one), at in itertools.product({"soft": film, "sharp": sharp, "no": None}.items(), (0, 4, 13, 15, 16)):
        error = one.error if one else 1.0
        asked = [error * share for share in (1.1, 1.0, 0.7, 0.45, 0.3, 0.05)]
        found |= {f"{name} {at}": [_next_rung(rungs, at, one, accuracy, SETTINGS) for accuracy in asked]}
    record.check(dataframe_regression, found)
