import numpy as np
import pytest
from scipy import stats
from scipy.optimize import least_squares
from scipy.stats import t as student

from mdr_dask.errors import DataError, FitError
from mdr_dask.physics.superposition import factors
from mdr_dask.physics.superposition.laws import fit_arrhenius, fit_power, fit_wlf
from mdr_dask.physics.superposition.least_squares import changes_of
from mdr_dask.physics.superposition.master_curve import rereference, superpose
from mdr_dask.physics.superposition.problem import ShiftProblem


def sigmoid(x):
    return 2 * np.tanh(x / 2)


def family(seed, noise=0.01, curves=10, points=30, shape=sigmoid, rise=0.0):
    """Pieces of one curve, two decades wide, 0.2 to 0.6 decades apart; the fifth is the reference."""
    random = np.random.default_rng(seed)
    shifts = np.append(0, np.cumsum(random.uniform(0.2, 0.6, curves - 1)))
    shifts -= shifts[5]
    heights = rise * (np.arange(curves) - 5)
    x = np.linspace(-1, 1, points)
    pieces = [
        (x, shape(x + shift) - height + noise * random.standard_normal(points))
        for shift, height in zip(shifts, heights, strict=True)
    ]
    return np.arange(curves, dtype=float), pieces, shifts, heights


def test_exact_curves_give_exact_factors():
    groups, curves, shifts, _ = family(1, noise=0.0)
    result = superpose(groups, curves)
    np.testing.assert_allclose(result.horizontal, shifts, atol=2e-4)  # the spline's own error
    assert result.reference == 5.0
    assert result.horizontal[5] == result.horizontal_error[5] == 0


def test_vertical_factors_are_found_too():
    groups, curves, shifts, heights = family(2, noise=1e-3, rise=0.02)
    result = superpose(groups, curves, vertical=True)
    np.testing.assert_allclose(result.vertical, heights, atol=0.03)
    np.testing.assert_allclose(result.horizontal, shifts, atol=0.05)
    assert np.all(np.abs(result.vertical - heights) < 4 * result.vertical_error + 1e-9)


SHAPES = {
    "sigmoid": sigmoid,
    "nearly straight": lambda x: 0.5 * x + 0.02 * x**2,
    "bump": lambda x: np.exp(-(x**2) / 2),
    "power": lambda x: 0.3 * x,
    "plateau": lambda x: -0.2 * np.logaddexp(0, -3 * x),
}


@pytest.mark.parametrize(("shape", "seed", "rise"), [("sigmoid", 3, 0.1), ("bump", 2, 0.02), ("plateau", 3, 0.1)])
def test_rounds_with_vertical_shifts_end_when_no_shift_moves_any_more(shape, seed, rise, monkeypatch):
    """From horizontal shifts alone they move by ten errors and more; where rounds end, the next one moves nothing."""
    moved = []

    def watched(*arguments):
        found = changes_of(*arguments)
        moved.append(np.max(np.abs(found[0]) / np.sqrt(np.diag(found[1]))))
        return found

    _, curves, *_ = family(seed, noise=1e-3, rise=rise, curves=6, shape=SHAPES[shape])
    problem, _ = ShiftProblem.of(curves).from_own_origin()
    level = factors.find_horizontal(problem)
    priors = problem.priors(level.common.mean)
    monkeypatch.setattr(factors, "changes_of", watched)
    found, _ = factors._linear(problem, level, priors)
    assert moved[0] > 10
    assert min(moved[:-1]) >= factors.SETTINGS.settled > moved[-1]
    again, _ = factors._linear(problem, found, priors)
    error = np.sqrt(np.diag(found.covariance))
    changes = np.r_[(again.shifts.across - found.shifts.across)[1:], (again.shifts.along - found.shifts.along)[1:]]
    assert np.all(np.abs(changes) < 0.1 * error)


def inside_their_bars(shape, noise, vertical, seeds, curves=10):
    """Return which factors of families lie within their bars of 68 %, the reference left out.

    A family whose flat end drifts off is refused with a sentence: one in twenty at most.
    """
    covered, refused = [], 0
    for seed in seeds:
        rise = 0.02 if vertical else 0.0
        groups, pieces, shifts, heights = family(seed, noise, curves, shape=SHAPES[shape], rise=rise)
        try:
            result = superpose(groups, pieces, vertical, reference=5.0)
        except DataError:
            refused += 1
            continue
        bars = student.ppf(0.8413, result.freedom) * np.array([result.horizontal_error, result.vertical_error])
        inside = np.abs([result.horizontal - shifts, result.vertical - heights]) <= bars
        covered.extend(np.delete(inside[: 1 + vertical], 5, axis=1).ravel())
    assert refused <= len(seeds) / 20
    return covered


