"""Shift factors of planted families: recovered, within intervals, independent of order and reference."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.solvers.curves import of_a_polymer
from mdr_dask.errors import DataError
from mdr_dask.physics.superposition.master_curve import interpolation_error, rereference, superpose


def sigmoid(x):
    return 2 * np.tanh(x / 2)


def family(seed, noise=0.01, curves=6, points=15, shape=sigmoid, rise=0.0):
    """Pieces of one curve, two decades wide, 0.2 to 0.6 decades apart; the middle one is the reference."""
    random = np.random.default_rng(seed)
    shifts = np.append(0, np.cumsum(random.uniform(0.2, 0.6, curves - 1)))
    shifts -= shifts[curves // 2]
    heights = rise * (np.arange(curves) - curves // 2)
    x = np.linspace(-1, 1, points)
    pieces = [
        (x, shape(x + shift) - height + noise * random.standard_normal(points))
        for shift, height in zip(shifts, heights, strict=True)
    ]
    return np.arange(curves, dtype=float), pieces, shifts, heights


def test_exact_curves_give_exact_factors():
    groups, curves, shifts, _ = family(1, noise=0.0)
    result = superpose(groups, curves)
    np.testing.assert_allclose(result.horizontal, shifts, atol=2e-3)  # the spline's own error
    assert result.reference == 3.0
    assert result.horizontal[3] == result.horizontal_error[3] == 0


def test_a_melt_is_shifted_by_both_moduli_with_b_t_and_offsets():
    """Horizontally alone, G' of such curves gives intervals that miss by several half widths."""
    kelvins, curves, factors, _ = of_a_polymer(3, np.random.default_rng((3, 1)))
    both = superpose(kelvins, curves, "modulus")
    low, high = both.interval()[:, : factors.size]
    assert np.all((low - (high - low) / 2 <= factors) & (factors <= high + (high - low) / 2))
    assert np.median(high - low) / 2 < 0.06
    assert both.curve_y.shape == both.curve_error.shape == (2, both.curve_x.size)
    b_t = np.log10(300 / kelvins * (1 + 6e-4 * (kelvins - 300)))
    np.testing.assert_allclose(both.vertical, b_t, atol=0.06)
    compliance = superpose(kelvins, [(x, -y[:1]) for x, y in curves], "compliance")
    np.testing.assert_allclose(compliance.vertical, -b_t, atol=0.06)


def test_rereferencing_is_fitting_with_another_reference():
    groups, curves, _, _ = family(5)
    free = superpose(groups, curves)
    moved, direct = rereference(free, 2.0), superpose(groups, curves, reference=2.0)
    np.testing.assert_allclose(moved.horizontal, direct.horizontal, atol=1e-12)
    np.testing.assert_allclose(moved.draws, direct.draws, atol=1e-12)
    with pytest.raises(DataError, match="expected a reference between 0 and 5, got 10"):
        rereference(moved, 10.0)


def test_a_reference_between_groups_contains_the_error_of_the_interpolation():
    groups, curves, _, _ = family(5)
    found = superpose(groups, curves)
    draws = found.draws * 0 + np.append(0.5 * groups**2, groups * 0)
    free = replace(found, horizontal=0.5 * groups**2, draws=draws)
    plain = rereference(free, 2.5)
    errors = [interpolation_error(groups, free.horizontal, place) for place in (2.0, 2.1, 2.5, 2.9, 3.0)]
    assert errors == pytest.approx([0, 0.09 / 2, 1 / 8, 0.09 / 2, 0])
    assert plain.horizontal_error[0] == pytest.approx(1 / 8, rel=0.01)
    assert plain.horizontal[2] == pytest.approx(2 - (2 + 4.5) / 2)
    by_law = rereference(free, 2.5, law=0.5 * groups**2, at_reference=0.5 * 2.5**2)
    np.testing.assert_allclose(by_law.horizontal, 0.5 * groups**2 - 0.5 * 2.5**2, atol=1e-12)
    assert by_law.horizontal_error.max() < 1e-12


def test_merged_curve_reaches_beyond_what_was_measured():
    groups, curves, shifts, _ = family(6)
    result = superpose(groups, curves)
    assert result.measured == pytest.approx((-1, 1))
    assert result.curve_x[0] == pytest.approx(-1 + shifts[0], abs=0.05)
    assert result.curve_x[-1] == pytest.approx(1 + shifts[-1], abs=0.05)
    inside = np.abs(result.curve_y[0] - sigmoid(result.curve_x))
    assert np.mean(inside < 3 * result.curve_error[0] + 0.005) > 0.95


@pytest.mark.parametrize("vertical", ["none", "free"])
def test_the_band_does_not_depend_on_the_way_to_the_reference(vertical):
    groups, curves, _, _ = family(7, rise=0.02)
    first = superpose(groups, curves, vertical, reference=0.0)
    one, other = rereference(first, 3.0), rereference(rereference(first, 4.0), 3.0)
    np.testing.assert_allclose(one.curve_error, other.curve_error, rtol=1e-6)
    np.testing.assert_allclose(one.curve_cross, other.curve_cross, atol=1e-9)


def pieces_of_a_line(*places):
    x = np.linspace(0.0, 1.0, 20)
    return [(x, x + place) for place in places]


@pytest.mark.parametrize(
    ("groups", "curves", "message"),
    [
        ([1.0], [([0, 1], [0, 1])], "two or more curves with different groups, got 1 curves"),
        ([1.0, 1.0], [([0, 1], [0, 1])] * 2, "with different groups, got 2 curves"),
        ([1.0, 2.0], [([0, 1], [0, 1]), ([0], [1])], "the curve at 2 needs two or more distinct points"),
        ([1.0, 2.0], [([0, 1], [0, 1]), ([0, 1], [1, np.nan])], "the curve at 2 needs"),
        ([1.0, 2.0], [([0, 1, 2], [3, 3, 3]), ([0, 1, 2], [4, 4, 4])], "expected curves that vary"),
    ],
)
def test_tables_that_cannot_be_superposed_are_refused(groups, curves, message):
    with pytest.raises(DataError, match=message):
        superpose(groups, curves)


def test_curves_beyond_a_gap_are_not_determined():
    assert superpose([10.0, 20.0, 30.0], pieces_of_a_line(0.0, 0.5, 3.0)).undetermined == ((20.0, 30.0),)


def test_many_kinds_of_tables_have_finite_bars():
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
        result = superpose(np.arange(curves), [(x, y - away) for x, y in table], "free")
        assert np.all(np.isfinite(result.covariance))
        assert np.count_nonzero(result.vertical_error) == curves - 1
