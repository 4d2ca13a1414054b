"""Solution of a block of cases: friction after a jump of the velocity, or under a loading history.

Jumps of a plane Kelvin body are solved by marching the indentation depth in time. All other jumps and histories are
solved from the motion of every element of the viscoelastic foundation.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.errors import DataError
from mdr_dask.models.base import Block, Result, Status
from mdr_dask.models.parts.accuracy import ACCURACY, missed_accuracy
from mdr_dask.models.parts.loading_history import pieces
from mdr_dask.models.parts.measured_line import line_of
from mdr_dask.models.parts.rough_line import Measured, Roughness
from mdr_dask.models.parts.sliding_problem import (
    STATUS,
    Setting,
    SlidingProblems,
    combinations,
    each,
    refuse_immense,
    sliding_problems,
)
from mdr_dask.models.parts.tested_range import beyond_tested
from mdr_dask.models.velocity_jump.declaration import MODEL, VelocityJump
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import Solution, refine
from mdr_dask.physics.surfaces.cubic_line import without_kinks
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import Waves
from mdr_dask.physics.transients.accuracy import solve_jumps
from mdr_dask.physics.transients.elements.foundation import Foundation, foundation
from mdr_dask.physics.transients.elements.loading_history import Piece, Trace, trace
from mdr_dask.physics.transients.velocity_jump import MarchRequest

# Numbers of operations, chosen by trial, for block sizes. A jump needs `OPERATIONS_MARCHED` operations, times
# the nodes, times the time steps per decade. A history needs `OPERATIONS_FOLLOWED` operations for each time step, each
# element (one at each node), and each spring or mode of the element.
OPERATIONS_MARCHED, OPERATIONS_FOLLOWED = 20, 100

#: Names of the outputs for which errors are estimated.
WITH_ERROR = (
    "friction_coefficient_before",
    "friction_coefficient_jump",
    "friction_coefficient_after",
    "friction_coefficient",
    "indentation_depth",
)
TRANSIENT = ("friction_coefficient", "indentation_depth")


@dataclass(frozen=True)
class _Found:
    """The dimensionless outputs of several cases, and the errors.

    Friction is divided by h / L. Depth is divided by h.
    """

    values: dict[str, FloatArray]
    errors: dict[str, FloatArray]
    contact: FloatArray  # largest fraction of the line in contact at the computed times
    outcome: NDArray[np.int8]


def compute(block: Block[VelocityJump]) -> Result:
    """Solve the cases of a block."""
    shape = (block.cases, len(block.realisations))
    result = Result(MODEL.empty_arrays(block, shape), np.full(shape, Status.FAILED, np.int8))
    problems, solves = sliding_problems(block), 0
    with np.errstate(all="ignore"):
        after = np.abs(1 + block.numbers("velocity_change"))
    refuse_immense({"v_2 / v_1": np.where(after == 0, 1, after)}, problems.faults)
    for j in np.flatnonzero(after == 1):
        problems.faults.setdefault(
            int(j), "expected a velocity_change farther from 0: the velocity stays the same because of rounding"
        )
    groups = list(_groups(block, problems))
    for r, realisation in enumerate(block.realisations):  # all lines of a realisation have the same random phases
        for group in groups:
            solves += group.solve(result, r, realisation)
    result.messages.update({(j, r): fault for j, fault in problems.faults.items() for r in range(shape[1])})
    return replace(result, solves=solves)


def _groups(block: Block[VelocityJump], problems: SlidingProblems) -> Iterator[_Group]:
    """Yield groups of cases.

    A group consists of jumps of plane Kelvin bodies with the same line, grid and time steps, or of a single other case.
    """
    protocols, which = each(block, "protocol")
    is_jump = np.array([protocol.shape == "jump" for protocol in protocols])[which]
    is_simple = np.array([setting.terms is None and setting.body is None for setting in problems.settings] + [False])
    followed = np.where(is_jump & is_simple[problems.which], -1, np.arange(block.cases))
    varied = [column for name, column in block.columns.items() if name in VelocityJump.settings]
    for setting, members in problems.groups(followed, *varied):
        first = int(members[0])
        kind, case = _Marched if followed[first] < 0 else _Followed, block.case(first)
        yield kind(block, problems, setting, case.oversampling, case.steps_per_decade, members)


@dataclass(frozen=True)
class _Group(ABC):
    """Cases with the same line, grid and time steps."""

    block: Block[VelocityJump]
    problems: SlidingProblems
    setting: Setting
    oversampling: int
    steps: int
    members: IntArray

    @property
    def outputs(self) -> list[str]:
        """The requested outputs for which errors are estimated."""
        return [name for name in WITH_ERROR if name in self.block.outputs]

    @property
    def largest_loads(self) -> FloatArray:
        """Largest value of F_N / (4 G_inf L h) in each case."""
        return self.problems.loads[self.members]

    @property
    @abstractmethod
    def operations(self) -> float:
        """Approximate number of operations of one realisation."""

    @abstractmethod
    def found(self, waves: Waves) -> tuple[_Found, int]:
        """Solve the cases on one realisation of the roughness. Return the outputs and the number of solved cases."""

    def solve(self, result: Result, r: int, realisation: int) -> int:
        """Solve the realisation with the index r in the block and write the results.

        Return the number of solved cases.
        """
        members = self.members
        height, length = self.problems.height[members], self.problems.length[members]
        try:
            _check_rough(self.setting.roughness)
            waves = self.setting.roughness.waves(self.block.seed, realisation)
            nothing = _Found({}, {}, np.full(members.size, np.nan), np.zeros(members.size, np.int8))
            found, solves = self.found(waves) if self.outputs else (nothing, 0)
        except (DataError, ValueError) as problem:
            result.messages.update({(int(j), r): str(problem) for j in members})
            return 0
        result.status[members, r] = STATUS[found.outcome]
        good = np.flatnonzero(found.outcome == Outcome.CONVERGED)
        steep = height / length
        for name in self.outputs:
            unit = height if name == "indentation_depth" else steep
            for output, values in ((name, found.values[name]), (f"{name}_error", found.errors[name])):
                if output in result.values:
                    result.values[output][members[good], r] = (values.T * unit).T[good]
        if "rms_slope" in result.values:
            result.values["rms_slope"][members[good], r] = (self.setting.roughness.slope(realisation) * steep)[good]
        for k, message in self._messages(found):
            result.add_message(int(members[k]), r, message)
        return solves

    def _messages(self, found: _Found) -> Iterator[tuple[int, str]]:
        """Yield messages about failures, outputs that miss the accuracy, and cases outside the tested range."""
        for k in np.flatnonzero(found.outcome != Outcome.CONVERGED):
            outcome = Outcome(int(found.outcome[k]))
            more = ": use fewer points or a shorter time" if outcome == Outcome.TOO_MANY_STEPS else ""
            yield int(k), outcome.sentence + more
        # the accuracy of a transient is checked only if the campaign gives an accuracy
        judged = [name for name in self.outputs if self.block.accuracy is not None or name not in TRANSIENT]
        values, errors = ({name: each[name] for name in judged} for each in (found.values, found.errors))
        floors = {name: self._floor(found, name) for name in judged}
        yield from missed_accuracy(values, errors, self.block.accuracy or ACCURACY, floors).items()
        yield from beyond_tested(self.setting, self.largest_loads, found.contact).items()

    def _floor(self, found: _Found, name: str) -> FloatArray:
        """Return the floor of an output for every case (see `missed_accuracy`).

        The floor of a depth is 1, because depths are divided by the rms height. If an output of friction is zero within
        its error, as for a body at rest, its floor is the largest absolute value of all friction outputs of the case.
        Otherwise its floor is 0.
        """
        cases = found.outcome.size
        if name == "indentation_depth":
            return np.ones(cases)
        frictions = [found.values[each].reshape(cases, -1) for each in WITH_ERROR if each != "indentation_depth"]
        largest = np.fmax.reduce(np.abs(np.concatenate(frictions, axis=1)), axis=1)
        size, error = (
            np.fmax.reduce(np.abs(each[name].reshape(cases, -1)), axis=1) for each in (found.values, found.errors)
        )
        return np.where(size > error, 0.0, largest)


class _Marched(_Group):
    """Jumps of a plane Kelvin body on one line."""

    def found(self, waves: Waves) -> tuple[_Found, int]:
        loads, deborah, which = self.different
        is_wanted = any(name in self.outputs for name in TRANSIENT)
        times, wavenumber = np.array(self.block.parameters.relaxation_times), np.pi * waves.points
        transient = MarchRequest(times, wavenumber, self.steps) if is_wanted else None
        with_errors = any(f"{name}_error" in self.block.outputs for name in WITH_ERROR)
        of_transient = any(f"{name}_error" in self.block.outputs for name in TRANSIENT)
        accuracy = self.block.accuracy or (ACCURACY if with_errors else None)
        jumps = solve_jumps(RoughLine(waves), loads, deborah, accuracy, self.oversampling, transient, of_transient)
        outputs = {
            "friction_coefficient_before": (jumps.levels.before / loads, jumps.errors.before / loads),
            "friction_coefficient_jump": (jumps.levels.jump / loads, jumps.errors.jump / loads),
            "friction_coefficient_after": (jumps.levels.after / loads, jumps.errors.after / loads),
            "friction_coefficient": ((jumps.trace.T / loads).T, (jumps.trace_error.T / loads).T),
            "indentation_depth": (jumps.depth, jumps.depth_error),
        }
        values, errors = ({name: pair[k][which] for name, pair in outputs.items()} for k in (0, 1))
        return _Found(values, errors, jumps.contact[which], jumps.outcome[which]), loads.size

    @property
    def operations(self) -> float:
        nodes = self.setting.roughness.points * self.oversampling
        return self.different[0].size * nodes * self.steps * OPERATIONS_MARCHED

    @cached_property
    def different(self) -> tuple[FloatArray, FloatArray, IntArray]:
        """Loads and Deborah numbers of the distinct cases, and for every case its index among the distinct cases."""
        before = self.problems.deborah[self.members]
        change = self.block.numbers("velocity_change")[self.members]
        after, loads = before * (1 + change), self.problems.loads[self.members]
        first, which = combinations(before, after, loads)  # equal Deborah numbers are adjacent and share work
        return loads[first], np.column_stack([before, after])[first], which


class _Followed(_Group):
    """One case with any history, solid and indenter, computed from the motion of all elements of the foundation."""

    def found(self, waves: Waves) -> tuple[_Found, int]:
        """Solve the case on up to three grids, with time steps that are proportional to the node spacing."""
        nodes = waves.points * self.oversampling
        grids = [nodes // every for every in (4, 2, 1) if nodes % every == 0 and nodes // every >= waves.points]

        def solve(grid: int, _: IntArray) -> Solution:
            found = self._trace(waves, nodes // grid)
            friction = np.concatenate([[found.before, found.at], found.friction])
            values = [friction[None], np.array([found.after]), found.depth[None], np.array([found.contact])]
            return Solution(values, np.array([found.outcome], np.int8))

        # The error of a depth below the rms height is divided by the rms height, which is 1 here.
        accuracy, floors = self.block.accuracy or 0.0, [0.0, 0.0, 1.0, 0.0]
        refined = refine(solve, 1, grids, accuracy, order=2, floors=floors, shared=False)
        friction, after, depth, contact = refined.values
        error, after_error, depth_error, _ = refined.errors[:, 0]
        before, at = friction[:, 0], friction[:, 1]
        values = dict(zip(WITH_ERROR, (before, at - before, after, friction[:, 2:], depth), strict=True))
        largest = error, error, max(after_error, error), error, depth_error
        errors = {n: np.where(np.isnan(values[n]), np.nan, each) for n, each in zip(WITH_ERROR, largest, strict=True)}
        return _Found(values, errors, contact, refined.outcome), 1

    @property
    def largest_loads(self) -> FloatArray:
        case = self.block.case(int(self.members[0]))
        return self.problems.loads[self.members] * (case.largest_force() / case.normal_force)

    @cached_property
    def _history(self) -> tuple[Foundation, tuple[float, float], list[Piece]]:
        """Dimensionless form of the solid, of velocity and load before t = 0, and of the pieces of the history."""
        case = self.block.case(int(self.members[0]))
        height, length = (float(column[self.members[0]]) for column in (self.problems.height, self.problems.length))
        solid, unit = case.solid(), case.time_unit()
        static = solid.static_modulus
        (before, load), history = pieces(case.protocol, case.velocity, case.normal_force, case.velocity_change)
        velocity, force = length / unit, 4 * static * length * height
        elements = foundation(solid.moduli / static, solid.times / unit, solid.viscosity / static / unit)
        return elements, (before / velocity, load / force), [piece.scaled(unit, velocity, force) for piece in history]

    def _trace(self, waves: Waves, every: int) -> Trace:
        """Compute the case on one of the grids. If `every` is 4, the grid has every fourth node of the finest grid."""
        elements, before, history = self._history
        nodes = waves.points * self.oversampling
        heights, slopes = waves.heights(nodes)[::every], waves.slopes(nodes)[::every]
        line = without_kinks(RoughLine(waves, self.setting.body).through(heights, slopes))
        times = np.array(self.block.parameters.relaxation_times)
        return trace(line, elements, before, history, times, self.steps / every)

    @property
    def operations(self) -> float:
        elements, _, history = self._history
        nodes, last = self.setting.roughness.points * self.oversampling, self.block.parameters.relaxation_times[-1]
        begun = [piece for piece in history if piece.start < last]
        steps = sum((min(piece.end, last) - piece.start) / piece.longest_step(nodes, self.steps) for piece in begun)
        return nodes * steps * OPERATIONS_FOLLOWED * (1 + elements.rates.size)


def _check_rough(roughness: Roughness) -> None:
    if isinstance(roughness, Measured):
        height = line_of(roughness.profile).height
        rounding = height.size * np.finfo(float).eps * float(np.max(np.abs(height), initial=0.0))
        if not height.std() > rounding:
            raise DataError(f"expected a rough line, got the flat profile {roughness.profile.file.name}")


def operations(block: Block[VelocityJump]) -> float:
    """Return the approximate number of operations of a block, estimated from the nodes and time steps of its cases."""
    groups = _groups(block, sliding_problems(block))
    return len(block.realisations) * sum(group.operations for group in groups)
