"""Benchmarks of all solvers: random cases, solutions by our and by other methods, and references."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))  # contains the slow reference solvers

from benchmarks.solvers import curves, lubrication, revolution, sliding, transients

SOLVERS = {
    solver.name: solver
    for module in (sliding, transients, lubrication, revolution, curves)
    for solver in module.SOLVERS
}
