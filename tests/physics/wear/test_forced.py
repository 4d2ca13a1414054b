"""Fretting under constant force: the exact evolution, its end, the fast rule, and the literal simulation of it."""

from functools import partial

import numpy as np
import pytest
from references.literal_wear import literal
from scipy.integrate import quad

from mdr_dask.physics.mdr.half_integrals import graded_panels
from mdr_dask.physics.mdr.revolution import PowerProfile, from_table
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear import evolution
from mdr_dask.physics.wear.exact import exact
from mdr_dask.physics.wear.slip import partial_slip

PARABOLA = PowerProfile(2.0)
exact_forced = partial(exact, constant_force=True)
RADII = np.linspace(0.0, 1.6, 300)
#: d, c and V at N = 8 by tolerance 1e-5 (half a minute).
CONVERGED = np.array([1.2772430, 0.5038731, 1.2728999])


@pytest.fixture(scope="module")
def worn():
    return exact_forced(PARABOLA, 0.455, [0.0, 0.5, 2.0, 8.0, 60.0], accuracy=1e-4)


def test_force_stays_and_volume_is_energy(worn):
    for contact in worn:
        assert contact.normal_force == pytest.approx(4.0 / 3.0, rel=1e-5)
        assert contact.wear_volume == pytest.approx(contact.energy_volume, rel=1e-4, abs=1e-6)


def test_depth_border_and_contact_only_grow(worn):
    for name in ("depth", "stick_border", "contact_radius", "wear_volume"):
        values = [getattr(contact, name) for contact in worn]
        assert values == sorted(values)
    assert worn[3].stick_border == worn[4].stick_border  # the image jumps there


def test_image_at_the_border_is_the_depth_less_eta(worn):
    """While the border moves g is continuous there; afterwards it is frozen within and jumps."""
    eta = 1.0 - 0.455**2
    for contact in worn[1:3]:
        c = contact.stick_border
        inside, outside = contact.image(np.array([c * (1 - 1e-9), c * (1 + 1e-9)]))
        assert inside == pytest.approx(contact.depth - eta, abs=1e-6)
        assert outside == pytest.approx(inside, abs=1e-4)
    c = worn[3].stick_border
    inside, outside = worn[3].image(np.array([c * (1 - 1e-9), c * (1 + 1e-9)]))
    assert outside - inside > 0.7
    frozen = worn[4].image(np.linspace(0.0, c * (1 - 1e-9), 50))
    np.testing.assert_allclose(worn[3].image(np.linspace(0.0, c * (1 - 1e-9), 50)), frozen, atol=1e-12)


@pytest.mark.parametrize("constant_force", [False, True])
def test_every_step_conserves_energy(constant_force):
    """Volume from the worn depths of slip zone and annulus, against int 2 (d - g) y dx."""
    problem, start = partial_slip(PARABOLA, 0.455, graded_panels(12, 8, 4), 3.0), None
    if constant_force:
        problem, start = problem.under_force()
    moments = evolution.march(problem, 2.0, 2e-5, 1e-5, start)
    energy = evolution.integral_along(moments, [problem.wear_rate(m.unknowns) for m in moments])
    abscissa, weight = gauss(40)
    whole = np.pi * problem.body.width * problem.eta
    volumes = []
    for moment in moments:
        border, width, _ = problem.place(moment.unknowns)
        slipping = width * (problem.panels.weights @ moment.accumulated)
        stuck = max(border, 0.0) * float(weight @ problem.frozen_depth(moment.path, max(border, 0.0) * abscissa))
        volumes.append(whole * (slipping + stuck))
    np.testing.assert_allclose(np.diff(volumes), np.diff(energy), atol=5e-6)  # of steps of 2e-5
    np.testing.assert_allclose(volumes, energy, atol=1e-5)  # accumulated over them


def test_the_frozen_depth_is_the_integral_along_the_path():
    """(2/pi) int arccos(b / r) dd over straight pieces of b^2 up to the moment at which the border passes r."""
    problem = partial_slip(PARABOLA, 0.455, graded_panels(16, 4, 4), 3.0)
    rng = np.random.default_rng(3)
    path = np.cumsum(np.append([[0.0], [0.0]], rng.uniform(0.0, 0.02, (2, 12)) ** 2, axis=1), axis=1)
    square, width = problem.body.square, problem.body.width
    places = np.append(path[0, [3, 8, 12]], 0.5 * (path[0, 5] + path[0, 6]))
    for q, found in zip(places, problem.frozen_depth(path, places), strict=True):
        depth = np.interp(q, *path)

        def angle(d, q=q):
            return np.arccos(np.sqrt((square + width * np.interp(d, *path[::-1])) / (square + width * q)))

        rise = 2.0 / np.pi * quad(angle, 0.0, depth, points=path[1][path[1] < depth], epsabs=1e-14)[0]
        r = np.sqrt(square + width * q)
        virgin = quad(lambda t, r=r: PARABOLA.rise(r * np.cos(t) - 0.455, 0.455), 0.0, np.arccos(0.455 / r))[0]
        assert found == pytest.approx(rise - 2.0 / np.pi * virgin / problem.eta, abs=2e-5 * rise)


