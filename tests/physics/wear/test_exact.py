import numpy as np
import pytest

from mdr_dask.physics.mdr.half_integrals import graded_panels
from mdr_dask.physics.mdr.revolution import PowerProfile, from_table
from mdr_dask.physics.mdr.transforms import power_factor
from mdr_dask.physics.wear import evolution as wear_evolution
from mdr_dask.physics.wear import rules as wear
from mdr_dask.physics.wear.exact import exact
from mdr_dask.physics.wear.slip import partial_slip

PARABOLA = PowerProfile(2.0)
RADII = np.array([0.5, 0.7, 0.9, 1.0, 1.1])
SLID = 3.0 * (np.arange(2000) + 0.5) / 2000


@pytest.fixture(scope="module")
def checked():
    return exact(PARABOLA, 0.455, [2.0, 8.0, 18.0], accuracy=1e-5)


def test_checked_figures(checked):
    """Figures on which independent solvers agree: 5e-6 in f, 1e-6 in a, 4e-6 in V."""
    first, second, last = checked
    np.testing.assert_allclose(first.height(RADII), [0.157822, 0.381394, 0.525578, 0.579692, 0.626711], atol=2e-6)
    assert first.contact_radius == pytest.approx(
        1.133353, abs=2e-5
    )  # the edge is the least determined quantity; the next test goes on
    assert first.wear_volume == pytest.approx(0.310754, abs=4e-6)
    assert second.contact_radius == pytest.approx(1.240150, abs=2e-6)
    assert second.wear_volume == pytest.approx(0.872404, abs=4e-6)
    beyond = second.contact_radius * np.array([1.0 + 1e-9, 1.01, 1.1, 3.0])
    np.testing.assert_array_equal(second.height(beyond), PARABOLA.height(beyond))
    limit = wear.limit(PARABOLA, 0.455)
    assert np.max(np.abs(last.height(RADII) - limit.height(RADII))) < 1.5e-4


def test_the_edge_converges_to_the_checked_figure():
    """The edge is the least determined quantity: shorter steps on panels graded deep into the edge, a table with -s."""
    edges = []
    for step_error in (4e-5, 4e-6, 4e-7):
        problem = partial_slip(PARABOLA, 0.455, graded_panels(6, 14, 5), 1.4)
        moments = wear_evolution.march(problem, 2.0, step_error / problem.eta, 1e-4)
        unknowns = wear_evolution.at(problem, moments, 2.0, step_error / problem.eta)[1].unknowns
        edges.append(problem.edge(unknowns))
        print(f"{step_error:g} {len(moments)} {edges[-1]:.7f}")
    gaps = np.abs(np.array(edges) - 1.133353)
    assert np.all(np.diff(gaps) < 0.0)
    assert gaps[-1] < 2e-6  # 1e-6 of the checked figure, 1e-6 of the steps


def test_energy_is_volume_and_force_falls(checked):
    for worn in checked:
        assert worn.energy_volume == pytest.approx(worn.wear_volume, abs=2e-5)
    forces = [worn.normal_force for worn in checked]
    assert forces == sorted(forces, reverse=True)
    assert checked[2].normal_force == pytest.approx(wear.limit(PARABOLA, 0.455).normal_force, abs=1e-3)


def test_error_estimate_covers_the_error(checked):
    coarse = exact(PARABOLA, 0.455, [2.0, 8.0], accuracy=1e-3)
    for rough, fine in zip(coarse, checked, strict=False):
        everywhere = np.linspace(0.3, 1.3, 300)
        error = rough.error("worn_profile", everywhere)
        assert np.all(np.abs(rough.height(everywhere) - fine.height(everywhere)) <= error)
        assert np.max(error) < 5e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("exponent", "c"),
    [(1.0, 0.05), (1.0, 0.21), (0.5, 0.3), (3.0, 0.1), (2.0, 0.98), (8.0, 0.5), (0.3, 0.01), (2.0, 0.999)],
)
def test_extremes_reach_the_limit(exponent, c):
    profile = PowerProfile(exponent)
    worn = exact(profile, c, [60.0], accuracy=1e-3)[0]
    limit = wear.limit(profile, c)
    assert worn.contact_radius == pytest.approx(limit.contact_radius, abs=1e-3)
    assert worn.wear_volume == pytest.approx(limit.wear_volume, rel=2e-3)
    assert worn.energy_volume == pytest.approx(limit.wear_volume, rel=1.5e-2)


