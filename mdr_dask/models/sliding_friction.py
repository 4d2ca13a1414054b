"""Steady friction of a viscoelastic body that slides over a rough line (thesis chapter 3)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.models.base import Block, Model, Output, Result, Status, canonical, quantity
from mdr_dask.models.parts import general_sliding
from mdr_dask.models.parts.indenter import Plane
from mdr_dask.models.parts.material import fit_notes
from mdr_dask.models.parts.rough_line import Line, Realisation
from mdr_dask.models.parts.sliding_body import SlidingBody

if TYPE_CHECKING:
    from mdr_dask.physics.sliding.steady import Scheme


ACCURACY = 0.01  # where the campaign does not say
CLOSED_FORM = 1e-12  # error of a smooth indenter: rounding
NODE_LINE, NODE_STEPPED, NODE_SWEPT = 2.5e-8, 5e-10, 1.3e-8  # seconds for every node of a line and of a solution
POINT_LINE, POINT_SAMPLED = 1.2e-7, 1.5e-8  # and for every Nyquist point gone along from node to node
ARRAYS = 30  # arrays of the length of the line that a solution holds


class SlidingFriction(SlidingBody):
    """A viscoelastic body under a load, sliding at constant speed over a rough line."""

    oversampling: Annotated[int, Field(ge=1, le=256)] | Literal["auto"] = quantity(
        "1", "grid points for every Nyquist point, 1 for the papers' grid; auto meets the accuracy", default="auto"
    )
    scheme: Literal["hermite", "piecewise_linear", "backward_euler"] = Field(
        default="hermite",
        description="exact sweep over cubic or straight cells, or the papers' time steps",
    )

    @property
    def is_general(self) -> bool:
        """Whether it is beyond the Kelvin body on a generated line."""
        return self.material is not None or self.profile is not None


#: Outputs, and the column of a steady state that each is.
COLUMNS = {
    "friction_coefficient": "drag",
    "indentation_depth": "depth",
    "contact_fraction": "contact_fraction",
    "contact_slope": "contact_slope",
    "discretisation_error": "drag",
}
OUTPUTS = (
    Output("friction_coefficient", "1", "coefficient of friction"),
    Output("indentation_depth", "m", "penetration of the mean line into the undeformed body"),
    Output("contact_fraction", "1", "length in contact over length of the line"),
    Output("contact_slope", "1", "rms slope of the line over the contact"),
    Output("rms_slope", "1", "spectral rms slope of the line"),
    Output("discretisation_error", "1", "estimated relative error of the friction coefficient"),
    Output(
        "material_error", "1", "rms relative error of the material's Prony series, 0 where none is fitted", (), False
    ),
)


def _number(block: Block[SlidingFriction], path: str) -> FloatArray:
    return np.asarray(block.column(path), dtype=np.float64)


def _harmonic(block: Block[SlidingFriction], path: str) -> FloatArray:
    """Return length / wavelength for every case, 0 where no wavelength is given."""
    wavelengths = [np.inf if value is None else float(value) for value in block.column(path)]
    with np.errstate(all="ignore"):
        return np.asarray(canonical(_number(block, "length") / np.array(wavelengths)))


@dataclass(frozen=True)
class _Cases:
    """The cases of a block as dimensionless numbers; only these decide a solution."""

    loads: FloatArray  # F_N / (4 G L h)
    reaches: FloatArray  # v tau / L
    height: FloatArray  # h
    length: FloatArray  # L
    keys: list[tuple[Line, int | str, Scheme]]

    def groups(self) -> Iterator[tuple[tuple[Line, int | str, Scheme], IntArray]]:
        """Yield the cases that share rough lines and grids."""
        members: dict[tuple[Line, int | str, Scheme], list[int]] = {}
        for j in np.flatnonzero(self.height > 0):
            members.setdefault(self.keys[j], []).append(int(j))
        for key, indices in members.items():
            yield key, np.array(indices)


def _shapes(block: Block[SlidingFriction]) -> list[tuple[float, float]]:
    """Return coefficient and exponent of the line c |x|^n of every case, 0 and 1 for a plane."""
    from mdr_dask.physics.surfaces.shapes import mapped

    shapes = []
    varied = any(path.split(".")[0] == "indenter" for path in block.columns)
    for j in range(block.cases if varied else 1):
        indenter = (block.case(j) if varied else block.parameters).indenter
        coefficient, exponent = (0.0, 1.0) if isinstance(indenter, Plane) else indenter.power_law()
        shapes.append((mapped(exponent) * coefficient, exponent))
    return shapes if varied else shapes * block.cases


def _cases(block: Block[SlidingFriction]) -> _Cases:
    length, height = _number(block, "length"), _number(block, "rms_roughness")
    height = np.where(np.isfinite(length) & (length > 0), height, np.nan)  # so that it is not solved
    coefficient, exponent = np.array(_shapes(block)).T
    with np.errstate(all="ignore"):
        loads = _number(block, "normal_force") / (4 * _number(block, "shear_modulus") * length * height)
        reaches = _number(block, "velocity") * _number(block, "relaxation_time") / length
        coefficient = coefficient * length**exponent / height
    columns = (
        _number(block, "hurst").tolist(),
        block.column("points").tolist(),
        _harmonic(block, "rolloff_wavelength").tolist(),
        _harmonic(block, "longest_wavelength").tolist(),
        canonical(coefficient).tolist(),
        exponent.tolist(),
    )
    lines = [Line(*numbers) for numbers in zip(*columns, strict=True)]
    keys = list(zip(lines, block.column("oversampling").tolist(), block.column("scheme").tolist(), strict=True))
    return _Cases(canonical(loads), canonical(reaches), height, length, keys)


@dataclass
class _Answer:
    """The result of a block while it fills."""

    block: Block[SlidingFriction]
    values: dict[str, FloatArray]
    status: NDArray[np.int8]
    messages: dict[tuple[int, int], str]
    solves: int = 0

    def put(self, members: IntArray, realisation: int, found: dict[str, Any], state: NDArray[np.int8]) -> None:
        """Write cases of one realisation, and why those with a state other than 0 failed."""
        from mdr_dask.physics.sliding import steady as sliding

        for name in self.block.outputs:
            self.values[name][members, realisation] = np.where(state == 0, found[name], np.nan)
        self.status[members, realisation] = STATUS[state]
        for j in np.flatnonzero(state):
            self.messages[int(members[j]), realisation] = sliding.MESSAGES[int(state[j])]

    def warn(self, members: IntArray, sentence: str) -> None:
        """Note a sentence for cases in every realisation."""
        self.messages.update({(int(j), r): sentence for j in members for r in range(self.status.shape[1])})


def _general_cases(block: Block[SlidingFriction]) -> list[general_sliding.Case]:
    """Return the cases of a block whose material or line is not the Kelvin solver's."""
    rolloff, longest = _harmonic(block, "rolloff_wavelength"), _harmonic(block, "longest_wavelength")
    found = []
    for j, body in enumerate(_shapes(block)):
        case = block.case(j)
        material = case.material
        if material is None:
            material = general_sliding.kelvin_material(case.shear_modulus or 0.0, case.relaxation_time or 0.0)
        measured = case.profile is not None
        found.append(
            general_sliding.Case(
                profile=case.profile,
                length=case.length or 0.0,
                points=case.points,
                hurst=case.hurst,
                rms=case.rms_roughness or 0.0,
                rolloff=0.0 if measured else float(rolloff[j]),
                longest=0.0 if measured else float(longest[j]),
                body=body,
                material=material,
                velocity=case.velocity,
                force=case.normal_force,
                oversampling=case.oversampling,
            )
        )
    return found


