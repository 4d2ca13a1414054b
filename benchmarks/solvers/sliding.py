"""Benchmarks of steady sliding. The reference follows one element along a line, on grids refined until they agree."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from references import slow_friction as slow

from benchmarks.solvers.hard_lines import FAMILIES, samples
from benchmarks.solvers.solver import Found, Solver, Truth
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.problem import PronyTerms, Request, solve
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.shapes import PowerLaw
from mdr_dask.physics.surfaces.waves import Waves, waves_of

MODES = 64
AGREED, WORK = 1e-6, 2**21  # for the reference: allowed change between grids; largest product of cells and Prony terms
DOUBT = 1e-3  # cases in which the reference has a larger relative error are left out


class Sliding(NamedTuple):
    """A case of steady sliding.

    `nodes` returns the heights at nodes. `terms` is None for a Kelvin solid. `deborah` is that of the dashpot.
    """

    line: RoughLine
    nodes: Callable[[int], np.ndarray]
    terms: PronyTerms | None
    deborah: float
    load: float

    def found(self, request: Request) -> Found | None:
        """Return the coefficient of friction, in units of height over length, and its error."""
        steady, errors = solve(self.line, self.terms, np.array([self.deborah]), np.array([self.load]), request)
        if steady.status[0] != Outcome.CONVERGED:
            return None
        return Found(steady.drag[0] / self.load, errors[0, 0] / self.load)


def generated(random: np.random.Generator) -> tuple[RoughLine, Callable[[int], np.ndarray]]:
    """Return a generated line with a random Hurst exponent, and a function for its heights at nodes."""
    amplitude, phase = roughness.amplitudes(MODES, random.uniform()), random.uniform(0, 2 * np.pi, MODES)
    return RoughLine(Waves(0.5 * amplitude * np.exp(1j * phase), 2 * MODES)), slow.waves(amplitude, phase)


def power(random: np.random.Generator, low: float, high: float) -> float:
    """Return a random number between 10^low and 10^high, uniform in its logarithm."""
    return float(10 ** random.uniform(low, high))


def known(line, nodes, terms: PronyTerms | None, deborah: float, depth: float) -> tuple[Sliding, Truth] | None:
    """Return the case with this depth and the friction of the reference; None if the reference is not accurate."""
    moduli, times = (np.array(terms.moduli), np.array(terms.deborah)) if terms else (np.empty(0), np.empty(0))
    body = slow.Body(moduli, times, deborah)
    exact = slow.reference(nodes, depth, body, line.body is None, AGREED, WORK)
    if exact is None or exact.doubt > DOUBT:
        return None
    truth = Truth(exact.friction, exact.doubt * exact.friction, exact.friction)
    return Sliding(line, nodes, terms, deborah, exact.load), truth


def on_plane(low: float, high: float, random: np.random.Generator):
    """Draw a Kelvin solid on a generated line, at a depth between `low` and `high` rms heights."""
    line, nodes = generated(random)
    deborah = power(random, -1.5, 0.5) / line.roughness.rms_slope()
    return known(line, nodes, None, deborah, random.uniform(low, high))


def on_indenter(rough: bool, random: np.random.Generator):
    """Draw a Kelvin solid under an indenter of a power-law shape, smooth or rough."""
    line, roughly = generated(random)
    exponent, half = random.uniform(1, 6), power(random, -1.5, -0.7)
    steepness = power(random, -1, 1) * line.roughness.rms_slope() / (exponent * half ** (exponent - 1))

    def nodes(count: int) -> np.ndarray:
        return rough * roughly(count) - steepness * np.abs(np.linspace(-0.5, 0.5, count)) ** exponent

    waves = line.roughness if rough else Waves(np.zeros(MODES, complex), 2 * MODES)
    deborah = power(random, -2, 0) * half
    return known(RoughLine(waves, PowerLaw(steepness, exponent)), nodes, None, deborah, steepness * half**exponent)


def general(count: int | None, random: np.random.Generator):
    """Draw a solid of one to five Prony terms, or of `count` terms over twenty decades, on a generated line."""
    line, nodes = generated(random)
    if count:
        terms = PronyTerms(tuple(10 ** random.uniform(-1, 1, count)), tuple(np.geomspace(1e-16, 1e4, count)))
        return known(line, nodes, terms, 0.0, random.uniform(-1, 2))
    number = random.integers(1, 6)
    moduli, times = 10 ** random.uniform(-2, 2, number), np.sort(10 ** random.uniform(-5, 2, number))
    dashpot = power(random, -5, 0) if random.uniform() < 0.3 else 0.0
    return known(line, nodes, PronyTerms(tuple(moduli), tuple(times)), dashpot, random.uniform(-1, 2))


def measured(general: bool, random: np.random.Generator):
    """Draw a line that is difficult for a Fourier series, with a Kelvin solid or a solid of Prony terms."""
    height = samples(str(random.choice([name for name in FAMILIES if name != "odd"])), random)
    line, deborah, terms = RoughLine(waves_of(height)), 0.0, None
    if general:
        number = random.integers(1, 5)
        terms = PronyTerms(
            tuple(10 ** random.uniform(-2, 2, number)), tuple(np.sort(10 ** random.uniform(-5, 2, number)))
        )
    else:
        deborah = power(random, -3, 1.5) / line.roughness.rms_slope()
    return known(
        line, slow.samples(height), terms, deborah, random.uniform(-0.5, 1) - height.min() * random.uniform() ** 3
    )


def to(*accuracies: float) -> dict[str, Callable[[Any], Found | None]]:
    """Return the method of the models, for several accuracies."""
    return {f"{accuracy:g}": partial(Sliding.found, request=Request(accuracy)) for accuracy in accuracies}


def on_grids(scheme, *grids: int) -> dict[str, Callable[[Any], Found | None]]:
    """Return a scheme for a Kelvin solid, on several grids."""
    return {f"grid {grid}": partial(Sliding.found, request=Request(1.0, grid, scheme)) for grid in grids}


SOLVERS = (
    Solver(
        "steady friction",
        {
            "transition": partial(on_plane, -0.5, 2),
            "full contact": partial(on_plane, 5, 10),
            "few peaks": partial(on_plane, -2.2, -1),
        },
        {
            "accuracy": to(0.1, 0.01, 0.001, 1e-4),
            "time steps of a cell (thesis)": on_grids("backward_euler", 1, 4, 16),
        },
    ),
    Solver(
        "indenters",
        {"smooth": partial(on_indenter, False), "rough": partial(on_indenter, True)},
        {"accuracy": to(0.1, 0.01, 0.001)},
    ),
    Solver(
        "general solids",
        {"1 to 5 terms": partial(general, None), "50 terms, 20 decades": partial(general, 50)},
        {"accuracy": to(0.1, 0.01, 0.001)},
    ),
    Solver(
        "measured lines",
        {"Kelvin solid": partial(measured, False), "1 to 4 Prony terms": partial(measured, True)},
        {"accuracy": to(0.1, 0.01, 0.001)},
    ),
)
