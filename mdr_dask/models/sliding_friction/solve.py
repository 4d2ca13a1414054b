"""Solution of a block of cases of steady friction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.models.base import Block, Result, Status
from mdr_dask.models.parts.accuracy import missed_accuracy
from mdr_dask.models.parts.material import fit_error
from mdr_dask.models.parts.sliding_problem import STATUS, Setting, SlidingProblems, each, sliding_problems
from mdr_dask.models.parts.tested_range import beyond_tested
from mdr_dask.models.sliding_friction.declaration import SlidingFriction
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.cases import COLUMNS, Steady
from mdr_dask.physics.sliding.problem import Request, solve
from mdr_dask.physics.surfaces.rough_line import RoughLine

ACCURACY = 0.01  # relative accuracy if the campaign does not give an accuracy
# Number of nodes of the finest grid that is usually needed, divided by the number of points of the line. The first
# value is for plane Kelvin bodies, the second value is for all other bodies.
USUAL_ON_PLANES, USUAL = 2, 16
BYTES_A_NODE = 150  # peak memory in bytes per grid point, for a line and one case; 20 to 130 bytes were measured
OPERATIONS_A_NODE = 10  # operations for each grid point in one sweep along the line

#: Outputs that have errors, each with the corresponding column of `Steady`.
OUTPUTS = dict(
    zip(("friction_coefficient", "indentation_depth", "contact_fraction", "contact_slope"), COLUMNS, strict=True)
)


def compute(block: Block[SlidingFriction]) -> Result:
    """Solve the cases of a block. In each realisation, cases with equal dimensionless numbers are solved only once."""
    shape = (block.cases, len(block.realisations))
    values = {name: np.full(shape, np.nan) for name in block.outputs}
    result = Result(values, np.full(shape, Status.FAILED, np.int8))
    problems = sliding_problems(block)
    solves = 0
    groups = [_Group(block, problems, *group) for group in _groups(block, problems)]
    for r, realisation in enumerate(block.realisations):  # all lines of a realisation have the same random phases
        for group in groups:
            solves += group.solve(result, r, realisation)
    if "material_error" in block.outputs:
        materials, which = each(block, "material")
        errors = np.array([fit_error(material) for material in materials])
        values["material_error"][:] = np.where(result.status == Status.DONE, errors[which, None], np.nan)
    result.messages.update({(j, r): fault for j, fault in problems.faults.items() for r in range(shape[1])})
    return replace(result, solves=solves)


def _groups(
    block: Block[SlidingFriction], problems: SlidingProblems
) -> Iterator[tuple[Setting, SlidingFriction, IntArray]]:
    """Yield groups of cases with equal setting and grid: the setting, one case, and the indices of all cases."""
    varied = [block.columns[name] for name in ("oversampling", "scheme") if name in block.columns]
    for setting, members in problems.groups(*varied):
        yield setting, block.case(int(members[0])), members


class _Group:
    """Cases with the same line, solid and grid. Equal cases are solved only once."""

    def __init__(
        self,
        block: Block[SlidingFriction],
        problems: SlidingProblems,
        setting: Setting,
        case: SlidingFriction,
        members: IntArray,
    ) -> None:
        self.block, self.setting, self.members = block, setting, members
        self.height, self.length = problems.height[members], problems.length[members]
        self.deborah, self.loads, self.which = problems.different(members)
        with_errors = any(f"{output}_error" in block.outputs for output in OUTPUTS)
        contact = not {"contact_fraction", "contact_slope"}.isdisjoint(block.outputs)
        accuracy = ACCURACY if block.accuracy is None else block.accuracy
        self.request = Request(accuracy, case.oversampling, case.scheme, with_errors, contact)

    def solve(self, result: Result, r: int, realisation: int) -> int:
        """Solve the realisation with the index r in the block and write the results.

        Return the number of solved cases.
        """
        roughness = self.setting.roughness
        if r and not roughness.is_random:
            self._repeat(result, r)
            return 0
        try:
            line = RoughLine(roughness.waves(self.block.seed, realisation), self.setting.body)
            steady, errors = solve(line, self.setting.terms, self.deborah, self.loads, self.request)
        except ValueError as problem:
            result.messages.update({(int(j), r): str(problem) for j in self.members})
            return 0
        values, absolute = self._outputs(steady.columns), self._outputs(errors)
        result.status[self.members, r] = STATUS[steady.status[self.which]]
        if "rms_slope" in result.values:
            slope = roughness.slope(realisation) * self.height / self.length
            result.values["rms_slope"][self.members, r] = np.where(np.isnan(values["contact_slope"]), np.nan, slope)
        for output in OUTPUTS:
            for name, found in ((output, values[output]), (f"{output}_error", absolute[output])):
                if name in result.values:
                    result.values[name][self.members, r] = np.where(np.isnan(values[output]), np.nan, found)
        for k, message in self._messages(steady, values, absolute):
            result.add_message(int(self.members[k]), r, message)
        return int(self.loads.size)

    def _repeat(self, result: Result, r: int) -> None:
        """Copy the results of the first realisation to the realisation with the index r.

        Both realisations have the same line.
        """
        for array in result.values.values():
            array[self.members, r] = array[self.members, 0]
        result.status[self.members, r] = result.status[self.members, 0]
        first = {int(j): result.messages[j, 0] for j in self.members if (j, 0) in result.messages}
        result.messages.update({(j, r): message for j, message in first.items()})

    def _outputs(self, columns: FloatArray) -> dict[str, FloatArray]:
        """Convert dimensionless outputs, or errors of outputs, to SI units for every case of the group."""
        drag, depth, fraction, contact_slope = columns
        slope = self.height / self.length
        in_units = (drag / self.loads)[self.which] * slope, depth[self.which] * self.height, fraction[self.which]
        return dict(zip(OUTPUTS, (*in_units, contact_slope[self.which] * slope), strict=True))

    def _messages(
        self, steady: Steady, values: dict[str, FloatArray], errors: dict[str, FloatArray]
    ) -> Iterator[tuple[int, str]]:
        """Yield messages about failures, outputs that miss the accuracy, and cases outside the tested range."""
        status = steady.status[self.which]
        for k in np.flatnonzero(status != Outcome.CONVERGED):
            yield int(k), Outcome(int(status[k])).sentence
        if self.request.oversampling == "auto":
            asked = [name for name in OUTPUTS if name in self.block.outputs]
            found, stated = ({name: each[name] for name in asked} for each in (values, errors))
            floors = {"indentation_depth": self.height}
            yield from missed_accuracy(found, stated, self.request.accuracy, floors, " on the finest grid").items()
        yield from beyond_tested(self.setting, self.loads[self.which], values["contact_fraction"]).items()


def distinct(block: Block[SlidingFriction]) -> int:
    """Return the number of solutions of a block."""
    problems, total = sliding_problems(block), 0
    for setting, _, members in _groups(block, problems):
        total += problems.different(members)[0].size * _lines(block, setting)
    return total


def _lines(block: Block[SlidingFriction], setting: Setting) -> int:
    """Return the number of distinct lines: the number of realisations, or 1 if the line is not random."""
    return len(block.realisations) if setting.roughness.is_random else 1


def operations(block: Block[SlidingFriction]) -> float:
    """Return the approximate number of operations of a block, from the number of grid points in all sweeps."""
    problems, nodes = sliding_problems(block), 0.0
    for setting, case, members in _groups(block, problems):
        solves = problems.different(members)[0].size
        visits = 1 if setting.terms is None else 4 * (4 + len(setting.terms.moduli))  # sweeps per case
        grid = 2 if case.oversampling == "auto" else case.oversampling
        # Computing a line costs as much as about ten sweeps. The sweeps of a case count half, because most sweeps are
        # on coarser grids.
        nodes += _lines(block, setting) * setting.roughness.points * grid * (10 + 0.5 * solves * visits)
    return 1e5 + OPERATIONS_A_NODE * nodes


def memory(block: Block[SlidingFriction]) -> float:
    """Return the estimated peak memory of a block in bytes, for one line on the finest grid that is usually needed."""
    problems, nodes = sliding_problems(block), 0.0
    for setting, case, _ in _groups(block, problems):
        grid = case.oversampling
        if grid == "auto":
            is_plane = setting.terms is None and setting.body is None
            grid = USUAL_ON_PLANES if is_plane else USUAL
        nodes = max(nodes, setting.roughness.points * float(grid))
    return BYTES_A_NODE * nodes
