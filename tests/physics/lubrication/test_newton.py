"""The Newton iteration: its laws, its derivatives and the complementarity of its result."""

from __future__ import annotations

import numpy as np
import pytest

from mdr_dask.physics.lubrication import oil
from mdr_dask.physics.lubrication.newton import (
    Grid,
    Imbalance,
    Iterate,
    Liquid,
    Pace,
    _mobility,
    balance,
    film_on,
    log_viscosity_at,
    newton,
)
from mdr_dask.physics.outcome import Outcome

BARUS = Liquid(8.0, 0.0, 0.0, 0.3, 0.9)
ROELANDS = Liquid(8.0, 0.4, 0.6, 0.3, 0.9)


def test_laws_are_those_of_the_oil() -> None:
    p0, viscosity, alpha = 0.5e9, 0.08, 1.8e-8
    z = alpha * oil.ROELANDS_PRESSURE / (np.log(viscosity) + oil.ROELANDS_LOGARITHM)
    for liquid, law in (
        (Liquid(alpha * p0, 0.0, 0.0, 0.0, 0.0), oil.barus),
        (Liquid(alpha * p0, oil.ROELANDS_PRESSURE / p0, z, 0.0, 0.0), oil.roelands),
    ):
        for P in (0.0, 0.2, 1.0):
            value, slope = log_viscosity_at(P, liquid)
            assert value == pytest.approx(
                float(np.log(law(P * p0, viscosity, alpha) / viscosity)), rel=1e-12, abs=1e-14
            )
            difference = log_viscosity_at(P + 1e-6, liquid)[0] - value
            assert slope == pytest.approx(difference / 1e-6, rel=1e-5)  # forward difference


@pytest.mark.parametrize(("left", "right"), [(0.0, 3.0), (5.0, 1.0), (2.0, 2.0005), (30.0, 90.0), (1.0, 1.0)])
def test_mobility_is_the_mean_over_an_exponential(left: float, right: float) -> None:
    mean, by_left, by_right = _mobility(left, right)
    share = (np.arange(2000) + 0.5) / 2000
    assert mean == pytest.approx(np.mean(np.exp(-(left + share * (right - left)))), rel=1e-3)  # midpoint rule
    step = 1e-6
    assert by_left == pytest.approx(
        (_mobility(left + step, right)[0] - _mobility(left - step, right)[0]) / (2 * step), rel=1e-5
    )
    assert by_right == pytest.approx(
        (_mobility(left, right + step)[0] - _mobility(left, right - step)[0]) / (2 * step), rel=1e-5
    )


@pytest.mark.parametrize("liquid", [BARUS, ROELANDS])
def test_derivatives_of_the_balance_are_its_differences(liquid: Liquid) -> None:
    nodes = np.array([-3.0, -2.0, -1.2, -0.9, -0.5, 0.0, 0.4, 0.8, 1.1, 1.6])
    n = nodes.size
    P = 0.4 * np.sqrt(np.maximum(1.3 - nodes**2 / 8, 0))
    P[[0, -1]] = 0.0
    H = 0.3 + 0.1 * nodes**2

    def balances(P: np.ndarray, H: np.ndarray) -> tuple[np.ndarray, ...]:
        found = Imbalance(np.empty(n), np.empty((n, 4)), np.empty((n, 4)))
        balance(nodes, liquid, 0.2, P, H, np.empty((4, n)), found)
        return found

    _, by_pressure, by_film = balances(P, H)
    for j in range(n):
        step = 1e-6 * np.eye(n)[j]
        numeric_P = (balances(P + step, H)[0] - balances(P - step, H)[0]) / 2e-6
        numeric_H = (balances(P, H + step)[0] - balances(P, H - step)[0]) / 2e-6
        for i in range(n):
            inside = 0 <= j - i + 2 < 4
            assert numeric_P[i] == pytest.approx(by_pressure[i, j - i + 2] if inside else 0.0, rel=1e-6, abs=1e-7)
            assert numeric_H[i] == pytest.approx(by_film[i, j - i + 2] if inside else 0.0, rel=1e-6, abs=1e-7)


GRID = Grid.of(np.linspace(-6, 2, 161))


def _uniform_case(most: int, liquid: Liquid = BARUS, K: float = 0.2) -> Iterate:
    guess = np.sqrt(np.maximum(1 - GRID.nodes**2, 0))
    return newton(GRID, liquid, K, guess, 3 * K, Pace(0.12, most, 1e-10))


def test_result_is_complementary_and_carries_the_load() -> None:
    found = _uniform_case(60)
    assert found.outcome == Outcome.CONVERGED
    P, H, n = found.pressure, found.film, GRID.nodes.size
    assert np.array_equal(film_on(GRID, P, found.central), H)
    assert H.min() > 0
    R = np.empty(n)
    balance(GRID.nodes, BARUS, 0.2, P, H, np.empty((4, n)), Imbalance(R, np.empty((n, 4)), np.empty((n, 4))))
    carrying = P > 0
    carrying[[0, -1]] = False
    assert np.max(np.abs(R[carrying])) < 1e-9  # the step was below 1e-10 of the pressure
    assert np.all(R[~carrying][1:-1] <= 0)
    assert P.min() >= 0
    assert 0.05 * P.sum() == pytest.approx(np.pi / 2, rel=1e-12)


def test_failures_are_values() -> None:
    assert _uniform_case(2).outcome == Outcome.TOO_MANY_STEPS
    coarse = _uniform_case(60, Liquid(0.0, 0.0, 0.0, 0.0, 0.0), 1e-4)  # far too coarse
    assert coarse.outcome == Outcome.FILM_COLLAPSED
