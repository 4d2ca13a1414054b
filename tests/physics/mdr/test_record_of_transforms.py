"""Transforms of bodies of revolution, their matrices, profiles and closed forms, as they were found."""

import numpy as np
import pytest
import record

from mdr_dask.physics.mdr import power_law_contact, revolution, transforms
from mdr_dask.physics.mdr.half_integrals import graded_panels, interpolate, interpolate_weighted, panel_members
from mdr_dask.physics.mdr.uniform_grid import uniform_grid
from mdr_dask.physics.surfaces.shapes import PowerLaw, RoundedCone

RADII = np.array([0.0, 1e-7, 0.13, 0.5, 0.77, 1.0, 1.2, 1.9])


def sizes(values):
    with np.errstate(all="ignore"):
        return np.log10(np.maximum(np.abs(values), 1e-9))


def test_transforms_with_their_errors(dataframe_regression):
    """Kinks inside and outside, jumps, an apex, a radius of zero, and rules that have too few nodes."""
    found = {}

    def kinked(x):
        return np.where(x < 0.6, 0.7 * x, 0.42 + 1.9 * (x - 0.6)) + 0.3 * x**2.5

    def steep(x):
        return np.where(x < 0.6, 0.7, 1.9) + 0.75 * x**1.5

    for breaks in ((), (0.6,), (0.6, -1.0, 5.0)):
        for tolerance in (1e-10, 1e-4):
            told = {
                "inverse": transforms.inverse_transform(kinked, RADII, breaks=breaks, tolerance=tolerance),
                "forward": transforms.forward_transform(
                    steep, -RADII, apex=0.2, breaks=breaks, jumps=((0.5, 0.1), (1.1, 0.3)), tolerance=tolerance
                ),
                "pressure": transforms.pressure(
                    steep, RADII, 1.3, edge_gap=0.2, breaks=breaks, jumps=((0.7, 0.05),), tolerance=tolerance
                ),
                "volume": transforms.volume(kinked, 1.7, breaks=breaks, tolerance=tolerance),
            }
            for name, (value, error) in told.items():
                found[f"{name} {breaks} {tolerance}"] = value
                found[f"error of {name} {breaks} {tolerance}"] = sizes(error)
    round_tip = transforms.pressure(lambda x: 2 * x, RADII, 1.3)
    found["pressure of a round tip"] = round_tip.value
    for exponent in (0.7, 1.0, 2.0, 3.5):
        found[f"power pressure {exponent}"] = transforms.power_pressure(exponent, RADII, 1.1)
    found["power factors"] = transforms.power_factor(np.array([0.5, 1.0, 2.0, 4.4]))
    for nodes in (1, 2, 7):
        found[f"gauss {nodes}"] = np.append(*transforms.gauss(nodes))
    record.check(dataframe_regression, found)


@pytest.mark.parametrize(("left", "right", "order"), [(3, 2, 3), (0, 1, 2), (2, 0, 5)])
def test_matrices_on_graded_panels(left, right, order, dataframe_regression):
    panels = graded_panels(left, right, order)
    found = {name: getattr(panels, name) for name in ("inner", "full", "outer", "slope", "weights", "nodes")}
    longer = panels.mesh.extended(1.37)
    found |= {name: getattr(longer, name) for name in ("edges", "nodes", "barycentric")}
    values, places = np.cos(3 * longer.nodes), np.append(np.linspace(0.0, 1.5, 41), longer.nodes[3])
    found["between"] = interpolate(longer, values, places)
    rows = np.array([values, values**2, np.sin(longer.nodes)])
    found["weighted"] = interpolate_weighted(longer, rows, np.array([0.2, 1.3, -0.4]), np.array([1.0, 0.83, 1.9]))
    found["members"] = np.concatenate([panel_members(k, order) for k in range(3)])
    found["members at the axis"] = np.array([panel_members(0, order)[0], panel_members(0, order).size])
    record.check(dataframe_regression, found)


@pytest.mark.parametrize("cells", [9, 40])
def test_contacts_on_a_uniform_grid(cells, dataframe_regression):
    grid = uniform_grid(cells, 1.7)
    found = {name: getattr(grid, name) for name in ("nodes", "inverse", "forward", "stress", "spacing")}
    for name, image in {
        "parabola": grid.nodes**2,
        "cone": 0.7 * grid.nodes,
        "sunk": 0.4 + grid.nodes**2,
        "on a node": np.arange(cells + 1.0),
    }.items():
        for depth in (0.0, 0.3, 0.4, 1.0, 2.0, 1e3):
            told = {"edge": grid.edge(image, depth), "force": grid.force(image, depth)}
            told["pressure"] = grid.pressure(image, depth)
            found |= {f"{name} {depth}": np.concatenate([np.ravel(each) for each in told.values()])}
        forces = [0.02, 0.5, 1.1]
        depths = [grid.depth(image, force, guess) for force in forces for guess in (None, 0.9 * image[-1])]
        found[f"{name} depths"] = np.array(depths)
    record.check(dataframe_regression, found)


