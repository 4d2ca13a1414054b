"""Steady friction of a block of cases: each different case is solved once in every realisation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.models.base import Block, Result, Status
from mdr_dask.models.parts.accuracy import missed
from mdr_dask.models.parts.material import fit_error
from mdr_dask.models.parts.sliding_problem import STATUS, Setting, SlidingProblems, each, sliding_problems
from mdr_dask.models.sliding_friction.declaration import SlidingFriction
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.accuracy import SETTINGS, Errors, goes_from_node_to_node, relative
from mdr_dask.physics.sliding.cases import Steady
from mdr_dask.physics.sliding.problem import COARSEST, FINEST, Aim, solve
from mdr_dask.physics.surfaces.rough_line import RoughLine

ACCURACY = 0.01  # where the campaign does not say
NODE_LINE, NODE_SWEPT = 2.5e-8, 1.3e-8  # seconds for every node of a line and of a solution
AUTO = {"backward_euler": 512, "piecewise_linear": 4, "hermite": 4}  # the grid that estimates count with
TIMES = {"piecewise_linear": (2.0, 25.0), "hermite": (3.5, 3.5)}  # how many times as many, on a given grid and on that
STEPPED, STEPPED_LINE, NODE_STEPPED = 2.5e-4, 4e-8, 7e-10  # of the papers' steps: to begin with, a line, a solution
POINT_LINE, POINT_SAMPLED = 2e-7, 8e-9  # and for every Nyquist point gone along from node to node
NODE_ARM, NODE_GENERAL, GENERAL = 4e-9, 4.5e-8, 3e-4  # for every node and arm of a general solid, and to begin with
ARRAYS, ARRAYS_GENERAL = 30, 12  # arrays of the length of the line that a solution holds

#: Outputs that have errors, and the column of a steady state that each is.
COLUMNS = {
    "friction_coefficient": "drag",
    "indentation_depth": "depth",
    "contact_fraction": "contact_fraction",
    "contact_slope": "contact_slope",
}


def compute(block: Block[SlidingFriction]) -> Result:
    """Solve the cases of a block, each different one once."""
    shape = (block.cases, len(block.realisations))
    values = {name: np.full(shape, np.nan) for name in block.outputs}
    result = Result(values, np.full(shape, Status.FAILED, np.int8))
    problems = sliding_problems(block)
    materials = each(block, "material") if "material_error" in block.outputs else [None] * block.cases
    solves = 0
    groups = [_Group.of(block, problems, *group) for group in _groups(block, problems)]
    for r, realisation in enumerate(block.realisations):  # outside: every line of one has the same phases
        for group in groups:
            solves += group.solve(result, materials, r, realisation)
    result.messages.update({(j, r): fault for j, fault in problems.faults.items() for r in range(shape[1])})
    return replace(result, solves=solves)


def _groups(block: Block[SlidingFriction], problems: SlidingProblems) -> Any:
    """Yield setting, oversampling and scheme, and the cases that share them."""
    yield from problems.groups(block.column("oversampling").tolist(), block.column("scheme").tolist())


@dataclass
class _Group:
    """Cases that share line, solid and grid, each different one once."""

    block: Block[SlidingFriction]
    problems: SlidingProblems
    setting: Setting
    aim: Aim
    members: IntArray
    deborah: FloatArray
    loads: FloatArray
    which: IntArray  # the entry of `deborah` and `loads` of every member
    solved: dict[str, FloatArray] | None = None  # of a line that is the same in every realisation

    @classmethod
    def of(
        cls, block: Block[SlidingFriction], problems: SlidingProblems, setting: Setting, how: Any, members: IntArray
    ) -> _Group:
        """Collect the different cases among the members."""
        deborah, loads, which = problems.different(members)
        wanted = {name.removesuffix("_error") for name in block.outputs}
        columns = [column for output, column in COLUMNS.items() if output in wanted]
        with_errors = any(f"{output}_error" in block.outputs for output in COLUMNS)
        accuracy = ACCURACY if block.accuracy is None else block.accuracy
        oversampling, scheme = how
        aim = Aim(columns, accuracy, oversampling, scheme, with_errors)
        return cls(block, problems, setting, aim, members, deborah, loads, which)

    def solve(self, result: Result, materials: list[Any], r: int, realisation: int) -> int:
        """Write the cases of one realisation, the r-th of the block; return how many were solved."""
        roughness = self.setting.roughness
        if r and not roughness.is_random:
            for array in result.values.values():
                array[self.members, r] = array[self.members, 0]
            result.status[self.members, r] = result.status[self.members, 0]
            result.messages.update(
                {(int(j), r): result.messages[j, 0] for j in self.members if (j, 0) in result.messages}
            )
            return 0
        try:
            line = RoughLine(roughness.waves(self.block.seed, realisation), self.setting.body)
            steady, errors = solve(line, self.setting.arms, self.deborah, self.loads, self.aim)
        except ValueError as problem:
            result.messages.update({(int(j), r): str(problem) for j in self.members})
            return 0
        found = self._outputs(steady, errors, realisation)
        if "material_error" in self.block.outputs:
            found["material_error"] = np.array([fit_error(materials[j]) for j in self.members])
        status = steady.status[self.which]
        converged = status == CONVERGED
        result.status[self.members, r] = STATUS[status]
        for name in self.block.outputs:
            result.values[name][self.members, r] = np.where(converged, found[name], np.nan)
        for k, sentence in self._sentences(steady, errors):
            result.messages.update({(int(j), r): sentence for j in self.members[self.which == k]})
        return int(self.loads.size)

    def _outputs(self, steady: Steady, errors: Errors, realisation: int) -> dict[str, FloatArray]:
        """Return the outputs of the members and their errors, in units."""
        height = self.problems.height[self.members]
        slope = height / self.problems.length[self.members]
        units = {"friction_coefficient": slope, "indentation_depth": height, "contact_slope": slope}
        found: dict[str, FloatArray] = {}
        for name in self.block.outputs:
            output = name.removesuffix("_error")
            if output == "rms_slope":
                found[name] = self.setting.roughness.slope(realisation) * slope
            elif output in COLUMNS:
                column = getattr(steady if name == output else errors, COLUMNS[output])
                per = self.loads if output == "friction_coefficient" else 1.0
                found[name] = (column / per)[self.which] * units.get(output, 1.0)
        return found

    def _sentences(self, steady: Steady, errors: Errors) -> Iterator[tuple[int, str]]:
        """Yield why a case failed, or which outputs miss the accuracy and by how much."""
        failed = steady.status != CONVERGED
        for k in np.flatnonzero(failed):
            yield int(k), Outcome(int(steady.status[k])).sentence
        if self.aim.oversampling != "auto":
            return
        shares = relative(steady, errors, self.aim.columns)
        late = np.any(~(shares <= self.aim.accuracy), axis=0)
        outputs = [output for output, column in COLUMNS.items() if column in self.aim.columns]
        for k in np.flatnonzero(late & ~failed):
            of_case = dict(zip(outputs, shares[:, k].tolist(), strict=True))
            yield int(k), missed(of_case, self.aim.accuracy, " on the finest grid")


CONVERGED = np.int8(Outcome.CONVERGED)  # many times faster to compare with than the name


def distinct(block: Block[SlidingFriction]) -> int:
    """Return how many different cases a block holds, over all realisations."""
    problems, total = sliding_problems(block), 0
    for setting, _, members in _groups(block, problems):
        total += problems.different(members)[0].size * (len(block.realisations) if setting.roughness.is_random else 1)
    return total


def seconds(block: Block[SlidingFriction]) -> float:
    """Estimate the time of a block: a line for every group and realisation, and sweeps for every different case."""
    problems, total = sliding_problems(block), 1e-4
    for setting, (oversampling, scheme), members in _groups(block, problems):
        solves = problems.different(members)[0].size
        lines = len(block.realisations) if setting.roughness.is_random else 1
        total += lines * _seconds_of_line(block, setting, oversampling, scheme, solves)
    return total


def _seconds_of_line(
    block: Block[SlidingFriction], setting: Setting, oversampling: int | str, scheme: str, solves: int
) -> float:
    """Estimate the time of some cases on one line."""
    points, auto = setting.roughness.points, oversampling == "auto"
    if setting.arms is not None:
        grid = 2 * COARSEST if auto else int(oversampling)
        return solves * (GENERAL + (NODE_ARM * (len(setting.arms.moduli) + 1) + NODE_GENERAL) * points * grid)
    harder = 1 + 2.5 * (1 - getattr(setting.roughness, "hurst", 1.0)) ** 8  # more cases need cubic cells
    from_node_to_node = float(points * (POINT_LINE + solves * POINT_SAMPLED) * harder)
    if auto and scheme == "hermite" and goes_from_node_to_node(setting.body, block.accuracy or ACCURACY):
        return from_node_to_node
    grid = AUTO[scheme] if auto else int(oversampling)
    if scheme == "backward_euler":
        own = STEPPED + points * grid * (STEPPED_LINE + solves * NODE_STEPPED)
    else:
        own = TIMES[scheme][auto] * points * (NODE_LINE * grid + solves * NODE_SWEPT * grid**0.25)
    has_errors = not auto and any(f"{output}_error" in block.outputs for output in COLUMNS)
    return own + has_errors * from_node_to_node


def memory(block: Block[SlidingFriction]) -> float:
    """Estimate the peak memory of a block: the arrays of one line on its finest grid."""
    largest = 0.0
    for setting, oversampling in zip(
        sliding_problems(block).settings, block.column("oversampling").tolist(), strict=True
    ):
        kelvin = setting.arms is None
        grid = oversampling if oversampling != "auto" else SETTINGS.finest if kelvin else FINEST
        largest = max(largest, setting.roughness.points * grid * (2 * ARRAYS if kelvin else ARRAYS_GENERAL))
    return 8 * largest
