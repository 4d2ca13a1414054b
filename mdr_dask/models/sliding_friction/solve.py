"""Solution of a block of cases of steady friction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.models.base import Block, Result, Status
from mdr_dask.models.parts.accuracy import ACCURACY, missed_accuracy
from mdr_dask.models.parts.material import fit_error
from mdr_dask.models.parts.sliding_problem import STATUS, Setting, SlidingProblems, each, sliding_problems
from mdr_dask.models.parts.tested_range import beyond_tested
from mdr_dask.models.sliding_friction.declaration import MODEL, SlidingFriction
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.cases import COLUMNS, Steady
from mdr_dask.physics.sliding.problem import Request, solve
from mdr_dask.physics.surfaces.rough_line import RoughLine

OPERATIONS_A_POINT = 10  # operations of a solution for each point of the line, chosen by trial for block sizes
#: For each point, the solution of a general solid needs about this number times n (1 + n) operations. n is the number
#: of Prony terms plus 1. The three coarsest grids have 1, 2 and 4 nodes per point, together 7. About five sweeps over
#: each grid need n operations for each node, together 35 n. On each grid there is about one contact or free recovery
#: for every four points, which needs about 15 matrix products of 3 n^2 operations for Newton's method, together 34 n^2.
#: The numbers of sweeps, products and contacts were counted in one case.
OPERATIONS_OF_GENERAL = 35

#: Outputs that have errors, each with the corresponding column of `Steady`.
OUTPUTS = dict(
    zip(("friction_coefficient", "indentation_depth", "contact_fraction", "contact_slope"), COLUMNS, strict=True)
)


def compute(block: Block[SlidingFriction]) -> Result:
    """Solve the cases of a block. In each realisation, cases with equal dimensionless numbers are solved only once.

    Cases on a line that is not random are solved only once for all realisations.
    """
    shape = (block.cases, len(block.realisations))
    result = Result(MODEL.empty_arrays(block, shape), np.full(shape, Status.FAILED, np.int8))
    problems = sliding_problems(block)
    solves = 0
    groups = [_Group(block, problems, *group) for group in _groups(block, problems)]
    for r, realisation in enumerate(block.realisations):  # all lines of a realisation have the same random phases
        for group in groups:
            if group.setting.roughness.is_random:
                solves += group.solve(result, [r], realisation)
            elif r == 0:
                solves += group.solve(result, list(range(shape[1])), realisation)
    if "material_error" in block.outputs:
        materials, which = each(block, "material")
        errors = np.array([fit_error(material) for material in materials])
        result.values["material_error"][:] = np.where(result.status == Status.DONE, errors[which, None], np.nan)
    result.messages.update({(j, r): fault for j, fault in problems.faults.items() for r in range(shape[1])})
    return replace(result, solves=solves)


def _groups(
    block: Block[SlidingFriction], problems: SlidingProblems
) -> Iterator[tuple[Setting, SlidingFriction, IntArray]]:
    """Yield groups of cases with equal setting, grid and scheme: the setting, one case, and all case indices."""
    varied = [block.columns[name] for name in ("oversampling", "scheme") if name in block.columns]
    for setting, members in problems.groups(*varied):
        yield setting, block.case(int(members[0])), members


class _Group:
    """Cases with the same setting, grid and scheme. Equal cases are solved only once."""

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

    def solve(self, result: Result, equal: list[int], realisation: int) -> int:
        """Solve a realisation, and return the number of solved cases.

        Write the results for all realisations with the same line. `equal` contains the indices of these realisations.
        """
        roughness, places = self.setting.roughness, np.ix_(self.members, np.array(equal, dtype=np.int64))
        try:
            line = RoughLine(roughness.waves(self.block.seed, realisation), self.setting.body)
            steady, errors = solve(line, self.setting.terms, self.deborah, self.loads, self.request)
        except ValueError as problem:
            result.messages.update({(int(j), r): str(problem) for j in self.members for r in equal})
            return 0
        values, absolute = self._outputs(steady.columns), self._outputs(errors)
        result.status[places] = STATUS[steady.status[self.which]][:, None]
        if "rms_slope" in result.values:
            slope = roughness.slope(realisation) * self.height / self.length
            result.values["rms_slope"][places] = np.where(np.isnan(values["contact_slope"]), np.nan, slope)[:, None]
        for output in OUTPUTS:
            for name, found in ((output, values[output]), (f"{output}_error", absolute[output])):
                if name in result.values:
                    result.values[name][places] = np.where(np.isnan(values[output]), np.nan, found)[:, None]
        for k, message in self._messages(steady, values, absolute):
            for r in equal:
                result.add_message(int(self.members[k]), r, message)
        return int(self.loads.size)

    def _outputs(self, columns: FloatArray) -> dict[str, FloatArray]:
        """Convert dimensionless outputs, or errors of outputs, to SI units for every case of the group."""
        drag, depth, fraction, contact_slope = columns
        slope = self.height / self.length
        in_units = (drag / self.loads)[self.which] * slope, depth[self.which] * self.height, fraction[self.which]
        return dict(zip(OUTPUTS, (*in_units, contact_slope[self.which] * slope), strict=True))

    def _messages(
        self, steady: Steady, values: dict[str, FloatArray], errors: dict[str, FloatArray]
    ) -> Iterator[tuple[int, str]]:
        """Yield messages about failures, outputs that miss the accuracy, and cases outside the tested range.

        The accuracy is checked only with ``oversampling: auto``.
        """
        status = steady.status[self.which]
        for k in np.flatnonzero(status != Outcome.CONVERGED):
            yield int(k), Outcome(int(status[k])).sentence
        if self.request.oversampling == "auto":
            asked = [name for name in OUTPUTS if name in self.block.outputs]
            found, stated = ({name: each[name] for name in asked} for each in (values, errors))
            floors = {"indentation_depth": self.height}
            yield from missed_accuracy(found, stated, self.request.accuracy, floors, " on the finest grid").items()
        yield from beyond_tested(self.setting, self.loads[self.which], values["contact_fraction"]).items()


def operations(block: Block[SlidingFriction]) -> float:
    """Return the approximate number of operations of a block, which grows with the points and the Prony terms."""
    problems, operations = sliding_problems(block), 0
    for setting, case, members in _groups(block, problems):
        lines = len(block.realisations) if setting.roughness.is_random else 1
        grid = 1 if case.oversampling == "auto" else case.oversampling
        solutions = problems.different(members)[0].size
        terms = 0 if setting.terms is None else 1 + len(setting.terms.moduli)
        solution = OPERATIONS_OF_GENERAL * terms * (1 + terms) or OPERATIONS_A_POINT
        operations += lines * setting.roughness.points * grid * (OPERATIONS_A_POINT + solutions * solution)
    return float(operations)