def compute(block: Block[SlidingFriction]) -> Result:
    """Solve the cases of a block, each different one once."""
    if block.parameters.is_general:
        return general_sliding.compute(block, _general_cases(block), block.accuracy or ACCURACY)
    shape = (block.cases, len(block.realisations))
    values = {name: np.full(shape, np.nan) for name in block.outputs}
    answer = _Answer(block, values, np.full(shape, Status.FAILED, np.int8), {})
    cases = _cases(block)
    answer.warn(np.flatnonzero(~(cases.height >= 0)), "the length must be positive, the rms roughness not negative")
    _smooth(cases, answer)
    groups = []
    for (line, oversampling, scheme), members in cases.groups():
        try:
            line.amplitudes()
        except ValueError as problem:
            answer.warn(members, str(problem))
            continue
        groups.append(_Group.of(line, oversampling, scheme, members, cases))
    # realisations outside: every line of one has the same phases
    for r, realisation in enumerate(block.realisations):
        for group in groups:
            group.solve(r, realisation, answer)
    return Result(answer.values, answer.status, answer.messages, answer.solves)


@dataclass(frozen=True)
class _Group:
    """Cases that share rough lines and grids, each different one once."""

    line: Line
    oversampling: int | str
    scheme: Scheme
    members: IntArray
    reaches: FloatArray
    loads: FloatArray
    which: IntArray  # the entry of `reaches` and `loads` of every member
    height: FloatArray
    scale: FloatArray  # slope of a line of unit length and height

    @classmethod
    def of(cls, line: Line, oversampling: int | str, scheme: Scheme, members: IntArray, cases: _Cases) -> _Group:
        """Collect the different cases among the members."""
        numbers = np.stack([cases.reaches[members], cases.loads[members]])
        (reaches, loads), which = np.unique(numbers, axis=1, return_inverse=True)
        height = cases.height[members]
        scale = height / cases.length[members]
        return cls(line, oversampling, scheme, members, reaches, loads, which, height, scale)

    def solve(self, r: int, realisation: int, answer: _Answer) -> None:
        """Solve the cases in one realisation, the r-th of the block."""
        from mdr_dask.physics.sliding.accuracy import Errors, Ladder
        from mdr_dask.physics.surfaces import roughness

        block = answer.block
        turned = roughness.turns(block.seed, realisation, self.line.points // 2)
        columns = [column for output, column in COLUMNS.items() if output in block.outputs]
        ladder = Ladder(Realisation(self.line, turned), self.scheme, self.reaches, self.loads, columns)
        accuracy = ACCURACY if block.accuracy is None else block.accuracy
        if self.oversampling == "auto":
            steady, errors = ladder.to_accuracy(accuracy)
        elif "discretisation_error" in block.outputs:
            steady, errors = ladder.with_errors(int(self.oversampling))
        else:
            steady, errors = ladder.on_grid(int(self.oversampling)), Errors.unknown(self.loads.size)
        error = errors.drag / steady.drag
        answer.solves += self.loads.size
        which = self.which
        found = {
            "friction_coefficient": (steady.drag / self.loads)[which] * self.scale,
            "indentation_depth": steady.depth[which] * self.height,
            "contact_fraction": steady.contact_fraction[which],
            "contact_slope": steady.contact_slope[which] * self.scale,
            "rms_slope": self.line.slope() * self.scale,
            "discretisation_error": error[which],
            "material_error": 0.0,
        }
        answer.put(self.members, r, found, steady.status[which])
        if self.oversampling == "auto":
            for j in np.flatnonzero((steady.status == 0) & ~(error <= accuracy)):
                for member in self.members[which == j]:
                    answer.messages[int(member), r] = f"estimated error {error[j]:.1e} on the finest grid"


def _smooth(cases: _Cases, answer: _Answer) -> None:
    """Solve the cases without roughness in closed form."""
    from mdr_dask.physics.sliding import steady as sliding
    from mdr_dask.physics.surfaces import shapes as indenter

    members = np.flatnonzero(cases.height == 0)
    if not members.size:
        return
    block, length = answer.block, cases.length[members]
    shapes = np.array(_shapes(block))[members]
    loads = (_number(block, "normal_force") / (4 * _number(block, "shear_modulus")))[members]
    found = dict.fromkeys(block.outputs, np.zeros(members.size))
    found |= {"indentation_depth": loads / length, "contact_fraction": np.ones(members.size)}
    state = np.zeros(members.size, np.int8)
    body = shapes[:, 0] > 0
    if np.any(body):
        state_of = np.empty((members.size, indenter.COLUMNS))
        state_of[:] = np.nan
        solved = np.empty((int(body.sum()), indenter.COLUMNS))
        indenter.smooth(loads[body], (cases.reaches[members] * length)[body], shapes[body, 0], shapes[body, 1], solved)
        state_of[body] = solved
        depth, drag, a, b, stretch = state_of.T
        outside = np.maximum(a, b) > 0.5 * length
        state = np.where(body & np.isnan(depth), sliding.NOT_CONVERGED, np.where(outside, sliding.OUTSIDE_LINE, 0))
        found["friction_coefficient"] = np.where(body, drag / loads, 0.0)
        found["indentation_depth"] = np.where(body, depth, found["indentation_depth"])
        found["contact_fraction"] = np.where(body, (a + b) / length, 1.0)
        found["contact_slope"] = np.where(body, np.sqrt(stretch / (a + b)), 0.0)
        found["discretisation_error"] = np.full(members.size, CLOSED_FORM)
    answer.solves += members.size
    for r in range(len(block.realisations)):
        answer.put(members, r, found, state.astype(np.int8))


STATUS = np.array([Status.DONE, Status.NOT_CONVERGED, Status.FAILED, Status.FAILED], dtype=np.int8)


def distinct(block: Block[SlidingFriction]) -> int:
    """Return how many different cases a block holds, over all realisations."""
    if block.parameters.is_general:
        return general_sliding.distinct(_general_cases(block), len(block.realisations))
    cases = _cases(block)
    rough = cases.height > 0
    different = set(zip(cases.keys, cases.loads.tolist(), cases.reaches.tolist(), rough, strict=True))
    smooth = np.count_nonzero(~rough)
    return len([case for case in different if case[-1]]) * len(block.realisations) + int(smooth)


def seconds(block: Block[SlidingFriction]) -> float:
    """Estimate the time of a block: a line for every group and realisation, and sweeps for every different case."""
    if block.parameters.is_general:
        general = dict.fromkeys(_general_cases(block))
        return sum(general_sliding.seconds(case) for case in general) * len(block.realisations)
    from mdr_dask.physics.sliding.accuracy import goes_from_node_to_node

    cases = _cases(block)
    total = 1e-4
    for (line, oversampling, scheme), members in cases.groups():
        numbers = np.stack([cases.reaches[members], cases.loads[members]])
        solves = np.unique(numbers, axis=1).shape[1]
        auto = oversampling == "auto" and scheme == "hermite"
        if auto and goes_from_node_to_node(line.coefficient, block.accuracy or ACCURACY):
            total += len(block.realisations) * line.points * (POINT_LINE + solves * POINT_SAMPLED)
            continue
        grid = 4 if oversampling == "auto" else int(oversampling)
        checks = 3.5 if oversampling == "auto" or "discretisation_error" in block.outputs else 1
        nodes = line.points * grid
        sweep = NODE_STEPPED * nodes if scheme == "backward_euler" else NODE_SWEPT * line.points * grid**0.25
        total += len(block.realisations) * checks * (NODE_LINE * nodes + solves * sweep)
    return total


def memory(block: Block[SlidingFriction]) -> float:
    """Estimate the peak memory of a block: the arrays of one line on its finest grid."""
    from mdr_dask.physics.sliding.accuracy import SETTINGS

    grid = [2 * (SETTINGS.finest if value == "auto" else int(value)) for value in block.column("oversampling")]
    return float(np.max(np.array(grid) * _number(block, "points")) * 8 * ARRAYS)


MODEL = Model(
    name="sliding_friction",
    version=5,
    summary="steady friction of a viscoelastic body on a rough line or a rough indenter",
    parameters=SlidingFriction,
    outputs=OUTPUTS,
    compute=compute,
    seconds=seconds,
    whole=("normal_force", "velocity", "shear_modulus", "relaxation_time", "rms_roughness"),
    distinct=distinct,
    memory=memory,
    notes=lambda parameters: fit_notes(parameters.material),
)
