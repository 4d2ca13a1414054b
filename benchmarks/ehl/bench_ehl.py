"""Time of the line contact's film, whole and by part.

Run with ``pytest benchmarks/ehl/bench_ehl.py --benchmark-only``.
"""

import numpy as np
import pytest

from mdr_dask.models.base import Block
from mdr_dask.models.ehl_line import MODEL, EhlLineParameters
from mdr_dask.physics.lubrication.deformation import influence_matrix
from mdr_dask.physics.lubrication.line_contact import line_contact, solve_film
from mdr_dask.physics.outcome import Outcome

E_STAR = 115.385e9
CASES = {
    "checked": (2.0452e-5, 1e-11, 5007.0),
    "rigid": (2e-6, 1e-9, 500.0),
    "soft": (5e-4, 1e-13, 500.0),
    "heavy": (5e-4, 1e-11, 8000.0),
}


@pytest.mark.parametrize("name", CASES)
def test_film_to_a_thousandth(benchmark, name):
    case = line_contact(CASES[name], E_STAR)
    found = benchmark(solve_film, case, 1e-3)
    assert found.outcome == Outcome.CONVERGED
    assert found.error <= 1e-3


def test_film_to_a_ten_thousandth(benchmark):
    case = line_contact(CASES["checked"], E_STAR)
    found = benchmark.pedantic(solve_film, (case, 1e-4), rounds=3, warmup_rounds=1)
    assert found.error <= 1e-4


@pytest.mark.parametrize("count", [161, 321, 641])
def test_influence_matrix(benchmark, count):
    nodes = np.linspace(-4, 2, count)
    assert benchmark(influence_matrix, nodes).shape == (count, count)


def test_block_of_25_loads_and_speeds(benchmark):
    W, U = (grid.ravel() for grid in np.meshgrid(np.geomspace(2e-6, 5e-4, 5), np.geomspace(1e-13, 1e-9, 5)))
    parameters = EhlLineParameters(load_parameter=1e-5, speed_parameter=1e-11, material_parameter=5000.0)
    block = Block(
        parameters, {"load_parameter": W, "speed_parameter": U}, 25, (0,), 1, ("central_film", "minimum_film")
    )
    assert np.all(benchmark(MODEL.compute, block).status == 1)
