"""Breakthrough of a boundary layer: exact cases, brute force, statistics of Gaussian lines, the thesis's rig."""

import numpy as np
import pytest
from scipy.special import ndtr

from mdr_dask.physics.lubrication import breakthrough as bt
from mdr_dask.physics.lubrication import film_formulas as film
from mdr_dask.physics.lubrication import oil
from mdr_dask.physics.lubrication.clusters import find_clusters, total
from mdr_dask.physics.surfaces.splines import through_heights

E_STAR = 210e9 / (2 * (1 - 0.3**2))
STRENGTH = float(bt.layer_strength(1e6, E_STAR, 5e-9))
PERIMETER = 2 * np.pi * 0.05


def rough_line(points, lowest, highest, hurst, seed, rms=1.0):
    """A Gaussian-phase line with harmonics lowest..highest, independent of the package's generator."""
    generator = np.random.default_rng(seed)
    k = np.arange(lowest, highest + 1)
    amplitude = k ** (-hurst - 0.5)
    amplitude = amplitude * rms / np.sqrt(np.sum(amplitude**2) / 2)
    spectrum = np.zeros(points // 2 + 1, complex)
    spectrum[lowest : highest + 1] = amplitude * np.exp(2j * np.pi * generator.random(k.size)) * points / 2
    return np.fft.irfft(spectrum, points), amplitude, k


def clusters_of(line, level, spacing=1.0, strength=1e-3):
    """Clusters of the spline through heights at equal places."""
    return find_clusters(through_heights(line), level, spacing, strength)


def test_clusters_of_a_wave():
    """Where cos x is above 0.4, and its integral there; a spline errs at fourth order."""
    edge = np.arccos(0.4)
    truth, errors = np.array([-edge, edge, 2 * (np.sin(edge) - 0.4 * edge)]), []
    for points in (12, 24, 48):
        step = 2 * np.pi / points
        found = clusters_of(np.cos(step * (np.arange(points) - points // 4)), 0.4)
        assert (found.points, found.start.size, found.closed) == (points, 1, False)
        places = np.array([found.start[0], found.end[0]]) - points // 4
        errors.append(np.abs(step * np.append(places, found.total[0]) - truth))
    assert np.all(errors[2] < 4e-6)
    assert np.all(errors[0] / errors[2] > 60)


def test_the_integral_of_a_closed_line_does_not_depend_on_where_it_is_closed():
    """Ends before, on and after the seam, and in the first cell beyond it."""
    line = np.random.default_rng(3).normal(size=40)
    for end in (38.5, 39.0, 39.6, 40.0, 40.3, 41.0, 42.7):
        turned = total(find_clusters(through_heights(np.roll(line, -20)), 0.0, 1.0, 1.0).overlap, 14.5, end - 20)
        assert total(find_clusters(through_heights(line), 0.0, 1.0, 1.0).overlap, 34.5, end) == pytest.approx(turned)


def test_a_line_wholly_in_contact_is_one_cluster():
    found = clusters_of(np.full(8, 2.0), 1.0, strength=1e-9)
    assert ((found.end - found.start).tolist(), found.closed) == ([8], True)
    assert bt.contact_lengths(found, 3.0).tolist() == [3 * bt.PARTS] * 8


def test_a_parabolic_asperity_breaks_if_its_curvature_exceeds_twelve_strengths():
    """pi tau0/(E* h_c) is the critical curvature whatever the indentation; a spline is exact for a parabola."""
    spacing = 1e-8
    x = spacing * (np.arange(201) - 100)
    for width_points in (0.3, 20.1, 80.1):
        for factor, broken in ((1 - 1e-6, False), (1 + 1e-6, True)):
            curvature = 12 * STRENGTH * factor
            depth = curvature / 2 * (width_points / 2 * spacing) ** 2
            found = clusters_of(depth - curvature * x**2 / 2, 0.0, spacing, STRENGTH)
            np.testing.assert_allclose(found.end - found.start, width_points, rtol=1e-6)
            assert (found.total > found.limit * (found.end - found.start) ** 3).tolist() == [broken]


def test_sliding_equals_judging_every_window():
    """Thousands of random windows: random lines, films, windows, shorter and longer than clusters."""
    generator = np.random.default_rng(5)
    contacts = 0
    for seed in range(16):
        points = int(generator.integers(200, 400))
        line = through_heights(rough_line(points, 1, points // int(generator.integers(2, 6)), 0.5, seed)[0])
        level, window = generator.uniform(-1.5, 1.5), generator.uniform(0.3, points / 3)
        strength = 10 ** generator.uniform(-4, -1)
        fast = bt.contact_lengths(find_clusters(line, level, 1.0, strength), window)
        every = np.arange(points)
        slow = bt.judge_windows(bt.Pair(line, np.zeros(points), level, 1.0, strength), window, (every, every))
        np.testing.assert_array_equal(fast, slow)
        contacts += int((fast > 0).sum())
    assert contacts > 1000


def point_by_point(line, level, limit, window):
    """Return whether a window is in contact, and the mean number of its points that are, as the thesis counts them.

    A cluster of n points breaks if the sum of their overlaps exceeds ``limit n^3``; windows begin at every point.
    """
    points = line.size
    overlap = np.tile(line - level, 2)
    lengths = np.zeros(points)
    for p in range(points):
        inside = overlap[p : p + window]
        ends = np.flatnonzero(np.diff(np.concatenate([[0], inside > 0, [0]])))
        for a, b in ends.reshape(-1, 2):
            lengths[p] += b - a if inside[a:b].sum() > limit * (b - a) ** 3 else 0
    return np.mean(lengths > 0), np.mean(lengths)


def test_splines_have_the_limit_of_the_thesis_s_points():
    """Lines of ten waves on 200 nodes against the thesis's sums over 6000 points of the same waves."""
    generator = np.random.default_rng(3)
    many, few, window, strength = 6000, 200, 0.15, 6.0  # window and strength over the length of the line
    errors, probabilities = [], []
    for _ in range(9):
        spectrum = np.exp(2j * np.pi * generator.uniform(size=10)) / np.arange(1, 11) ** 1.2
        lines = [np.real(np.fft.ifft(np.append(0, spectrum), points)) * points for points in (many, few)]
        truth = point_by_point(lines[0], 0.4, strength / many**2, round(window * many))
        found = bt.contact_lengths(clusters_of(lines[1], 0.4, 1 / few, strength), window * few)
        probabilities.append(truth[0])
        errors.append([np.mean(found > 0) - truth[0], np.mean(found) / bt.PARTS / few - truth[1] / many])
    assert 0.03 < np.mean(probabilities) < 0.9
    assert np.max(np.abs(errors)) < 2 / few
    assert np.max(np.abs(np.median(errors, axis=0))) < 0.5 / few


@pytest.mark.slow
def test_geometric_length_of_a_gaussian_line():
    """With a layer of no strength every overlap counts: E[L] = 2 a Q(Lambda)."""
    window, values = 500, []
    for seed in range(24):
        line, _, _ = rough_line(100_000, 40, 5000, 0.7, seed)
        values.append(bt.contact_lengths(clusters_of(line, 1.5, 1.0, 0.0), window).mean() / bt.PARTS / window)
    mean, error = np.mean(values), np.std(values, ddof=1) / np.sqrt(24)
    assert error < 0.02 * mean
    assert abs(mean - ndtr(-1.5)) < 4 * error


def rig_case(force, rpm, celsius):
    """Film thickness and half width of the thesis's rig."""
    data, temperature = oil.OILS["mobilgear_shc_xmp_320"], celsius + 273.15
    velocity = 2 * np.pi * rpm / 60 * 0.05
    groups = film.dimensionless_groups(
        force / 0.01, data.dynamic(temperature), velocity, data.alpha(temperature), E_STAR, 0.025
    )
    half_width = float(film.hertz_line(force / 0.01, E_STAR, 0.025).half_width)
    return float(film.PAN_HAMROCK_CENTRAL(*groups)) * 0.025, half_width


def rig_line(points, seed, cut=100_000):
    """Two rollers of 0.2 um rms in one line; the longest wavelength is 2a at 1600 N."""
    _, longest = rig_case(1600, 100, 60)
    lowest = int(np.ceil(PERIMETER / (2 * longest)))
    return rough_line(points, lowest, cut, 0.7, seed, rms=0.2e-6 * np.sqrt(2))[0]


def rig_probability(line, case):
    h0, half_width = rig_case(*case)
    spacing = PERIMETER / line.size
    return float((bt.contact_lengths(clusters_of(line, h0, spacing, STRENGTH), 2 * half_width / spacing) > 0).mean())


CHECKED = {
    (100, 100, 60): 2.87,
    (200, 100, 60): 7.43,
    (400, 100, 60): 17.0,
    (800, 100, 60): 33.5,
    (1600, 100, 60): 54.9,
    (800, 100, 40): 0.30,
    (800, 100, 50): 8.71,
    (800, 100, 80): 71.7,
}


def test_probabilities_of_the_rig():
    """The checked table has 16 realisations, this test 6: the difference of the two means has both errors."""
    values = 100 * np.array(
        [[rig_probability(line, case) for case in CHECKED] for line in map(rig_line, [10**6] * 6, range(6))]
    )
    spread = values.std(axis=0, ddof=1)
    error = spread * np.sqrt(1 / 6 + 1 / 16)
    assert np.all(np.abs(values.mean(axis=0) - list(CHECKED.values())) < 4 * error)
    assert np.all(error < 1.0)
