"""The exact evolution against published figures, identities, its limits and the simulation of every cycle."""

from functools import partial

import numpy as np
import pytest
from references.literal_wear import literal

from mdr_dask.physics.mdr.revolution import PowerProfile, from_table
from mdr_dask.physics.mdr.transforms import gauss, power_factor
from mdr_dask.physics.wear import rules
from mdr_dask.physics.wear.accuracy import checked_exact
from mdr_dask.physics.wear.exact import exact

PARABOLA = PowerProfile(2.0)
RADII = np.array([0.5, 0.7, 0.9, 1.0, 1.1])
EVERYWHERE = np.linspace(0.0, 1.6, 300)
CYCLES = [0.0, 0.5, 2.0, 8.0, 60.0]
#: d, c and V under constant force at N = 8 by tolerance 1e-5 (half a minute).
CONVERGED = np.array([1.2772430, 0.5038731, 1.2728999])


@pytest.fixture(scope="module", params=["depth", "force"])
def worn(request):
    return request.param == "force", exact(PARABOLA, 0.455, CYCLES, 1e-4, constant_force=request.param == "force")


def test_checked_figures_at_constant_depth():
    """Figures on which independent solvers agree: 5e-6 in f, 1e-6 in a, 4e-6 in V."""
    first, second = exact(PARABOLA, 0.455, [2.0, 8.0], accuracy=1e-5)
    np.testing.assert_allclose(first.height(RADII), [0.157822, 0.381394, 0.525578, 0.579692, 0.626711], atol=2e-6)
    assert first.contact_radius == pytest.approx(1.133353, abs=2e-5)  # converged in the next test
    assert first.wear_volume == pytest.approx(0.310754, abs=4e-6)
    assert second.contact_radius == pytest.approx(1.240150, abs=2e-6)
    assert second.wear_volume == pytest.approx(0.872404, abs=4e-6)
    beyond = second.contact_radius * np.array([1.0 + 1e-9, 1.01, 1.1, 3.0])
    np.testing.assert_array_equal(second.height(beyond), PARABOLA.height(beyond))


@pytest.mark.slow
def test_convergence_under_constant_force():
    """Depth, border and volume at N = 8."""
    gaps = []
    for tolerance in (1e-3, 1e-4):
        contact = exact(PARABOLA, 0.455, [8.0], tolerance, constant_force=True)[0]
        gaps.append(np.abs(np.array([contact.depth, contact.stick_border, contact.wear_volume]) - CONVERGED))
    assert np.all(gaps[0] > gaps[1])
    assert np.all(gaps[1] < [6e-6, 6e-6, 3e-5])


def test_the_volume_is_that_of_the_profile_and_what_is_held_stays(worn):
    under_force, contacts = worn
    radius = 1.6 * (np.arange(4000) + 0.5) / 4000
    for contact in contacts:
        depth = contact.height(radius) - PARABOLA.height(radius)
        assert contact.wear_volume == pytest.approx(2 * np.pi * radius @ depth * 1.6 / 4000, abs=1e-5)
    forces, depths, borders = (
        [getattr(contact, name) for contact in contacts] for name in ("normal_force", "depth", "stick_border")
    )
    if under_force:
        np.testing.assert_allclose(forces, 4.0 / 3.0, rtol=1e-5)
        assert depths == sorted(depths)
        assert borders == sorted(borders)
        assert borders[3] == borders[4]  # the image jumps there
    else:
        assert set(depths) == {1.0}
        assert set(borders) == {0.455}
        assert forces == sorted(forces, reverse=True)
    for name in ("contact_radius", "wear_volume"):
        values = [getattr(contact, name) for contact in contacts]
        assert values == sorted(values)
    assert contacts[0].wear_volume == 0.0


