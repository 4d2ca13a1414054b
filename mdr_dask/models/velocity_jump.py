"""Kinetics of friction after a jump of the sliding velocity at constant load (thesis chapter 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.base import Block, Coordinate, Model, Output, Result, Status, canonical, quantity
from mdr_dask.models.parts.loading_history import Jump, Protocol, Scale, Trace, pieces, trace
from mdr_dask.models.parts.material import solid_of
from mdr_dask.models.parts.measured_line import line_of
from mdr_dask.models.parts.sliding_body import SlidingBody

if TYPE_CHECKING:
    from mdr_dask.physics.transients.forces import Line
    from mdr_dask.physics.transients.velocity_jump import Jump as Relaxation

SECONDS_NODE, SECONDS_MOMENT = 1.6e-8, 2.7e-9  # for every node of a line, and of a moment
MOMENTS = 60
FLAT = 1e-12  # of the largest height
SAFETY = 1.4  # see docs/kinetics.md for how honest it makes the estimate
SECONDS_STEPPED = 3e-7  # for every node in square: a course of some turns of the line

TIMES = tuple(float(f"{time:.4g}") for time in np.geomspace(1e-4, 20, 54))


class VelocityJump(SlidingBody):
    """A Kelvin body under a constant load on a self-affine line, whose velocity jumps from v_1 to v_1 + dv."""

    rms_roughness: float | None = quantity("m", "rms height h of the roughness", default=None, gt=0)
    velocity: float = quantity("m/s", "sliding velocity v_1 before the jump", gt=0)
    oversampling: int = quantity("1", "grid points for every Nyquist point", default=4, ge=2, le=256, multiple_of=2)
    steps_per_decade: int = quantity("1", "time steps in a factor ten of the time", default=8, ge=6, le=400)
    velocity_change: float = quantity("1", "jump of the velocity dv / v_1", default=0.2, gt=-1)
    protocol: Protocol = Field(default=Jump(), description="the course of velocity and load from t_0 = 0 on")
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

    @property
    def is_general(self) -> bool:
        """Whether it is beyond one jump of a Kelvin body on a generated periodic line."""
        other = self.material is not None or self.profile is not None
        return other or self.indenter.shape != "plane" or self.protocol.shape != "jump"


OUTPUTS = (
    Output("friction_coefficient_before", "1", "coefficient of friction mu_1, steady at v_1"),
    Output("friction_coefficient_jump", "1", "immediate change d_mu_0 of the coefficient of friction"),
    Output("friction_coefficient_after", "1", "coefficient of friction mu_2, steady at v_2"),
    Output("friction_coefficient", "1", "coefficient of friction after the jump", ("relaxation_times",)),
    Output("indentation_depth", "m", "penetration of the mean line", ("relaxation_times",), False),
    Output("rms_slope", "1", "spectral rms slope of the line"),
    Output("discretisation_error", "1", "estimated error of the relaxing part mu - mu_2 over mu_2"),
)
FROM_JUMP = frozenset(output.name for output in OUTPUTS) - {"rms_slope", "indentation_depth"}
FROM_JUMP_OR_LINE = FROM_JUMP | {"rms_slope"}


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
        from mdr_dask.physics.surfaces import roughness

        return roughness.amplitudes(self.points // 2, self.hurst, self.rolloff, self.longest)


def _case(case: VelocityJump) -> _Case:
    assert case.shear_modulus is not None
    assert case.relaxation_time is not None
    assert case.length is not None
    assert case.rms_roughness is not None
    return _Case(
        case.hurst,
        case.points,
        canonical(case.length / case.rolloff_wavelength) if case.rolloff_wavelength else 0.0,
        canonical(case.length / case.longest_wavelength) if case.longest_wavelength else 0.0,
        case.oversampling,
        case.steps_per_decade,
        canonical(case.normal_force / (4 * case.shear_modulus * case.length * case.rms_roughness)),
        canonical(case.velocity * case.relaxation_time / case.length),
        case.velocity_change,
        case.relaxation_times,
    )


def _solve(
    cases: list[_Case], height: FloatArray, slope: FloatArray, accuracies: FloatArray, coarser: bool
) -> list[Relaxation]:
    """Solve the cases of one line on the nodes given, or on every other one with half as many steps."""
    from mdr_dask.physics.transients.velocity_jump import velocity_jumps

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
        accuracies,
    )


def _error(fine: Relaxation, coarse: Relaxation) -> float:
    """Return the largest difference of the relaxing parts, or what is left out, over mu_2, with a margin."""
    if coarse.status:
        return float("inf")  # where a coarse grid has no solution nothing is known
    parts = [np.append(jump.trace, jump.at) - jump.after for jump in (fine, coarse)]
    return SAFETY * max(float(np.max(np.abs(parts[0] - parts[1]))), fine.left_out) / fine.after


def compute(block: Block[VelocityJump]) -> Result:
    """Solve the cases of a block, each different one once a realisation."""
    from mdr_dask.physics.transients import velocity_jump as kinetics

    shape = (block.cases, len(block.realisations))
    times = len(block.parameters.relaxation_times)
    values = {name: np.full((*shape, times) if MODEL.output(name).dims else shape, np.nan) for name in block.outputs}
    status = np.full(shape, Status.FAILED, np.int8)
    messages: dict[tuple[int, int], str] = {}
    solves = 0
    parameters = [block.case(j) for j in range(block.cases)]
    scales = [(case.rms_roughness or 0.0) / (case.length or 1.0) for case in parameters]
    groups = _grouped(parameters)
    lines: dict[tuple[object, ...], list[_Case]] = {}
    for case in groups:
        lines.setdefault(case.line(), []).append(case)
    apart = [j for j, case in enumerate(parameters) if case.is_general or "indentation_depth" in block.outputs]
    for r, realisation in enumerate(block.realisations):
        for cases in lines.values():
            try:
                states, found = _line_results(block, cases, realisation)
            except ValueError as problem:
                messages.update({(j, r): str(problem) for case in cases for j in groups[case]})
                continue
            solves += len(cases) if FROM_JUMP.intersection(block.outputs) else 0
            for case, state, row in zip(cases, states, found, strict=True):
                for j in groups[case]:
                    status[j, r] = STATUS[state]
                    if state:
                        messages[j, r] = kinetics.MESSAGES[state]
                    for name in FROM_JUMP_OR_LINE.intersection(block.outputs) if state == kinetics.CONVERGED else ():
                        scale = 1.0 if name == "discretisation_error" else scales[j]
                        values[name][j, r] = row[name] * scale
        for j in apart:
            _follow(parameters[j], block, (j, r), values, status, messages)
            solves += 1
    return Result(values, status, messages, solves)


def _line_results(
    block: Block[VelocityJump], cases: list[_Case], realisation: int
) -> tuple[list[int], list[dict[str, float | FloatArray]]]:
    """Return status and outputs of the cases of one line, for unit slope h / L."""
    from mdr_dask.physics.surfaces import roughness
    from mdr_dask.physics.transients import velocity_jump as kinetics

    amplitude = cases[0].amplitudes()
    slope_rms = roughness.spectral_slope(amplitude)
    found: list[dict[str, float | FloatArray]] = [{"rms_slope": slope_rms} for _ in cases]
    if not FROM_JUMP.intersection(block.outputs):
        return [kinetics.CONVERGED] * len(cases), found
    turned = roughness.turns(block.seed, realisation, cases[0].points // 2)
    nodes = cases[0].points * cases[0].oversampling
    line = roughness.turned_line(amplitude, turned, nodes), roughness.turned_line(amplitude, turned, nodes, 1)
    jumps = _solve(cases, *line, np.full(len(cases), block.accuracy or 0.0), False)
    for case, jump, row in zip(cases, jumps, found, strict=True):
        row |= _outputs(case, jump)
    if "discretisation_error" in block.outputs:
        alike = np.array([np.inf if jump.left_out > 0 else 0.0 for jump in jumps])
        for fine, coarse, row in zip(jumps, _solve(cases, *line, alike, True), found, strict=True):
            row["discretisation_error"] = _error(fine, coarse)
    return [jump.status for jump in jumps], found


def _grouped(cases: list[VelocityJump]) -> dict[_Case, list[int]]:
    """Return the places of the cases that have the quick solution, by what decides it."""
    groups: dict[_Case, list[int]] = {}
    for j, case in enumerate(cases):
        if not case.is_general:
            groups.setdefault(_case(case), []).append(j)
    return groups


def _follow(
    case: VelocityJump,
    block: Block[VelocityJump],
    place: tuple[int, int],
    values: dict[str, FloatArray],
    status: NDArray[np.int8],
    messages: dict[tuple[int, int], str],
) -> None:
    """Write what following every element gives: all outputs, or the depth alone beside the quick solution of a jump."""
    from mdr_dask.physics.surfaces import roughness

    found, code, sentence = _along(case, roughness.phases(block.seed, block.realisations[place[1]], case.points // 2))
    if case.is_general or code != Status.DONE:
        status[place] = code
    if sentence:
        messages[place] = sentence
    for name in block.outputs if case.is_general else ("indentation_depth",):
        values[name][place] = found.get(name, np.nan)


def _along(case: VelocityJump, phase: FloatArray) -> tuple[dict[str, float | FloatArray], int, str]:
    """Follow a line through a course; return outputs, status and a sentence where it fails."""
    from mdr_dask.physics.transients.elements import CONVERGED, NOT_CONVERGED
    from mdr_dask.physics.transients.protocol import foundation

    try:
        surface = _surface(case, phase)
        static, moduli, relaxation, viscosity = _solid(case)
        course = pieces(case.protocol, case.velocity, case.normal_force, case.velocity_change)
        unit = time_unit(case)
        solid = foundation(np.array(moduli) / static, np.array(relaxation) / unit, viscosity / static / unit)
    except (DataError, ValueError) as problem:
        return {}, Status.FAILED, str(problem)
    scale = Scale(unit, surface.length, 4 * static * surface.length * surface.rms)
    times = np.array(case.relaxation_times)
    found: list[Trace] = []
    for every in (1, 2):
        line = _under(case, surface, every)
        found.append(trace(line, solid, course, case.normal_force, scale, times, case.steps_per_decade / every))
        if found[-1].status != CONVERGED:
            status = Status.NOT_CONVERGED if found[-1].status == NOT_CONVERGED else Status.FAILED
            return {}, status, found[-1].message
    fine, _ = found
    steep = surface.rms / surface.length
    load = case.normal_force / scale.force
    friction, coarser = (np.append(along.drag / along.load, along.at / along.load_at) for along in found)
    largest = max(float(np.max(np.abs(friction))), 1e-300)
    return (
        {
            "friction_coefficient_before": fine.before / load * steep,
            "friction_coefficient_jump": (fine.at / fine.load_at - fine.before / load) * steep,
            "friction_coefficient_after": fine.after * steep,
            "friction_coefficient": fine.drag / fine.load * steep,
            "indentation_depth": fine.depth * surface.rms,
            "rms_slope": surface.slope_rms * steep,
            "discretisation_error": float(np.max(np.abs(friction - coarser))) / largest,
        },
        Status.DONE,
        "",
    )


@dataclass(frozen=True)
class _Surface:
    """A line of length L and rms height h, SI, with heights over h and slopes over h / L."""

    length: float
    rms: float
    height: FloatArray
    slope: FloatArray
    slope_rms: float


def _surface(case: VelocityJump, phase: FloatArray) -> _Surface:
    """Return the line of a case.

    Raises
    ------
    DataError, ValueError
        If there is none, or it is flat.
    """
    from mdr_dask.physics.surfaces import measured, roughness

    if case.profile is not None:
        found = line_of(case.profile)
        rms = measured.rms_height(found.height)
        if not rms > FLAT * float(np.max(np.abs(found.height), initial=0.0)):
            raise DataError(f"expected a rough line, got {case.profile.file.name}, which is flat")
        even = measured.resampled((found.height - found.height.mean()) / rms, found.height.size * case.oversampling)
        return _Surface(found.length, rms, even, measured.spectral_derivative(even, 1.0), measured.rms_slope(even, 1.0))
    assert case.length is not None
    assert case.rms_roughness is not None
    rolloff = case.length / case.rolloff_wavelength if case.rolloff_wavelength else 0.0
    longest = case.length / case.longest_wavelength if case.longest_wavelength else 0.0
    amplitude = roughness.amplitudes(case.points // 2, case.hurst, rolloff, longest)
    nodes = case.points * case.oversampling
    height, slope = (roughness.line(amplitude, phase, nodes, order) for order in (0, 1))
    return _Surface(case.length, case.rms_roughness, height, slope, roughness.spectral_slope(amplitude))


def _solid(case: VelocityJump) -> tuple[float, tuple[float, ...], tuple[float, ...], float]:
    """Return static modulus, moduli and times of the arms, and viscosity, in SI."""
    if case.material is None:
        assert case.shear_modulus is not None
        assert case.relaxation_time is not None
        return case.shear_modulus, (), (), case.shear_modulus * case.relaxation_time
    solid = solid_of(case.material)
    return solid.static_modulus, tuple(solid.moduli), tuple(solid.times), solid.viscosity


def time_unit(case: VelocityJump) -> float:
    """Return tau, in which times are stored: the longest time of the solid's arms and dashpot."""
    static, _, relaxation, viscosity = _solid(case)
    return max([viscosity / static, *relaxation])


