"""Benchmarks of velocity jumps and loading histories.

The reference follows every element in time, or is the same solver on a fine grid.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numba import njit
from references.followed_kelvin import follow_kelvin

from benchmarks.solvers.sliding import power
from benchmarks.solvers.solver import Found, Solver, Truth, one_case
from mdr_dask.models.velocity_jump import MODEL, VelocityJump
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import Waves
from mdr_dask.physics.transients.accuracy import solve_jumps
from mdr_dask.physics.transients.elements.steps import Schedule
from mdr_dask.physics.transients.velocity_jump import MarchRequest

POINTS, RUN_IN, FINEST = 200, 10.0, 32
TIMES = np.geomspace(0.01, 3, 20)


class JumpCase(NamedTuple):
    """A line of 200 Nyquist points, v tau / L before and after a jump, and F_N / (4 G L h)."""

    waves: Waves
    before: float
    after: float
    load: float

    def jumped(self, accuracy: float | None, oversampling: int, per_decade: float | None):
        """Return the solution to an accuracy; with a march if `per_decade` steps are given."""
        loads, deborah = np.array([self.load]), np.array([[self.before, self.after]])
        march = MarchRequest(TIMES, np.pi * POINTS, per_decade) if per_decade else None
        return solve_jumps(RoughLine(self.waves), loads, deborah, accuracy, oversampling, march, bool(march))

    def marched(self, oversampling: int, per_decade: float) -> Found | None:
        """Return the transient by the march of the models, divided by the steady friction after the jump."""
        found = self.jumped(0.01, oversampling, per_decade)
        if found.outcome[0] != Outcome.CONVERGED:
            return None
        last = found.levels.after
        return Found((found.trace[0] - last) / last, found.trace_error[0] / last)

    def levels(self, accuracy: float) -> Found | None:
        """Return friction before the jump, the jump, and friction after it, divided by the friction after it."""
        found = self.jumped(accuracy, 4, None)
        if found.outcome[0] != Outcome.CONVERGED:
            return None
        values, stated = (np.ravel(each[:3]) for each in (found.levels, found.errors))
        return Found(values / values[2], stated / values[2])

    def followed(self, oversampling: int) -> Found:
        """Follow every element from contact at rest, for 10 tau before and after the jump, in steps of up to a cell."""
        nodes = POINTS * oversampling
        height = self.waves.heights(nodes)
        step = 1 / nodes / max(self.before, self.after)
        number = int(RUN_IN / step)
        jump = step * number
        first = step * np.cumsum(np.geomspace(1e-3, 1, 30))  # short steps at first: friction changes fast
        later = np.unique(np.concatenate([first, np.arange(first[-1] + step, RUN_IN, step), TIMES]))
        moments = np.concatenate([step * np.arange(number + 1), jump + later])
        deborahs = np.where(moments <= jump, self.before, self.after)
        travels = np.minimum(moments, jump) * self.before + np.maximum(moments - jump, 0) * self.after
        depth = rest_depth(height, self.load)
        schedule = Schedule(moments, travels, deborahs, np.full(moments.size, self.load))
        state = follow_kelvin(height, self.waves.slopes(nodes), schedule, np.maximum(height + depth, 0), depth)
        return Found(relaxing(moments - jump, state.drag))

    def papers(self, oversampling: int) -> Found:
        """March from rest by the backward Euler method of the papers, for 10 tau at v_1 and 10 tau at v_2."""
        n = POINTS * oversampling
        height = self.waves.heights(n)
        before, after = int(RUN_IN * self.before * n), int(RUN_IN * self.after * n)
        ratios = np.repeat([self.before * n, self.after * n], [before, after])
        drag = np.empty(ratios.size)
        backward_euler(height, ratios, rest_depth(height, self.load), self.load, drag)
        return Found(relaxing((np.arange(ratios.size) - before + 1) / (self.after * n), drag))


def relaxing(moments: np.ndarray, drag: np.ndarray) -> np.ndarray:
    """Return the transient at `TIMES`, divided by the drag at the end."""
    return (np.interp(TIMES, moments, drag) - drag[-1]) / drag[-1]


def rest_depth(height: np.ndarray, load: float) -> float:
    """Return the depth at which the line at rest carries the load."""
    sinks = np.sort(-height)
    carried = (np.arange(1, sinks.size + 1) * sinks - np.cumsum(sinks)) / sinks.size
    return float(np.interp(load, carried, sinks))


@njit(cache=True)
def backward_euler(height: np.ndarray, ratios: np.ndarray, depth: float, load: float, drag: np.ndarray) -> None:
    """March by backward Euler: in every step each element moves on by one cell.

    By Newton's method, the depth follows from the load, which is the sum of max(0, w (1 + r) - r u_old) with r = tau /
    dt.
    """
    n = height.size
    u, old = np.maximum(height + depth, 0.0), np.empty(n)
    for k in range(drag.size):
        r = ratios[k]
        old[0] = u[n - 1]
        old[1:] = u[: n - 1]
        for _ in range(50):
            carried, touching = 0.0, 0
            for i in range(n):
                force = (depth + height[i]) * (1 + r) - r * old[i]
                if force > 0:
                    carried += force
                    touching += 1
            shift = (load * n - carried) / (touching * (1 + r))
            depth += shift
            if abs(shift) < 1e-13 * abs(depth):
                break
        total = 0.0
        for i in range(n):
            force = (depth + height[i]) * (1 + r) - r * old[i]
            u[i] = depth + height[i] if force > 0 else old[i] * r / (1 + r)
            if force > 0:
                total += force * 0.5 * (height[(i + 1) % n] - height[i - 1])
        drag[k] = total


def jump_case(least: float, most: float, random: np.random.Generator) -> JumpCase:
    """Draw a jump of the velocity by a factor between 10^least and 10^most."""
    amplitude = roughness.amplitudes(POINTS // 2, random.uniform())
    waves = Waves(0.5 * amplitude * np.exp(2j * np.pi * random.uniform(size=POINTS // 2)), POINTS)
    before = power(random, -2, -0.7)
    return JumpCase(waves, before, before * power(random, least, most), power(random, -1.5, 0.5))


def transient(least: float, most: float, random: np.random.Generator) -> tuple[JumpCase, Truth]:
    """Draw a jump, with its transient from following every element on two grids, extrapolated at second order."""
    case = jump_case(least, most, random)
    half, finest = (np.asarray(case.followed(grid).values) for grid in (FINEST // 2, FINEST))
    return case, Truth((4 * finest - half) / 3, np.max(np.abs(finest - half)) / 3)


def steady(random: np.random.Generator) -> tuple[JumpCase, Truth] | None:
    """Draw a jump, with its steady levels by the solver at 1e-6."""
    case = jump_case(-1, 1, random)
    exact = case.levels(1e-6)
    return exact and (case, Truth(exact.values, exact.stated, np.abs(exact.values)))


FRICTION = ("friction_coefficient", "friction_coefficient_error")
HISTORY_TIMES = tuple(float(t) for t in np.linspace(0.0, 3.0, 16))
SOLIDS = (
    {"shear_modulus": 1e7, "relaxation_time": 1e-3},
    {"material": {"standard_solid": {"static_modulus": 1e7, "glass_modulus": 1e8, "relaxation_time": 1e-3}}},
    {"material": {"prony": {"static_modulus": 1e7, "moduli": [3e7, 1e7], "times": [1e-4, 1e-3]}}},
)
INDENTERS = ({"shape": "plane"}, {"shape": "parabola", "radius": 0.05}, {"shape": "cone", "angle": 0.01})


def history(random: np.random.Generator) -> tuple[VelocityJump, Truth] | None:
    """Draw a loading history, with its friction on a fine grid with small steps."""
    velocity, force = power(random, -3, 0.5), power(random, -2, 0.5)
    protocols: list[dict[str, object]] = [
        {"shape": "steps", "start": "rest", "times": [0.0], "velocities": [velocity]},
        {"shape": "steps", "times": [0.0, 1e-3], "velocities": [velocity, velocity * power(random, -1, 1)]},
        {"shape": "steps", "times": [1e-3], "velocities": [velocity], "forces": [force * power(random, -1, 1)]},
        {"shape": "ramp", "duration": power(random, -4, -2), "velocity": velocity * power(random, -1, 1)},
        {"shape": "oscillation", "amplitude": velocity * random.uniform(0, 1.5), "frequency": power(random, 1, 3)},
    ]
    case = VelocityJump.model_validate(
        {
            "length": 0.002,
            "points": 20,
            "rms_roughness": 2e-6,
            "hurst": random.uniform(0.3, 1),
            "normal_force": force,
            "velocity": velocity,
            "relaxation_times": HISTORY_TIMES,
            "protocol": protocols[random.integers(len(protocols))],
            "indenter": INDENTERS[random.integers(len(INDENTERS))],
            **SOLIDS[random.integers(len(SOLIDS))],
        }
    )
    exact = by_model(case, 24, 24)
    return exact and (case, Truth(exact.values, exact.stated, np.max(np.abs(exact.values))))


def by_model(case: VelocityJump, oversampling: int, per_decade: int) -> Found | None:
    """Return the friction at all times, and its stated error."""
    found = one_case(
        MODEL, case.model_copy(update={"oversampling": oversampling, "steps_per_decade": per_decade}), FRICTION
    )
    return found and Found(*(found[name] for name in FRICTION))


SOLVERS = (
    Solver(
        "velocity jump",
        {"by up to 20 %": partial(transient, -0.08, 0.08), "up to tenfold": partial(transient, -1, 1)},
        {
            "graded march": {
                f"{grid} nodes a Nyquist point, {steps} steps a decade": partial(
                    JumpCase.marched, oversampling=grid, per_decade=steps
                )
                for grid, steps in ((4, 4), (4, 8), (8, 24), (16, 48))
            },
            "every element": {f"{grid} nodes": partial(JumpCase.followed, oversampling=grid) for grid in (2, 8)},
            "backward Euler (thesis)": {
                f"{grid} nodes": partial(JumpCase.papers, oversampling=grid) for grid in (1, 4, 16)
            },
        },
    ),
    Solver(
        "levels of a jump",
        {"up to tenfold": steady},
        {"accuracy": {f"{a:g}": partial(JumpCase.levels, accuracy=a) for a in (0.05, 0.01, 0.002)}},
    ),
    Solver(
        "loading histories",
        {"random": history},
        {
            "events on patches": {
                f"{grid} nodes, {steps} steps a decade": partial(by_model, oversampling=grid, per_decade=steps)
                for grid, steps in ((4, 6), (8, 12))
            }
        },
    ),
)