def test_table_of_a_parabola():
    r = np.linspace(0, 3, 301)
    measured = exact(from_table(r, r**2 / 2, 1.0), 0.455, [2.0], accuracy=1e-4)[0]
    np.testing.assert_allclose(measured.height(RADII), [0.157822, 0.381394, 0.525578, 0.579692, 0.626711], atol=5e-5)


@pytest.mark.parametrize(
    "wears",
    [
        lambda body: wear.limit(body, 0.4),
        lambda body: wear.fast(body, 0.4, 1.0),
        lambda body: exact(body, 0.4, [1.0])[0],
        lambda body: exact(body, 0.0, [0.3])[0],
    ],
    ids=["limit", "fast", "exact", "gross slip"],
)
def test_nothing_is_told_of_a_measured_body_beyond_its_table(wears):
    r = np.linspace(0, 2, 101)
    table = from_table(r, r**2, 1.0)
    worn = wears(table)
    touched, beyond = worn.contact_radius * np.linspace(0, 0.99, 9), table.largest_radius * np.linspace(1.001, 2.5, 9)
    for name in ("worn_profile", "worn_image"):
        assert np.all(np.isfinite(worn.value(name, touched)))
        assert np.all(np.isnan(worn.value(name, beyond)))
    assert np.all(np.isfinite(worn.value("worn_profile", table.largest_radius * np.linspace(0.5, 1, 9))))


def test_zero_cycles_and_order_of_request():
    worn = exact(PARABOLA, 0.5, [2.0, 0.0, 1.0], accuracy=1e-3)
    assert [w.wear_volume == 0.0 for w in worn] == [False, True, False]
    assert worn[0].wear_volume > worn[2].wear_volume
    assert worn[1].normal_force == pytest.approx(4 / 3, rel=1e-3)


def test_a_result_does_not_depend_on_what_else_was_asked_for():
    alone = exact(PARABOLA, 0.5, [1.3], accuracy=1e-3)[0]
    among = exact(PARABOLA, 0.5, [9.0, 1.3, 0.2], accuracy=1e-3)[1]
    assert alone.wear_volume == among.wear_volume
    assert alone.error("wear_volume", RADII) == among.error("wear_volume", RADII)
    np.testing.assert_array_equal(alone.height(RADII), among.height(RADII))


@pytest.mark.parametrize(("exponent", "radius", "volume"), [(2.0, np.sqrt(2), np.pi), (1.0, np.pi / 2, np.pi**3 / 12)])
def test_gross_slip_at_constant_depth_ends_in_the_free_body(exponent, radius, volume):
    early, late = exact(PowerProfile(exponent), 0.0, [1.0, 30.0], accuracy=1e-4)
    assert late.contact_radius == pytest.approx(radius, abs=1e-4)
    assert late.wear_volume == pytest.approx(volume, abs=1e-4)
    shape = (
        2.0
        * np.pi
        * 3.0
        * (early.height(SLID) - SLID**exponent / power_factor(exponent))
        @ (SLID * np.full(2000, 1.0 / 2000))
    )
    assert early.wear_volume == pytest.approx(shape, abs=2e-4)  # the midpoint rule


def test_gross_slip_at_constant_force_wears_force_times_path():
    slid = exact(PARABOLA, 0.0, [3.0], constant_force=True, accuracy=1e-3)[0]
    assert slid.normal_force == pytest.approx(4 / 3, rel=1e-5)
    assert slid.wear_volume == pytest.approx(4.0, rel=1e-3)
    assert slid.depth > 1.0
