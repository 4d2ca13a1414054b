"""Steady sliding where the Kelvin solver does not reach: any linear material, on generated or measured lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.base import Block, Result, Status, canonical
from mdr_dask.models.parts.material import Kelvin, Material, fit_error, solid_of
from mdr_dask.models.parts.measured_line import ProfileFile, line_of

if TYPE_CHECKING:
    from mdr_dask.physics.sliding.viscoelastic import ViscoelasticSteady

COARSEST, FINEST = 4, 64  # points for every Nyquist point that `auto` begins and ends with
CELLS = 4  # the solver compares grids of every, every second and every fourth point
NODE_ARM, NODE_LINE = 1e-8, 1e-7  # seconds for every point and arm of a solve, and for every point of a line
SOLVE = 3e-4  # seconds for the recovery modes of three grids


@dataclass(frozen=True)
class Case:
    """A case as the campaign states it.

    Parameters
    ----------
    profile : ProfileFile or None
        A measured line; otherwise the generated one of the numbers below.
    length, points, hurst, rms, rolloff, longest
        Generated line: period and rms height in m, Nyquist points, Hurst exponent, harmonics of its corners.
    body : tuple of float
        Coefficient and exponent of the indenter's line c |x|^n, c = 0 for a plane.
    material, velocity, force
        Material, m/s, N.
    oversampling : int or "auto"
        Points for every Nyquist point.
    """

    profile: ProfileFile | None
    length: float
    points: int
    hurst: float
    rms: float
    rolloff: float
    longest: float
    body: tuple[float, float]
    material: Material
    velocity: float
    force: float
    oversampling: int | str

    @property
    def period(self) -> float:
        """Length of the line, m."""
        return self.length if self.profile is None else line_of(self.profile).length

    @property
    def height(self) -> float:
        """Unit of heights, m: the rms roughness, the period where there is none, one metre for a measured line."""
        return 1.0 if self.profile is not None else self.rms or self.length

    def numbers(self) -> Numbers:
        """Return the case without units; ValueError for a number that is none, others as `solid_of`, `line_of`."""
        given = {"load": self.force, "velocity": self.velocity, "height": self.height, "length": self.period}
        for name, value in given.items():
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"the {name} must be positive and finite, got {value!r}")
        solid, period, height = solid_of(self.material), self.period, self.height
        static, (coefficient, exponent) = solid.static_modulus, self.body
        pace = self.velocity / period
        return Numbers(
            profile=self.profile,
            points=self.points,
            hurst=self.hurst,
            is_rough=self.rms > 0,
            rolloff=self.rolloff,
            longest=self.longest,
            body=(canonical(coefficient * period**exponent / height), exponent),
            moduli=tuple(canonical(modulus / static) for modulus in solid.moduli.tolist()),
            reaches=tuple(canonical(time * pace) for time in solid.times.tolist()),
            viscosity=canonical(solid.viscosity * pace / static),
            load=canonical(self.force / (static * period * height)),
            oversampling=self.oversampling,
        )


@dataclass(frozen=True)
class Numbers:
    """What alone decides a solution, in units of period, height and static modulus; equal ones are solved once.

    Parameters
    ----------
    profile, points, hurst, rolloff, longest, oversampling
        See `Case`.
    is_rough : bool
        Whether a generated line has roughness.
    body : tuple of float
        c L^n / h and n.
    moduli, reaches, viscosity
        G_m / G_inf, tau_m v / L and eta v / (G_inf L).
    load : float
        F_N / (G_inf L h).
    """

    profile: ProfileFile | None
    points: int
    hurst: float
    is_rough: bool
    rolloff: float
    longest: float
    body: tuple[float, float]
    moduli: tuple[float, ...]
    reaches: tuple[float, ...]
    viscosity: float
    load: float
    oversampling: int | str

    @property
    def is_the_same_everywhere(self) -> bool:
        """Whether every realisation gives the same result."""
        return self.profile is not None or not self.is_rough

    def line(self, phases: Callable[[int], FloatArray], oversampling: int) -> FloatArray:
        """Return heights at the nodes."""
        from mdr_dask.physics.surfaces import measured, roughness

        if self.profile is not None:
            line = line_of(self.profile)
            count = -(-line.height.size // CELLS) * CELLS * oversampling
            height = measured.resampled(line.height, count)
        else:
            count = self.points * oversampling
            height = np.zeros(count)
            if self.is_rough:
                amplitude = roughness.amplitudes(self.points // 2, self.hurst, self.rolloff, self.longest)
                height = roughness.line(amplitude, phases(self.points // 2), count)
        coefficient, exponent = self.body
        if coefficient:
            place = (np.arange(count + 1) - count // 2) / count
            height = np.append(height, height[0]) - coefficient * np.abs(place) ** exponent
        return height

    def slope(self) -> float:
        """Return the spectral rms slope of the roughness."""
        from mdr_dask.physics.surfaces import measured, roughness

        if self.profile is not None:
            return measured.rms_slope(line_of(self.profile).height, 1.0)
        if not self.is_rough:
            return 0.0
        return roughness.spectral_slope(roughness.amplitudes(self.points // 2, self.hurst, self.rolloff, self.longest))

    def solve(self, phases: Callable[[int], FloatArray], accuracy: float) -> ViscoelasticSteady:
        """Solve on the grid given, or on the coarsest that meets the accuracy."""
        from mdr_dask.physics.sliding.steady import CONVERGED, NOT_CONVERGED
        from mdr_dask.physics.sliding.viscoelastic import steady_viscoelastic_sliding
        from mdr_dask.physics.solids import prony

        solid = prony(1.0, self.moduli, self.reaches, self.viscosity)
        oversampling = COARSEST if self.oversampling == "auto" else int(self.oversampling)
        while True:
            height = self.line(phases, oversampling)
            cells = height.size - (1 if self.body[0] else 0)
            found = steady_viscoelastic_sliding(height, 1 / cells, solid, 1.0, self.load, self.body[0] == 0)
            enough = found.error <= accuracy or found.status not in (CONVERGED, NOT_CONVERGED)
            if self.oversampling != "auto" or enough or oversampling >= FINEST:
                return found
            oversampling *= 2


def kelvin_material(shear_modulus: float, relaxation_time: float) -> Material:
    """Return the material of a case that names modulus and relaxation time only."""
    return Material(kelvin=Kelvin(shear_modulus=shear_modulus, relaxation_time=relaxation_time))


Solved = tuple[dict[str, float], int, str]


def solve_numbers(case: Numbers, phases: Callable[[int], FloatArray], accuracy: float) -> Solved:
    """Return the outputs without units, the status and a sentence where there is something to say."""
    from mdr_dask.physics.sliding.steady import CONVERGED, MESSAGES, NOT_CONVERGED

    try:
        found = case.solve(phases, accuracy)
        slope = case.slope()
    except (DataError, ValueError) as problem:
        return {}, Status.FAILED, str(problem)
    if found.status != CONVERGED:
        status = Status.NOT_CONVERGED if found.status == NOT_CONVERGED else Status.FAILED
        return {}, status, MESSAGES[found.status].format(iterations=found.sweeps)
    values = {
        "friction_coefficient": found.friction_coefficient,
        "indentation_depth": found.depth,
        "contact_fraction": found.contact_fraction,
        "contact_slope": found.contact_slope,
        "rms_slope": slope,
        "discretisation_error": found.error,
    }
    missed = case.oversampling == "auto" and not found.error <= accuracy
    return values, Status.DONE, f"estimated error {found.error:.1e} on the finest grid" if missed else ""


def compute(block: Block[Any], cases: list[Case], accuracy: float) -> Result:
    """Solve the cases of a block, those of equal numbers once; a measured line is the same in every realisation."""
    from mdr_dask.physics.surfaces import roughness

    shape = (block.cases, len(block.realisations))
    values = {name: np.full(shape, np.nan) for name in block.outputs}
    status = np.full(shape, Status.FAILED, np.int8)
    messages: dict[tuple[int, int], str] = {}
    solved: dict[tuple[Numbers, int], Solved] = {}
    for j, case in enumerate(cases):
        numbers, problem = _numbers(case)
        if numbers is None:
            messages.update({(j, r): problem for r in range(len(block.realisations))})
            continue
        scale = case.height / case.period
        units = {"friction_coefficient": scale, "contact_slope": scale, "rms_slope": scale}
        units["indentation_depth"] = case.height
        for r, realisation in enumerate(block.realisations):
            key = numbers, -1 if numbers.is_the_same_everywhere else realisation
            if key not in solved:
                solved[key] = solve_numbers(numbers, partial(roughness.phases, block.seed, realisation), accuracy)
            found, status[j, r], sentence = solved[key]
            found = {**found, "material_error": fit_error(case.material)} if found else found
            if sentence:
                messages[j, r] = sentence
            for name in block.outputs:
                values[name][j, r] = found.get(name, np.nan) * units.get(name, 1.0)
    return Result(values, status, messages, len(solved))


def _numbers(case: Case) -> tuple[Numbers | None, str]:
    """Return the numbers of a case, or why it has none."""
    try:
        return case.numbers(), ""
    except (DataError, ValueError) as problem:
        return None, str(problem)


def distinct(cases: list[Case], realisations: int) -> int:
    """Return how many different solutions there are, over all realisations."""
    different = dict.fromkeys(_numbers(case)[0] for case in dict.fromkeys(cases))
    return sum(1 if case is None or case.is_the_same_everywhere else realisations for case in different)


def seconds(case: Case) -> float:
    """Estimate the time of one solve."""
    arms = len(case.material.prony.times) + 1 if case.material.prony else 20 if case.material.power_law else 3
    grid = 2 * COARSEST if case.oversampling == "auto" else int(case.oversampling)
    return SOLVE + (NODE_ARM * arms + NODE_LINE) * case.points * grid