def test_closed_forms_of_power_laws(dataframe_regression):
    law, found = power_law_contact, {}
    radius, amplitude, exponent, modulus = np.array([0.3, 1.7]), np.array([2.1, 0.6]), np.array([1.3, 2.6]), 3.7
    found["radius"] = law.contact_radius(radius, amplitude, exponent)
    found["depth"] = law.depth(radius, amplitude, exponent)
    found["force"] = law.normal_force(radius, amplitude, exponent, modulus)
    found["radius from force"] = law.radius_from_force(radius, amplitude, exponent, modulus)
    found["stress"] = law.stress(RADII, 1.1, 0.7, 1.3, modulus)
    found["stiffness"] = law.stiffness(radius, modulus)
    found["stick"] = law.stick_radius(np.array([-0.5, 0.0, 0.3, 0.999, 1.0, 1.5]), 1.7)
    record.check(dataframe_regression, found)


def profiles():
    radius = np.array([0.0, 0.2, 0.3, 0.7, 1.0, 1.6, 2.0])
    yield "power", revolution.PowerProfile(1.7)
    yield "round", revolution.PowerProfile(2.0)
    yield "smooth table", revolution.from_table(radius, 0.1 + 0.3 * radius**2, 0.21)
    yield "flattening table", revolution.from_table(radius, radius**1.3, 0.4)
    yield "cornered table", revolution.from_table(radius, np.array([0.0, 0.001, 0.2, 0.21, 0.5, 0.5001, 3.0]), 0.4)
    yield "cone", revolution.from_body(RoundedCone(0.4, 0.3), 0.17)
    yield "body", revolution.from_body(PowerLaw(0.3, 2.4), 40.0)


def test_profiles_of_bodies(dataframe_regression):
    found = {}
    for name, profile in profiles():
        far = RADII[2:] * min(profile.largest_radius, 2.0) / 1.9
        found[f"{name} height"], found[f"{name} image"] = profile.height(far * 1.01), profile.image(far * 1.01)
        found[f"{name} slope"] = profile.image_slope(far)
        gaps = np.array([-0.3, -0.021, 1e-5, 0.019, 0.021, 0.4])
        found[f"{name} rise"] = profile.rise(gaps, 0.5)
        found[f"{name} rise from the tip"] = profile.rise(np.abs(gaps), 0.0)
        found[f"{name} inside"] = np.array([profile.inside(level) for level in (1e-6, 0.3, 0.99)])
        found[f"{name} largest"] = profile.largest_radius
        pieces, level = profile.pieces(), float(profile.image(np.array(0.5)))
        found[f"{name} compiled rise"] = [revolution.image_rise(pieces, 0.5, level, gap) for gap in (*gaps, -0.5, 0.09)]
        found[f"{name} pieces"] = np.append(pieces.knots, pieces.exponent)
        found[f"{name} coefficients"] = np.arcsinh(pieces.coefficients)
        if isinstance(profile, revolution.TableProfile):
            found[f"{name} units"] = np.array([profile.length, profile.height_unit])
    record.check(dataframe_regression, found)


def test_tables_that_are_no_profiles(dataframe_regression):
    good = np.array([0.0, 0.3, 0.9, 1.4])
    found = {}
    for name, (radius, height, depth) in {
        "short": (good[:3], good[:3], 0.1),
        "unequal": (good, good[:3], 0.1),
        "not finite": (good, np.array([0.0, 0.1, np.nan, 1.0]), 0.1),
        "off the axis": (good + 0.1, good, 0.1),
        "radii back": (np.array([0.0, 0.3, 0.3, 1.4]), good, 0.1),
        "falls": (good, np.array([0.0, 0.5, 0.2, 1.0]), 0.1),
        "too deep": (good, good, 7.0),
    }.items():
        with pytest.raises(ValueError, match=r"profile|table") as told:
            revolution.from_table(radius, height, depth)
        found[name] = str(told.value)
    for exponent in (0.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="exponent") as told:
            revolution.PowerProfile(exponent)
        found[f"exponent {exponent}"] = str(told.value)
    found["roots"] = np.array(
        [revolution.bisect(lambda x: x**3 - 0.3, 0.0, 2.0), revolution.bisect(lambda x: x - 9.0, 0.0, 2.0)]
    )
    record.check(dataframe_regression, found)