@pytest.mark.parametrize("noise", [0.003, 0.01])
@pytest.mark.parametrize("shape", SHAPES)
def test_bars_of_68_percent_cover_the_truth_60_to_76_percent_of_the_time(shape, noise):
    """40 families of ten curves: 360 factors, whose errors are so correlated that their mean has a standard error of
    3 %; the band is the issue's own."""
    assert 0.60 <= np.mean(inside_their_bars(shape, noise, False, range(2000, 2040))) <= 0.76


def test_bars_with_vertical_factors_cover_the_truth_too():
    """Twelve families of six curves of each shape, 480 factors, whose mean has a standard error of 3 %."""
    shapes = [shape for shape in SHAPES if shape != "power"]  # any horizontal shift of a power law is a vertical one
    covered = [inside_their_bars(shape, 0.01, True, range(2000, 2012), curves=6) for shape in shapes]
    assert 0.60 <= np.mean(covered) <= 0.76


def test_few_points_have_wider_bars():
    """Three curves of six points, 200 families: the scatter has a dozen degrees of freedom."""
    covered = []
    for seed in range(200):
        groups, curves, shifts, _ = family(seed, 0.01, curves=7, points=6)
        three = [3, 4, 5]
        result = superpose(groups[three], [curves[k] for k in three], reference=4.0)
        truth = shifts[three] - shifts[4]
        bars = student.ppf(0.8413, result.freedom) * result.horizontal_error
        covered.extend(np.delete(np.abs(result.horizontal - truth) <= bars, 1))
        assert result.freedom < 18
    assert 0.60 <= np.mean(covered) <= 0.76


def test_bootstrap_agrees_with_the_covariance():
    groups, curves, _, _ = family(3)
    result = superpose(groups, curves, draws=100, seed=1)
    assert result.draws.shape == (100, 20)
    spread = np.delete(result.draws[:, :10].std(axis=0), 5)
    # standard deviation of 100 draws: 7 %; residuals differ from curve to curve
    assert np.median(spread / np.delete(result.horizontal_error, 5)) == pytest.approx(1, abs=0.3)
    again = superpose(groups, curves, draws=100, seed=1)
    assert np.array_equal(result.draws, again.draws)


def test_order_of_curves_and_points_does_not_matter():
    groups, curves, _, _ = family(4)
    backwards = [(x[::-1], y[::-1]) for x, y in curves[::-1]]
    one, other = superpose(groups, curves), superpose(groups[::-1], backwards)
    assert np.array_equal(one.horizontal, other.horizontal)
    assert np.array_equal(one.covariance, other.covariance)


def test_rereferencing_is_fitting_with_another_reference():
    groups, curves, _, _ = family(5)
    moved, direct = rereference(superpose(groups, curves), 2.0), superpose(groups, curves, reference=2.0)
    np.testing.assert_allclose(moved.horizontal, direct.horizontal, atol=1e-12)
    np.testing.assert_allclose(moved.covariance, direct.covariance, atol=1e-14)
    between = rereference(moved, 2.5)
    assert between.horizontal[2] + between.horizontal[3] == pytest.approx(0, abs=1e-12)
    with pytest.raises(DataError, match="must lie between 0 and 9, got 10"):
        rereference(moved, 10.0)


def test_merged_curve_reaches_beyond_what_was_measured():
    groups, curves, shifts, _ = family(6)
    result = superpose(groups, curves)
    assert result.measured == pytest.approx((-1, 1))
    assert result.curve_x[0] == pytest.approx(-1 + shifts[0], abs=0.05)
    assert result.curve_x[-1] == pytest.approx(1 + shifts[-1], abs=0.05)
    inside = np.abs(result.curve_y - sigmoid(result.curve_x))
    assert np.mean(inside < 3 * result.curve_error + 0.005) > 0.95


