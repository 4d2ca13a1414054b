"""Deformation by a piecewise linear pressure: against quadrature, Hertz' closed form and translation."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.integrate import quad

from mdr_dask.physics.lubrication.deformation import film, influence_matrix

ROUNDING = 1e-12


def test_one_hat_against_quadrature() -> None:
    nodes = np.array([-1.0, -0.3, 0.1, 1.2])
    points = np.array([-2.0, -0.3, 0.05, 0.7, 1.2])
    found = film(points, nodes, np.array([0.0, 1.0, 0.0, 0.0]), 0.0) - 0.5 * points**2

    def integral(point: float) -> float:
        def weighted(s: float) -> float:
            return float(np.interp(s, nodes, [0.0, 1.0, 0.0, 0.0]) * np.log(abs(point - s)))

        breaks = sorted({-1.0, -0.3, 0.1} | ({point} if -1 < point < 0.1 else set()))
        return sum(quad(weighted, a, b, limit=200)[0] for a, b in pairwise(breaks))

    expected = [-(integral(x) - integral(0.0)) / np.pi for x in points]
    # quad reaches about 1e-9 at the logarithm
    np.testing.assert_allclose(found, expected, atol=1e-8)


def test_influence_at_the_nodes_is_that_of_every_hat_there() -> None:
    nodes = np.array([-1.0, -0.3, 0.1, 0.15, 1.2])
    matrix = influence_matrix(nodes)
    for j in range(1, 4):
        np.testing.assert_allclose(matrix[:, j], film(nodes, nodes, np.eye(5)[j], 0.0) - 0.5 * nodes**2, atol=ROUNDING)
    assert not matrix[:, [0, -1]].any()


def test_hertz_pressure_flattens_the_parabola_at_second_order_or_better() -> None:
    errors = []
    for count in (101, 201):
        nodes = -np.cos(np.linspace(0, np.pi, count))
        pressure = np.sqrt(np.maximum(1 - nodes**2, 0))
        inside = np.linspace(-0.9, 0.9, 37)
        errors.append(np.max(np.abs(film(inside, nodes, pressure, 0.0))))
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] > 3.9


def test_gap_outside_a_dry_contact() -> None:
    nodes = -np.cos(np.linspace(0, np.pi, 801))
    x = np.array([1.1, 1.5, 3.0])
    gap = film(np.concatenate([-x, x]), nodes, np.sqrt(np.maximum(1 - nodes**2, 0)), 0.0)
    exact = 0.5 * (x * np.sqrt(x**2 - 1) - np.log(x + np.sqrt(x**2 - 1)))
    np.testing.assert_allclose(gap, np.tile(exact, 2), atol=1e-5)  # second order in 1/800


def test_differences_do_not_depend_on_the_origin() -> None:
    nodes = np.array([-1.0, -0.5, 0.0, 0.3, 1.0])
    here = influence_matrix(nodes)
    there = influence_matrix(nodes + 0.7)
    np.testing.assert_allclose(here - here[2], there - there[2], atol=ROUNDING)