def test_image_at_border_and_edge(worn):
    """While the border moves g is continuous there; afterwards it is frozen within and jumps. At the edge g = d."""
    under_force, contacts = worn
    eta, near = 1.0 - 0.455**2, np.array([1 - 1e-9, 1 + 1e-9])
    for contact in contacts[1:]:
        edge = contact.contact_radius
        np.testing.assert_allclose(contact.image(np.array([edge, np.nextafter(edge, 0.0)])), contact.depth, rtol=1e-9)
    for contact in contacts[1:3] if under_force else ():
        inside, outside = contact.image(contact.stick_border * near)
        assert inside == pytest.approx(contact.depth - eta, abs=1e-6)
        assert outside == pytest.approx(inside, abs=1e-4)
    inside, outside = contacts[3].image(contacts[3].stick_border * near)
    assert outside - inside > 0.5
    frozen = np.linspace(0.0, contacts[3].stick_border * near[0], 50)
    np.testing.assert_allclose(contacts[3].image(frozen), contacts[4].image(frozen), atol=1e-12)


def test_stated_errors_cover_the_distance_from_a_finer_solution(worn):
    under_force, contacts = worn
    rough = checked_exact(PARABOLA, 0.455, CYCLES[1:4], ["height"], EVERYWHERE, constant_force=under_force)
    for contact, fine in zip(rough, contacts[1:4], strict=True):
        error = contact.errors["height"]
        assert np.all(np.abs(contact.worn.height(EVERYWHERE) - fine.height(EVERYWHERE)) <= error)
        assert error < 3e-2


@pytest.mark.parametrize(
    ("exponent", "c", "constant_force"),
    [(2.0, 0.455, True), (1.0, 0.368, True), (0.5, 0.3, True), (2.0, 0.455, False), (0.5, 0.3, False)],
)
def test_after_many_cycles_the_contact_is_the_limit(exponent, c, constant_force):
    profile = PowerProfile(exponent)
    last, limit, end = exact(profile, c, [1e3, np.inf, 1e12], 1e-3, constant_force=constant_force)
    assert end.wear_volume == limit.wear_volume
    assert last.depth == pytest.approx(limit.depth, rel=2e-4)
    assert last.contact_radius == pytest.approx(limit.contact_radius, rel=3e-4)
    assert last.wear_volume == pytest.approx(limit.wear_volume, rel=2e-3)
    inside = np.linspace(0.0, limit.contact_radius, 200)[1:-1]
    assert np.max(np.abs(last.height(inside) - limit.height(inside))) < 2e-3


@pytest.mark.parametrize(
    ("exponent", "c", "cycles"),
    [(3.042, 0.136, 0.13), (0.746, 0.081, 11.5), (2.126, 0.137, 87.0), (26.8, 0.81, 49.0), (50.0, 0.05, 1.0)],
)
@pytest.mark.parametrize("constant_force", [False, True])
def test_sharp_and_steep_bodies_wear_at_every_resolution(exponent, c, cycles, constant_force):
    (found,) = checked_exact(PowerProfile(exponent), c, [cycles], ["wear_volume"], RADII, constant_force=constant_force)
    assert found.errors["wear_volume"] < 0.05 * found.worn.wear_volume


def test_the_border_of_a_steep_body_leaves_its_first_place_with_the_first_wear():
    """It moves from .2 to .7 while the depth grows by 1e-6, and no step of the evolution resolves this."""
    virgin, little, more = checked_exact(
        PowerProfile(40.0), 0.2, [0.0, 1e-9, 1e-3], ["stick_border"], RADII, constant_force=True
    )
    assert virgin.worn.stick_border == pytest.approx(0.2)
    for worn, errors in (little, more):
        without_wear = (0.2**40.0 + worn.depth - 1.0) ** (1.0 / 40.0)
        assert abs(worn.stick_border - without_wear) <= errors["stick_border"] + 0.01


def test_the_limit_under_force_has_no_pressure_outside_its_stick_zone():
    limit = exact(PARABOLA, 0.455, [np.inf], constant_force=True)[0]
    outside = np.linspace(limit.stick_border * 1.001, limit.contact_radius * 0.999, 20)
    np.testing.assert_allclose(limit.pressure(outside), 0.0, atol=1e-9)
    np.testing.assert_allclose(limit.image(outside), limit.depth, atol=1e-12)
    abscissa, weight = gauss(64)
    load = [
        (high - low) * weight @ (limit.depth - limit.image(low + (high - low) * abscissa))
        for low, high in ((0, 0.455), (0.455, limit.stick_border))
    ]
    assert 2.0 * sum(load) == pytest.approx(4.0 / 3.0, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("constant_force", "most"), [(False, 2e-3), (True, 3.5e-3)])