@pytest.mark.parametrize("vertical", [False, True])
def test_the_band_of_the_merged_curve_covers_it_where_the_reference_was_measured(vertical):
    """Six families of four shapes; a curve has a few independent points, so that the share is known to 0.05."""
    shares = []
    for shape in [shape for shape in SHAPES if shape != "power"]:
        for seed in range(3000, 3006):
            groups, curves, _, _ = family(seed, 0.01, shape=SHAPES[shape], rise=0.02 * vertical)
            result = superpose(groups, curves, vertical, reference=5.0)
            own = (result.curve_x > -1) & (result.curve_x < 1)
            miss = np.abs(result.curve_y - SHAPES[shape](result.curve_x))
            shares.append(np.mean((miss <= result.curve_error)[own]))
    assert 0.60 <= np.mean(shares) <= 0.85


@pytest.mark.parametrize("vertical", [False, True])
def test_the_band_does_not_depend_on_the_way_to_the_reference(vertical):
    groups, curves, _, _ = family(7, rise=0.02)
    first = superpose(groups, curves, vertical, reference=0.0)
    one, other = rereference(first, 5.0), rereference(rereference(first, 8.0), 5.0)
    np.testing.assert_allclose(one.curve_error, other.curve_error, rtol=1e-6)
    np.testing.assert_allclose(one.curve_cross, other.curve_cross, atol=1e-9)
    own = np.abs(one.curve_x) < 1
    assert np.median(one.curve_error[own]) < np.median(one.curve_error[~own])


def pieces_of_a_line(*places):
    x = np.linspace(0.0, 1.0, 20)
    return [(x, x + place) for place in places]


@pytest.mark.parametrize(
    ("groups", "curves", "message"),
    [
        ([1.0], [([0, 1], [0, 1])], "one distinct group for each of two or more curves"),
        ([1.0, 1.0], [([0, 1], [0, 1])] * 2, "one distinct group"),
        ([1.0, 2.0], [([0, 1], [0, 1]), ([0], [1])], "the curve at 2 needs two or more distinct points"),
        ([1.0, 2.0], [([0, 1], [0, 1]), ([0, 1], [1, np.nan])], "the curve at 2 needs"),
        ([10.0, 20.0, 30.0], pieces_of_a_line(0.0, 0.5, 3.0), "the curve at 30 does not overlap the others after"),
        ([10.0, 20.0, 30.0], pieces_of_a_line(0.0, 3.0, 3.5), "the curve at 20 does not overlap the others after"),
    ],
)
def test_tables_that_cannot_be_superposed_are_refused(groups, curves, message):
    with pytest.raises(DataError, match=message):
        superpose(groups, curves)


def test_laws_of_factors_recover_their_constants_within_their_intervals():
    random = np.random.default_rng(0)
    velocities = np.geomspace(1e-3, 1e-1, 12)
    covariance = np.diag(np.r_[0.0, np.full(11, 0.02**2)])
    scatter = np.r_[0.0, 0.02 * random.standard_normal(11)]
    power = fit_power(velocities, -0.15 * np.log10(velocities / 1e-3) + scatter, covariance, 1e-3)
    value, low, high = power.constants["exponent"]
    assert low < -0.15 < high
    assert value == pytest.approx(-0.15, abs=0.03)
    kelvins = np.linspace(280, 350, 12)
    factors = 8e4 / (8.31446261815324 * np.log(10)) * (1 / kelvins - 1 / 280) + scatter
    _, low, high = fit_arrhenius(kelvins, factors, covariance, 280.0).constants["activation_energy"]
    assert low < 8e4 < high
    factors = -17.4 * (kelvins - 280) / (51.6 + kelvins - 280) + scatter
    law = fit_wlf(kelvins, factors, covariance, 280.0)
    assert law.constants["c1"][1] < 17.4 < law.constants["c1"][2]
    assert law.constants["c2"][1] < 51.6 < law.constants["c2"][2]
    assert law.scatter < 0.02


def test_a_law_that_does_not_hold_says_how_far_it_is():
    velocities = np.geomspace(1, 1e4, 9)
    distance = np.log10(velocities)
    law = fit_power(velocities, 0.1 * distance**2, np.diag(np.r_[0.0, np.full(8, 1e-6)]), 1.0)
    assert law.scatter > 0.1
    assert law.residual == pytest.approx(law.scatter, rel=0.5)


def test_laws_refuse_groups_they_do_not_know():
    with pytest.raises(FitError, match="positive groups"):
        fit_power(np.array([-1.0, 1.0]), np.zeros(2), np.zeros((2, 2)), 1.0)
    with pytest.raises(FitError, match="absolute temperatures"):
        fit_arrhenius(np.array([-1.0, 1.0]), np.zeros(2), np.zeros((2, 2)), 1.0)
    with pytest.raises(FitError, match="needs more than 1 shift factors beside the reference, got 0"):
        fit_power(np.array([1.0, 2.0]), np.zeros(2), np.zeros((2, 2)), 1.0)


