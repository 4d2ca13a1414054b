"""Steady sliding where the Kelvin solver does not reach: any linear material, on generated or measured lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mdr_dask.errors import DataError
from mdr_dask.models.base import Block, FloatArray, Result, Status
from mdr_dask.models.material import Kelvin, Material, solid_of
from mdr_dask.models.profile_file import ProfileFile, line_of

if TYPE_CHECKING:
    from mdr_dask.physics.viscoelastic_sliding import ViscoelasticSteady

COARSEST, FINEST = 4, 64  # points for every Nyquist point that `auto` begins and ends with
CELLS = 4  # the solver compares grids of every, every second and every fourth point
NODE_ARM, NODE_LINE = 1e-8, 1e-7  # seconds for every point and arm of a solve, and for every point of a line
SOLVE = 3e-4  # seconds for the recovery modes of three grids


@dataclass(frozen=True)
class Case:
    """What decides one solution; equal cases are solved once.

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
    def is_the_same_everywhere(self) -> bool:
        """Whether every realisation gives the same result."""
        return self.profile is not None or self.rms == 0

    def line(self, phases: Callable[[int], FloatArray], oversampling: int) -> tuple[FloatArray, float]:
        """Return heights at the nodes and their distance."""
        from mdr_dask.physics import measured, roughness

        if self.profile is not None:
            line = line_of(self.profile)
            count = -(-line.height.size // CELLS) * CELLS * oversampling
            height, length = measured.resampled(line.height, count), line.length
        else:
            count, length = self.points * oversampling, self.length
            height = np.zeros(count)
            if self.rms > 0:
                amplitude = roughness.amplitudes(self.points // 2, self.hurst, self.rolloff, self.longest)
                height = self.rms * roughness.line(amplitude, phases(self.points // 2), count)
        coefficient, exponent = self.body
        if coefficient:
            place = (np.arange(count + 1) - count // 2) * (length / count)
            height = np.append(height, height[0]) - coefficient * np.abs(place) ** exponent
        return height, length / count

    def slope(self) -> float:
        """Return the spectral rms slope of the roughness."""
        from mdr_dask.physics import measured, roughness

        if self.profile is not None:
            line = line_of(self.profile)
            return measured.rms_slope(line.height, line.length)
        if self.rms == 0:
            return 0.0
        amplitude = roughness.amplitudes(self.points // 2, self.hurst, self.rolloff, self.longest)
        return roughness.spectral_slope(amplitude) * self.rms / self.length

    def solve(self, phases: Callable[[int], FloatArray], accuracy: float) -> ViscoelasticSteady:
        """Solve on the grid given, or on the coarsest that meets the accuracy."""
        from mdr_dask.physics.sliding import CONVERGED, NOT_CONVERGED
        from mdr_dask.physics.viscoelastic_sliding import steady_viscoelastic_sliding

        oversampling = COARSEST if self.oversampling == "auto" else int(self.oversampling)
        while True:
            height, spacing = self.line(phases, oversampling)
            found = steady_viscoelastic_sliding(
                height, spacing, solid_of(self.material), self.velocity, self.force, self.body[0] == 0
            )
            enough = found.error <= accuracy or found.status not in (CONVERGED, NOT_CONVERGED)
            if self.oversampling != "auto" or enough or oversampling >= FINEST:
                return found
            oversampling *= 2


def kelvin_material(shear_modulus: float, relaxation_time: float) -> Material:
    """Return the material of a case that names modulus and relaxation time only."""
    return Material(kelvin=Kelvin(shear_modulus=shear_modulus, relaxation_time=relaxation_time))


def solve_case(case: Case, phases: Callable[[int], FloatArray], accuracy: float) -> tuple[dict[str, float], int, str]:
    """Return the outputs of one case, its status and a sentence where there is something to say."""
    from mdr_dask.physics.sliding import CONVERGED, MESSAGES, NOT_CONVERGED

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
    """Solve the cases of a block, each different one once; a measured line is the same in every realisation."""
    from mdr_dask.physics import roughness

    shape = (block.cases, len(block.realisations))
    values = {name: np.full(shape, np.nan) for name in block.outputs}
    status = np.full(shape, Status.FAILED, np.int8)
    messages: dict[tuple[int, int], str] = {}
    solved: dict[tuple[Case, int], tuple[dict[str, float], int, str]] = {}
    for j, case in enumerate(cases):
        for r, realisation in enumerate(block.realisations):
            key = case, -1 if case.is_the_same_everywhere else realisation
            if key not in solved:
                phases = partial(roughness.phases, block.seed, realisation)
                solved[key] = solve_case(case, phases, accuracy)
            found, status[j, r], sentence = solved[key]
            if sentence:
                messages[j, r] = sentence
            for name in block.outputs:
                values[name][j, r] = found.get(name, np.nan)
    return Result(values, status, messages, len(solved))


def distinct(cases: list[Case], realisations: int) -> int:
    """Return how many different cases there are, over all realisations."""
    return sum(1 if case.is_the_same_everywhere else realisations for case in dict.fromkeys(cases))


def seconds(case: Case) -> float:
    """Estimate the time of one solve."""
    arms = len(case.material.prony.times) + 1 if case.material.prony else 20 if case.material.power_law else 3
    grid = 2 * COARSEST if case.oversampling == "auto" else int(case.oversampling)
    return SOLVE + (NODE_ARM * arms + NODE_LINE) * case.points * grid