def test_the_image_is_at_the_depth_at_the_edge(worn):
    """At the very edge, too, where rounding may put its place just outside of the ring."""
    for contact in worn[1:]:
        edge = contact.contact_radius
        image = contact.image(np.array([edge, np.nextafter(edge, 0.0)]))
        np.testing.assert_allclose(image, contact.depth, rtol=1e-9)


@pytest.mark.slow
def test_convergence_with_the_tolerance():
    """Depth, border and volume at N = 8; a table with -s."""
    gaps = []
    for tolerance in (1e-3, 4e-4, 1e-4):
        contact = exact_forced(PARABOLA, 0.455, [8.0], tolerance)[0]
        found = np.array([contact.depth, contact.stick_border, contact.wear_volume])
        gaps.append(np.abs(found - CONVERGED))
        print(f"{tolerance:g} {found} {gaps[-1]}")
    assert np.all(gaps[0] > gaps[2])
    assert np.all(gaps[2] < [6e-6, 6e-6, 3e-5])


def test_error_estimate_covers_the_error(worn):
    rough = exact_forced(PARABOLA, 0.455, [0.5, 2.0, 8.0], accuracy=1e-3)
    for contact, fine in zip(rough, worn[1:4], strict=True):
        assert np.max(np.abs(contact.height(RADII) - fine.height(RADII))) < np.max(contact.error("worn_profile", RADII))


@pytest.mark.parametrize(("exponent", "c"), [(2.0, 0.455), (1.0, 0.368), (2.0, 0.9), (0.5, 0.3)])
def test_the_end_is_the_limit(exponent, c):
    profile = PowerProfile(exponent)
    last, limit = exact_forced(profile, c, [1000.0], 1e-3)[0], exact_forced(profile, c, [np.inf])[0]
    assert last.depth == pytest.approx(limit.depth, rel=2e-4)
    assert last.contact_radius == pytest.approx(limit.contact_radius, rel=3e-4)
    assert last.wear_volume == pytest.approx(limit.wear_volume, rel=2e-3)
    inside = np.linspace(0.0, limit.contact_radius, 200)[1:-1]
    assert np.max(np.abs(last.height(inside) - limit.height(inside))) < 2e-3


def test_the_limit_has_no_pressure_outside_its_stick_zone():
    limit = exact_forced(PARABOLA, 0.455, [np.inf])[0]
    outside = np.linspace(limit.stick_border * 1.001, limit.contact_radius * 0.999, 20)
    np.testing.assert_allclose(limit.pressure(outside), 0.0, atol=1e-9)
    np.testing.assert_allclose(limit.image(outside), limit.depth, atol=1e-12)
    abscissa, weight = gauss(64)
    c0, c = 0.455, limit.stick_border
    load = [
        (high - low) * weight @ (limit.depth - limit.image(low + (high - low) * abscissa))
        for low, high in ((0, c0), (c0, c))
    ]
    assert 2.0 * sum(load) == pytest.approx(4.0 / 3.0, rel=1e-4)


def test_the_literal_simulation_tends_to_the_exact_evolution():
    reference = exact_forced(PARABOLA, 0.455, [2.0], accuracy=1e-4)[0]
    errors = []
    for cells in (50, 100, 200):
        simulated = literal(PARABOLA, 0.455, 2.0, cells=cells, substeps=16, constant_force=True)
        errors.append(np.max(np.abs(simulated.height(RADII) - reference.height(RADII))))
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 3.5e-3
    assert simulated.depth == pytest.approx(reference.depth, abs=1e-3)
    assert simulated.normal_force == pytest.approx(4.0 / 3.0, rel=1e-3)


def test_table_of_a_parabola(worn):
    r = np.linspace(0, 3, 301)
    table = exact_forced(from_table(r, r**2 / 2, 1.0), 0.455, [2.0], accuracy=1e-3)[0]
    assert table.wear_volume == pytest.approx(worn[2].wear_volume, rel=1e-3)
    assert table.stick_border == pytest.approx(worn[2].stick_border, abs=1e-4)


def test_a_table_that_ends_before_the_last_contact_is_refused():
    r = np.linspace(0, 1.35, 136)
    body = from_table(r, r**2 / 2, 0.9)
    assert exact_forced(body, 0.455, [0.1], accuracy=1e-3)[0].contact_radius < body.largest_radius
    with pytest.raises(ValueError, match="the contact reaches beyond the table"):
        exact_forced(body, 0.455, [20.0], accuracy=1e-3)
    with pytest.raises(ValueError, match="the contact reaches beyond the table"):
        exact_forced(body, 0.455, [np.inf])[0]


def test_a_result_does_not_depend_on_what_else_was_asked_for():
    alone = exact_forced(PARABOLA, 0.5, [1.3], accuracy=1e-3)[0]
    among = exact_forced(PARABOLA, 0.5, [9.0, 1.3, 0.2], accuracy=1e-3)[1]
    assert (alone.wear_volume, alone.depth) == (among.wear_volume, among.depth)
    np.testing.assert_array_equal(alone.height(RADII), among.height(RADII))