def _under(case: VelocityJump, surface: _Surface, every: int) -> Line:
    """Return every so many nodes of a line in units of its length and the rms height, with the indenter."""
    from mdr_dask.physics.surfaces.shapes import mapped
    from mdr_dask.physics.transients.protocol import closed_line, indented_line

    height, slope = surface.height[::every], surface.slope[::every]
    if case.indenter.shape == "plane":
        return closed_line(height, slope)
    coefficient, exponent = case.indenter.power_law()
    steep = mapped(exponent) * coefficient * surface.length**exponent / surface.rms
    return indented_line(np.append(height, height[0]), np.append(slope, slope[0]), steep, exponent)


def _outputs(case: _Case, jump: Relaxation) -> dict[str, float | FloatArray]:
    """Return the coefficients of friction of a line of unit slope h / L."""
    return {
        "friction_coefficient_before": jump.before / case.load,
        "friction_coefficient_jump": (jump.at - jump.before) / case.load,
        "friction_coefficient_after": jump.after / case.load,
        "friction_coefficient": jump.trace / case.load,
    }


STATUS = (Status.DONE, Status.NOT_CONVERGED, Status.FAILED, Status.NOT_CONVERGED)


def distinct(block: Block[VelocityJump]) -> int:
    """Return how many different cases a block holds, over all realisations."""
    cases = [block.case(j) for j in range(block.cases)]
    alone = sum(case.is_general for case in cases)
    return (len({_case(case) for case in cases if not case.is_general}) + alone) * len(block.realisations)


def seconds(block: Block[VelocityJump]) -> float:
    """Estimate the time of a block from nodes and moments."""
    profile = block.parameters.profile
    points = block.column("points") if profile is None else line_of(profile).height.size
    nodes = np.asarray(points * block.column("oversampling"), dtype=np.float64)
    per_case = float(np.mean(nodes)) * (SECONDS_NODE + SECONDS_MOMENT * MOMENTS)
    if "discretisation_error" in block.outputs:
        per_case *= 1.4
    if any(block.case(j).is_general for j in range(block.cases)):
        per_case = float(np.mean(nodes**2)) * SECONDS_STEPPED
    return distinct(block) * per_case + 1e-3


def coordinates(parameters: VelocityJump) -> dict[str, Coordinate]:
    """Return the times at which friction is stored."""
    times = np.array(parameters.relaxation_times)
    return {"relaxation_times": Coordinate(times, "1", "time after the jump over the relaxation time, (t - t_0) / tau")}


MODEL = Model(
    name="velocity_jump",
    version=3,
    summary="friction before, at and after a jump of the sliding velocity at constant load",
    parameters=VelocityJump,
    outputs=OUTPUTS,
    compute=compute,
    seconds=seconds,
    coordinates=coordinates,
    distinct=distinct,
)
