"""Kinetics of friction after a jump of the sliding velocity at constant load (thesis chapter 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pydantic import field_validator, model_validator

from mdr_dask.models.base import Block, Coordinate, FloatArray, Model, Output, Parameters, Result, Status, quantity

if TYPE_CHECKING:
    from mdr_dask.physics.kinetics import Jump

CANONICAL_BITS = 44  # dimensionless numbers that agree to 6e-14 are the same case
SECONDS_NODE, SECONDS_MOMENT = 8e-8, 3.5e-8  # for every node of a line, and of a moment
MOMENTS = 60

TIMES = tuple(float(f"{time:.4g}") for time in np.geomspace(1e-4, 20, 54))


class VelocityJump(Parameters):
    """A Kelvin body under a constant load on a self-affine line, whose velocity jumps from v_1 to v_1 + dv."""

    length: float = quantity("m", "length L of the line, and period of its roughness", gt=0)
    points: int = quantity(
        "1", "Nyquist points: the cut-off wavelength is 2 length / points", default=5000, ge=16, le=10**6
    )
    oversampling: int = quantity("1", "grid points for every Nyquist point", default=4, ge=2, le=256, multiple_of=2)
    steps_per_decade: int = quantity("1", "time steps in a factor ten of the time", default=12, ge=6, le=400)
    hurst: float = quantity("1", "Hurst exponent H of the self-affine roughness", default=0.7, ge=0, le=1)
    rms_roughness: float = quantity("m", "rms height h of the roughness", gt=0)
    rolloff_wavelength: float | None = quantity(
        "m", "wavelength above which the spectrum is constant", default=None, gt=0
    )
    longest_wavelength: float | None = quantity("m", "wavelength above which there is no roughness", default=None, gt=0)
    shear_modulus: float = quantity("Pa", "static shear modulus G of the incompressible Kelvin body", gt=0)
    relaxation_time: float = quantity("s", "relaxation time tau = eta / G of the Kelvin body", gt=0)
    normal_force: float = quantity("N", "normal force F_N", gt=0)
    velocity: float = quantity("m/s", "sliding velocity v_1 before the jump", gt=0)
    velocity_change: float = quantity("1", "jump of the velocity dv / v_1", default=0.2, gt=-1)
    relaxation_times: tuple[float, ...] = quantity(
        "1", "times (t - t_0) / tau at which friction is wanted", default=TIMES, strict=False, min_length=2
    )

    @field_validator("relaxation_times")
    @classmethod
    def _increasing(cls, times: tuple[float, ...]) -> tuple[float, ...]:
        if times[0] < 0 or np.any(np.diff(times) <= 0):
            raise ValueError(f"expected increasing times from 0 on, got {times!r}")
        return times

    @model_validator(mode="after")
    def _changes(self) -> VelocityJump:
        if self.velocity_change == 0:
            raise ValueError("expected a velocity_change other than 0")
        return self


OUTPUTS = (
    Output("friction_coefficient_before", "1", "coefficient of friction mu_1, steady at v_1"),
    Output("friction_coefficient_jump", "1", "immediate change d_mu_0 of the coefficient of friction"),
    Output("friction_coefficient_after", "1", "coefficient of friction mu_2, steady at v_2"),
    Output("friction_coefficient", "1", "coefficient of friction after the jump", ("relaxation_times",)),
    Output("rms_slope", "1", "spectral rms slope of the line"),
    Output("discretisation_error", "1", "estimated error of the relaxing part mu - mu_2 over mu_2"),
)
FROM_JUMP = frozenset(output.name for output in OUTPUTS) - {"rms_slope"}


@dataclass(frozen=True)
class _Case:
    """What decides a solution: a line but for its phases, a grid, and dimensionless numbers."""

    hurst: float
    points: int
    rolloff: float
    longest: float
    oversampling: int
    steps_per_decade: int
    load: float  # F_N / (4 G L h)
    reach: float  # v_1 tau / L
    change: float
    times: tuple[float, ...]

    def line(self) -> tuple[object, ...]:
        """Return what cases must share to be solved together."""
        grid = self.hurst, self.points, self.rolloff, self.longest, self.oversampling
        return *grid, self.steps_per_decade, self.times

    def amplitudes(self) -> FloatArray:
        from mdr_dask.physics import roughness

        return roughness.amplitudes(self.points // 2, self.hurst, self.rolloff, self.longest)


def _canonical(number: float) -> float:
    """Round to `CANONICAL_BITS`, so that equal dimensionless numbers are equal however they were computed."""
    mantissa, exponent = np.frexp(number)
    return float(np.ldexp(np.rint(np.ldexp(mantissa, CANONICAL_BITS)), exponent - CANONICAL_BITS))


def _case(case: VelocityJump) -> _Case:
    return _Case(
        case.hurst,
        case.points,
        _canonical(case.length / case.rolloff_wavelength) if case.rolloff_wavelength else 0.0,
        _canonical(case.length / case.longest_wavelength) if case.longest_wavelength else 0.0,
        case.oversampling,
        case.steps_per_decade,
        _canonical(case.normal_force / (4 * case.shear_modulus * case.length * case.rms_roughness)),
        _canonical(case.velocity * case.relaxation_time / case.length),
        case.velocity_change,
        case.relaxation_times,
    )


def _solve(
    cases: list[_Case], height: FloatArray, slope: FloatArray, resolution: FloatArray, coarser: bool
) -> list[Jump]:
    """Solve the cases of one line on the nodes given, or on every other one with half as many steps."""
    from mdr_dask.physics.kinetics import velocity_jumps

    shared = cases[0]
    every, steps = (2, shared.steps_per_decade / 2) if coarser else (1, shared.steps_per_decade)
    return velocity_jumps(
        height[::every],
        slope[::every],
        np.array([case.load for case in cases]),
        np.array([(case.reach, case.reach * (1 + case.change)) for case in cases]),
        np.array(shared.times),
        np.pi * shared.points,
        steps,
        resolution,
    )


def _error(fine: Jump, coarse: Jump) -> float:
    """Return the largest difference of the relaxing parts over the final friction."""
    parts = [np.append(jump.trace, jump.at) - jump.after for jump in (fine, coarse)]
    return float(np.max(np.abs(parts[0] - parts[1])) / fine.after)


def compute(block: Block[VelocityJump]) -> Result:
    """Solve the cases of a block, each different one once a realisation."""
    from mdr_dask.physics import kinetics, roughness

    shape = (block.cases, len(block.realisations))
    times = len(block.parameters.relaxation_times)
    values = {name: np.full((*shape, times) if MODEL.output(name).dims else shape, np.nan) for name in block.outputs}
    status = np.full(shape, Status.FAILED, np.int8)
    messages: dict[tuple[int, int], str] = {}
    solves = 0
    parameters = [block.case(j) for j in range(block.cases)]
    scales = [case.rms_roughness / case.length for case in parameters]
    resolution = 0.0 if block.accuracy is None else 1e-3 * block.accuracy
    groups: dict[_Case, list[int]] = {}
    for j, parameter in enumerate(parameters):
        groups.setdefault(_case(parameter), []).append(j)
    lines: dict[tuple[object, ...], list[_Case]] = {}
    for case in groups:
        lines.setdefault(case.line(), []).append(case)
    for r, realisation in enumerate(block.realisations):
        for cases in lines.values():
            try:
                amplitude = cases[0].amplitudes()
            except ValueError as problem:
                messages.update({(j, r): str(problem) for case in cases for j in groups[case]})
                continue
            slope_rms = roughness.spectral_slope(amplitude)
            states = [kinetics.CONVERGED] * len(cases)
            found: list[dict[str, float | FloatArray]] = [{"rms_slope": slope_rms} for _ in cases]
            if FROM_JUMP.intersection(block.outputs):
                phase = roughness.phases(block.seed, realisation, cases[0].points // 2)
                nodes = cases[0].points * cases[0].oversampling
                line = roughness.line(amplitude, phase, nodes), roughness.line(amplitude, phase, nodes, 1)
                resolutions = resolution * slope_rms * np.array([case.load for case in cases])
                jumps = _solve(cases, *line, resolutions, False)
                solves += len(cases)
                states = [jump.status for jump in jumps]
                for case, jump, row in zip(cases, jumps, found, strict=True):
                    row |= _outputs(case, jump)
                if "discretisation_error" in block.outputs:
                    coarse = _solve(cases, *line, 0 * resolutions, True)
                    for fine, other, row in zip(jumps, coarse, found, strict=True):
                        row["discretisation_error"] = _error(fine, other)
            for case, state, row in zip(cases, states, found, strict=True):
                for j in groups[case]:
                    status[j, r] = STATUS[state]
                    if state:
                        messages[j, r] = kinetics.MESSAGES[state]
                    for name in block.outputs if state == kinetics.CONVERGED else ():
                        scale = 1.0 if name == "discretisation_error" else scales[j]
                        values[name][j, r] = row[name] * scale
    return Result(values, status, messages, solves)


def _outputs(case: _Case, jump: Jump) -> dict[str, float | FloatArray]:
    """Return the coefficients of friction of a line of unit slope h / L."""
    return {
        "friction_coefficient_before": jump.before / case.load,
        "friction_coefficient_jump": (jump.at - jump.before) / case.load,
        "friction_coefficient_after": jump.after / case.load,
        "friction_coefficient": jump.trace / case.load,
    }


STATUS = (Status.DONE, Status.NOT_CONVERGED, Status.FAILED)


def distinct(block: Block[VelocityJump]) -> int:
    """Return how many different cases a block holds, over all realisations."""
    return len({_case(block.case(j)) for j in range(block.cases)}) * len(block.realisations)


def seconds(block: Block[VelocityJump]) -> float:
    """Estimate the time of a block from nodes and moments."""
    nodes = np.asarray(block.column("points") * block.column("oversampling"), dtype=np.float64)
    per_case = float(np.mean(nodes)) * (SECONDS_NODE + SECONDS_MOMENT * MOMENTS)
    if "discretisation_error" in block.outputs:
        per_case *= 1.4
    return distinct(block) * per_case + 1e-3


def coordinates(parameters: VelocityJump) -> dict[str, Coordinate]:
    """Return the times at which friction is stored."""
    times = np.array(parameters.relaxation_times)
    return {"relaxation_times": Coordinate(times, "1", "time after the jump over the relaxation time, (t - t_0) / tau")}


MODEL = Model(
    name="velocity_jump",
    version=1,
    summary="friction before, at and after a jump of the sliding velocity at constant load",
    parameters=VelocityJump,
    outputs=OUTPUTS,
    compute=compute,
    seconds=seconds,
    coordinates=coordinates,
    distinct=distinct,
)