def test_constant_curves_are_refused():
    with pytest.raises(DataError, match="every curve is constant"):
        superpose([1.0, 2.0], [([0, 1, 2], [3, 3, 3]), ([0, 1, 2], [4, 4, 4])])


def test_vertical_factors_of_many_kinds_of_tables_have_finite_bars():
    """Warnings are errors: from two curves of two points to curves without scatter and axes far from zero."""
    random = np.random.default_rng(0)
    for curves, points, noise, away in (
        (2, 2, 0.01, 0),
        (2, 30, 0.01, 0),
        (4, 3, 0.1, 0),
        (5, 20, 0.0, 0),
        (6, 9, 1e-3, 50),
    ):
        x = np.linspace(-1, 1, points)
        table = [(x + away, sigmoid(x + 0.4 * k) + noise * random.standard_normal(points)) for k in range(curves)]
        result = superpose(np.arange(curves), [(x, y - away) for x, y in table], vertical=True)
        assert np.all(np.isfinite(result.covariance))
        assert np.count_nonzero(result.vertical_error) == curves - 1


@pytest.mark.parametrize("c2", [35.0, 51.6, 300.0])
@pytest.mark.parametrize("scatter", [1e-3, 0.2])
def test_wlf_is_that_of_a_general_least_squares(c2, scatter):
    """Beside scipy with finite differences, at the scatter that the fit found."""
    random, kelvins = np.random.default_rng(3), np.linspace(280, 350, 10)
    distance = kelvins - kelvins[4]
    noise = np.where(distance == 0, 0.0, scatter * random.standard_normal(10))
    factors, known = -9 * distance / (c2 + distance) + noise, distance != 0
    law = fit_wlf(kelvins, factors, np.diag(known * 0.01**2), kelvins[4])
    width = np.hypot(0.01, law.scatter)
    found = least_squares(
        lambda c: (-c[0] * distance / (c[1] + distance) - factors)[known] / width,
        [9.0, c2],
        x_scale=[1, 10],
        xtol=1e-14,
    )
    assert law.constants["c1"][0] == pytest.approx(found.x[0], rel=1e-4)
    assert law.constants["c2"][0] == pytest.approx(found.x[1], rel=1e-4)
    if law.scatter:
        assert 2 * found.cost == pytest.approx(7, rel=5e-3)
    half = student.ppf(0.975, 7) * np.sqrt(np.linalg.inv(found.jac.T @ found.jac)[0, 0])
    assert law.constants["c1"][2] - law.constants["c1"][0] == pytest.approx(half, rel=1e-2)


def test_wlf_of_factors_linear_in_temperature_has_no_upper_end_of_c2():
    kelvins = np.linspace(280, 350, 10)
    factors = -0.1 * (kelvins - 280) - 1e-5 * (kelvins - 280) ** 2  # bent a little the other way
    law = fit_wlf(kelvins, factors, np.diag(np.r_[0.0, np.full(9, 0.02**2)]), 280.0)
    for name in ("c1", "c2"):
        value, low, high = law.constants[name]
        assert 10 < low < value < high == np.inf
    assert law.constants["c1"][1] / law.constants["c2"][1] == pytest.approx(0.1, rel=0.02)
    assert law.residual < 0.03


def test_the_chance_of_a_law_is_that_of_the_errors_alone():
    """Factors 0.03 decades off a law, known to 0.01: chi-squared of the residuals has its probability."""
    groups = np.geomspace(1e-3, 1, 9)
    factors = -0.3 * np.log10(groups) + 0.03 * np.array([0, 1, -1, 1, 1, -1, -1, 1, -1])
    factors -= factors[0]
    covariance = np.diag([0.0] + [0.01**2] * 8)
    found = fit_power(groups, factors, covariance, groups[0])
    distance = np.log10(groups / groups[0])[1:]
    slope = distance @ factors[1:] / (distance @ distance)
    squares = np.sum((factors[1:] - slope * distance) ** 2) / 0.01**2
    assert found.chance == pytest.approx(stats.chi2.sf(squares, 7), rel=1e-6)
    assert found.chance < 1e-6
