"""Steady friction of a viscoelastic body that slides over a rough line (thesis chapter 3)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mdr_dask.models.base import Block, FloatArray, Model, Output, Parameters, Result, Status, quantity

if TYPE_CHECKING:
    from mdr_dask.physics.sliding import Scheme, Steady

IntArray = NDArray[np.intp]

ACCURACY = 0.01  # where the campaign does not say
FINEST = 64  # oversampling beyond which `auto` gives up
CANONICAL_BITS = 44  # dimensionless numbers that agree to 6e-14 are the same case


class Plane(Parameters):
    """A nominally flat body: the rough line alone, periodic."""

    shape: Literal["plane"] = "plane"


Indenter = Plane


class SlidingFriction(Parameters):
    """A Kelvin body under a load, sliding at constant speed over a self-affine line."""

    length: float = quantity("m", "length L of the line, and period of its roughness", gt=0)
    points: int = quantity(
        "1", "Nyquist points: the cut-off wavelength is 2 length / points", default=5000, ge=16, le=10**6
    )
    oversampling: Annotated[int, Field(ge=1, le=256)] | Literal["auto"] = quantity(
        "1", "grid points for every Nyquist point, 1 for the papers' grid; auto meets the accuracy", default="auto"
    )
    hurst: float = quantity("1", "Hurst exponent H of the self-affine roughness", default=0.7, ge=0, le=1)
    rms_roughness: float = quantity("m", "rms height h of the roughness", ge=0)
    rolloff_wavelength: float | None = quantity(
        "m", "wavelength above which the spectrum is constant", default=None, gt=0
    )
    longest_wavelength: float | None = quantity("m", "wavelength above which there is no roughness", default=None, gt=0)
    shear_modulus: float = quantity("Pa", "static shear modulus G of the incompressible Kelvin body", gt=0)
    relaxation_time: float = quantity("s", "relaxation time tau = eta / G of the Kelvin body", gt=0)
    normal_force: float = quantity("N", "normal force F_N", gt=0)
    velocity: float = quantity("m/s", "sliding velocity v", gt=0)
    indenter: Indenter = Field(default=Plane(), description="the shape under the roughness")
    scheme: Literal["hermite", "piecewise_linear", "backward_euler"] = Field(
        default="hermite",
        description="exact sweep over cubic or straight cells, or the papers' time steps",
    )


OUTPUTS = (
    Output("friction_coefficient", "1", "coefficient of friction"),
    Output("indentation_depth", "m", "penetration of the mean line into the undeformed body"),
    Output("contact_fraction", "1", "length in contact over length of the line"),
    Output("contact_slope", "1", "rms slope of the line over the contact"),
    Output("rms_slope", "1", "spectral rms slope of the line"),
    Output("discretisation_error", "1", "estimated relative error of the friction coefficient"),
)


@dataclass(frozen=True)
class _Line:
    """What fixes a line but for its phases, in units of its length and rms height."""

    hurst: float
    points: int
    rolloff: float
    longest: float

    def amplitudes(self) -> FloatArray:
        from mdr_dask.physics import roughness

        return roughness.amplitudes(self.points // 2, self.hurst, self.rolloff, self.longest)


def _canonical(number: FloatArray) -> FloatArray:
    """Round to `CANONICAL_BITS`, so that equal dimensionless numbers are equal however they were computed."""
    mantissa, exponent = np.frexp(number)
    rounded: FloatArray = np.ldexp(np.rint(np.ldexp(mantissa, CANONICAL_BITS)), exponent - CANONICAL_BITS)
    return rounded


def _number(block: Block[SlidingFriction], path: str) -> FloatArray:
    return np.asarray(block.column(path), dtype=np.float64)


def _harmonic(block: Block[SlidingFriction], path: str) -> FloatArray:
    """Return length / wavelength for every case, 0 where no wavelength is given."""
    wavelengths = [np.inf if value is None else float(value) for value in block.column(path)]
    return _canonical(_number(block, "length") / np.array(wavelengths))


@dataclass(frozen=True)
class _Cases:
    """The cases of a block as dimensionless numbers; only these decide a solution."""

    loads: FloatArray  # F_N / (4 G L h)
    reaches: FloatArray  # v tau / L
    scale: FloatArray  # h / L
    oversampling: NDArray[np.object_]
    scheme: NDArray[np.object_]
    lines: list[_Line]

    def groups(self) -> Iterator[tuple[_Line, int | str, Scheme, IntArray]]:
        """Yield the cases that share lines and grids."""
        keys = list(zip(self.lines, self.oversampling.tolist(), self.scheme.tolist(), strict=True))
        for key in dict.fromkeys(keys):
            yield *key, np.array([j for j, other in enumerate(keys) if other == key])


def _cases(block: Block[SlidingFriction]) -> _Cases:
    length, height = _number(block, "length"), _number(block, "rms_roughness")
    with np.errstate(all="ignore"):
        loads = _number(block, "normal_force") / (4 * _number(block, "shear_modulus") * length * height)
        reaches = _number(block, "velocity") * _number(block, "relaxation_time") / length
    lines = [
        _Line(float(hurst), int(points), float(rolloff), float(longest))
        for hurst, points, rolloff, longest in zip(
            block.column("hurst"),
            block.column("points"),
            _harmonic(block, "rolloff_wavelength"),
            _harmonic(block, "longest_wavelength"),
            strict=True,
        )
    ]
    return _Cases(
        _canonical(loads),
        _canonical(reaches),
        height / length,
        block.column("oversampling").astype(object),
        block.column("scheme").astype(object),
        lines,
    )


def _solve(
    line: _Line, phase: FloatArray, oversampling: int, scheme: Scheme, reaches: FloatArray, loads: FloatArray
) -> Steady:
    """Solve cases on one line, of unit length and rms height, on one grid."""
    from mdr_dask.physics import roughness, sliding

    amplitude, nodes = line.amplitudes(), line.points * oversampling
    height = roughness.line(amplitude, phase, nodes)
    slope = roughness.line(amplitude, phase, nodes, 1) if scheme == "hermite" else None
    return sliding.steady_sliding(height, slope, reaches, loads, scheme)


def _difference(one: Steady, other: Steady) -> FloatArray:
    with np.errstate(all="ignore"):
        change: FloatArray = np.abs(one.drag / other.drag - 1)
    return change


def _fixed(
    line: _Line,
    phase: FloatArray,
    oversampling: int,
    scheme: Scheme,
    cases: tuple[FloatArray, FloatArray],
    estimate: bool,
) -> tuple[Steady, FloatArray]:
    """Solve on one grid, and compare with another one if an error is asked for."""
    steady = _solve(line, phase, oversampling, scheme, *cases)
    if not estimate:
        return steady, np.full(cases[0].size, np.nan)
    if scheme == "hermite" and oversampling % 2 == 0:
        return steady, _difference(steady, _solve(line, phase, oversampling // 2, scheme, *cases))
    return steady, 1.5 * _difference(steady, _solve(line, phase, 2 * oversampling, "hermite", *cases))


def _auto(
    line: _Line, phase: FloatArray, scheme: Scheme, cases: tuple[FloatArray, FloatArray], accuracy: float
) -> tuple[Steady, FloatArray]:
    """Double the grid for the cases whose error estimate does not meet the accuracy."""
    reaches, loads = cases
    before = _solve(line, phase, 1, scheme, reaches, loads)
    answer, error = before, np.full(loads.size, np.inf)
    open_cases = np.arange(loads.size)
    oversampling = 2
    while open_cases.size and oversampling <= FINEST:
        now = _solve(line, phase, oversampling, scheme, reaches[open_cases], loads[open_cases])
        error[open_cases] = _difference(now, before)
        still = ~(error[open_cases] <= accuracy) & (now.status == 0)
        answer = answer.replaced(open_cases, now)
        before = now.only(still)
        open_cases, oversampling = open_cases[still], 2 * oversampling
    return answer, error


def compute(block: Block[SlidingFriction]) -> Result:
    """Solve the cases of a block, each different one once."""
    from mdr_dask.physics import roughness, sliding

    cases = _cases(block)
    shape = (block.cases, len(block.realisations))
    values = {name: np.full(shape, np.nan) for name in block.outputs}
    status = np.full(shape, Status.FAILED, np.int8)
    messages: dict[tuple[int, int], str] = {}
    solves = 0
    accuracy = ACCURACY if block.accuracy is None else block.accuracy
    for line, oversampling, scheme, members in cases.groups():
        try:
            slope = roughness.spectral_slope(line.amplitudes())
        except ValueError as problem:
            messages.update({(int(j), r): str(problem) for j in members for r in range(shape[1])})
            continue
        numbers = np.stack([cases.reaches[members], cases.loads[members]])
        distinct, which = np.unique(numbers, axis=1, return_inverse=True)
        for r, realisation in enumerate(block.realisations):
            phase = roughness.phases(block.seed, realisation, line.points // 2)
            pair = (distinct[0], distinct[1])
            if oversampling == "auto":
                steady, error = _auto(line, phase, scheme, pair, accuracy)
            else:
                estimate = "discretisation_error" in block.outputs
                steady, error = _fixed(line, phase, int(oversampling), scheme, pair, estimate)
            solves += distinct.shape[1]
            scale = cases.scale[members]
            found = {
                "friction_coefficient": (steady.drag / distinct[1])[which] * scale,
                "indentation_depth": steady.depth[which] * _number(block, "rms_roughness")[members],
                "contact_fraction": steady.contact_fraction[which],
                "contact_slope": steady.contact_slope[which] * scale,
                "rms_slope": slope * scale,
                "discretisation_error": error[which],
            }
            for name in block.outputs:
                values[name][members, r] = found[name]
            state = steady.status[which]
            status[members, r] = STATUS[state]
            for j in np.flatnonzero(state):
                messages[int(members[j]), r] = sliding.MESSAGES[int(state[j])]
    return Result(values, status, messages, solves)


STATUS = np.array([Status.DONE, Status.NOT_CONVERGED, Status.FAILED, Status.FAILED], dtype=np.int8)


def distinct(block: Block[SlidingFriction]) -> int:
    """Return how many different cases a block holds, over all realisations."""
    cases = _cases(block)
    different = set(zip(cases.lines, cases.oversampling, cases.scheme, cases.loads, cases.reaches, strict=True))
    return len(different) * len(block.realisations)


def seconds(block: Block[SlidingFriction]) -> float:
    """Estimate the time of a block from the nodes that its different cases visit."""
    grid = np.array([3 if value == "auto" else value for value in block.column("oversampling")], dtype=np.float64)
    nodes = grid * _number(block, "points")
    share = distinct(block) / (block.cases * len(block.realisations))
    return float(np.sum(nodes) * len(block.realisations) * share * 5e-9 + 1e-3)


MODEL = Model(
    name="sliding_friction",
    version=1,
    summary="steady friction of a viscoelastic body on a rough line or a rough indenter",
    parameters=SlidingFriction,
    outputs=OUTPUTS,
    compute=compute,
    seconds=seconds,
    whole=("normal_force", "velocity", "shear_modulus", "relaxation_time", "rms_roughness"),
    distinct=distinct,
)