def test_the_literal_simulation_tends_to_the_exact_evolution(constant_force, most):
    reference = exact(PARABOLA, 0.455, [2.0], 1e-4, constant_force=constant_force)[0]
    errors = []
    for cells in (50, 100, 200):
        radii, height, depth = literal(PARABOLA, 0.455, 2.0, cells=cells, constant_force=constant_force)
        errors.append(np.max(np.abs(height - reference.height(radii))))
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < most
    assert depth == pytest.approx(reference.depth, abs=1e-3)


@pytest.mark.parametrize("constant_force", [False, True])
def test_table_of_a_parabola(constant_force):
    r = np.linspace(0, 3, 301)
    measured, formula = (
        exact(body, 0.455, [2.0], 1e-3, constant_force=constant_force)[0]
        for body in (from_table(r, r**2 / 2, 1.0), PARABOLA)
    )
    np.testing.assert_allclose(measured.height(RADII), formula.height(RADII), atol=1e-4)
    assert measured.stick_border == pytest.approx(formula.stick_border, abs=1e-4)


@pytest.mark.parametrize(
    "wears",
    [
        lambda body: rules.limit(body, 0.4),
        lambda body: rules.fast(body, 0.4, 1.0),
        lambda body: exact(body, 0.4, [1.0])[0],
        lambda body: exact(body, 0.0, [0.3])[0],
    ],
    ids=["limit", "fast", "exact", "gross slip"],
)
def test_a_measured_body_has_no_values_beyond_its_table(wears):
    r = np.linspace(0, 2, 101)
    table = from_table(r, r**2, 1.0)
    worn = wears(table)
    touched, beyond = worn.contact_radius * np.linspace(0, 0.99, 9), table.largest_radius * np.linspace(1.001, 2.5, 9)
    for name in ("height", "image"):
        assert np.all(np.isfinite(worn.value(name, touched)))
        assert np.all(np.isnan(worn.value(name, beyond)))
    assert np.all(np.isfinite(worn.value("height", table.largest_radius * np.linspace(0.5, 1, 9))))


def test_a_contact_that_grows_beyond_its_table_is_refused():
    r = np.linspace(0, 1.35, 136)
    body = from_table(r, r**2 / 2, 0.9)
    assert exact(body, 0.455, [0.1], constant_force=True)[0].contact_radius < body.largest_radius
    for cycles in (20.0, np.inf):
        with pytest.raises(ValueError, match="the contact reaches beyond the table"):
            exact(body, 0.455, [cycles], constant_force=True)


@pytest.mark.parametrize("constant_force", [False, True])
def test_a_result_does_not_depend_on_the_other_amounts(constant_force):
    solve = partial(checked_exact, PARABOLA, 0.5, outputs=["wear_volume"], places=RADII, constant_force=constant_force)
    (alone, error), (among, other) = solve([1.3])[0], solve([9.0, 1.3, np.inf, 0.2])[1]
    assert (alone.wear_volume, alone.depth, error) == (among.wear_volume, among.depth, other)
    np.testing.assert_array_equal(alone.height(RADII), among.height(RADII))


@pytest.mark.parametrize(("exponent", "radius", "volume"), [(2.0, np.sqrt(2), np.pi), (1.0, np.pi / 2, np.pi**3 / 12)])
def test_gross_slip_at_constant_depth_ends_in_the_free_body(exponent, radius, volume):
    early, late = exact(PowerProfile(exponent), 0.0, [1.0, 30.0], accuracy=1e-4)
    assert late.contact_radius == pytest.approx(radius, abs=1e-4)
    assert late.wear_volume == pytest.approx(volume, abs=1e-4)
    slid = 3.0 * (np.arange(2000) + 0.5) / 2000
    worn = early.height(slid) - slid**exponent / power_factor(exponent)
    assert early.wear_volume == pytest.approx(2.0 * np.pi * worn @ slid * 3.0 / 2000, abs=2e-4)  # the midpoint rule
