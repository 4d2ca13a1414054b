"""Every solver of the package: random cases, solutions to an accuracy and beside other methods, and references."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))  # for the slow references

from benchmarks.solvers import curves, lubrication, revolution, sliding, transients

SOLVERS = {
    solver.name: solver
    for module in (sliding, transients, lubrication, revolution, curves)
    for solver in module.SOLVERS
}
