"""One element of a viscoelastic foundation through one step: pressed at constant speed, or recovering without force.

Functions take the arms of all elements, shape (n, arms), and the number i of theirs: a view costs more than most do.

Units: the static modulus is 1, heights are free, lengths over that of the line, times over one time of the material.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.compiling import compiled, kernel
from mdr_dask.physics.solids import recovery_times


class Foundation(NamedTuple):
    """A solid whose static modulus is 1, and the modes in which its elements recover without force.

    Parameters
    ----------
    moduli, times : array, shape (arms,)
        G_m / G_inf and tau_m.
    viscosity : float
        eta / G_inf of the dashpot, 0 for none.
    rates : array, shape (modes,)
        Rates of decay of the modes, positive. There is one mode an arm, and one more for a dashpot.
    outward, inward : array, shape (modes, modes)
        From modes to the state (u of a solid with a dashpot, a_1, ...), and back.
    push : array, shape (modes,)
        Growth of the modes of the total under a unit load.
    """

    moduli: FloatArray
    times: FloatArray
    viscosity: float
    rates: FloatArray
    outward: FloatArray
    inward: FloatArray
    push: FloatArray


def foundation(moduli: ArrayLike, times: ArrayLike, viscosity: float) -> Foundation:
    """Return the foundation of a solid, with the modes in which it recovers without force.

    Parameters
    ----------
    moduli, times : array_like, shape (arms,)
        G_m / G_inf, positive, and tau_m, distinct, in the unit of time used.
    viscosity : float
        eta / G_inf in that unit; 1 for the Kelvin body (no arms) if the unit is tau.

    Raises
    ------
    ValueError
        If the solid is elastic, so that nothing relaxes.
    """
    g, tau = (np.asarray(a, dtype=np.float64).reshape(-1) for a in (moduli, times))
    if g.size == 0 and not viscosity > 0:
        raise ValueError("expected a solid with an arm or a dashpot, got an elastic one")
    order = np.argsort(tau)
    g, tau = g[order], tau[order]
    pole, weight = (np.append(0.0, tau), np.append(viscosity, g * tau)) if viscosity > 0 else (tau, g * tau)
    zeros, distance = recovery_times(weight, pole)
    # a mode of unit displacement, u = 1 and a_m = -lambda / (tau_m - lambda): orthogonal under the weights
    modes = -zeros / distance
    modes /= np.sqrt(weight @ modes**2)
    load = np.append(1.0, 0 * g) if viscosity > 0 else g / (1 + g.sum())
    inward = np.ascontiguousarray((weight[:, None] * modes).T)
    return Foundation(g, tau, float(viscosity), 1 / zeros, modes, inward, modes.T @ load)


KELVIN = foundation([], [], 1.0)


class Scratch(NamedTuple):
    """Workspace of one element: modes, decay over part of a step, fading over it, and arms, shape (1, arms)."""

    modes: FloatArray
    decay: FloatArray
    fades: FloatArray
    arms: FloatArray


@kernel
def scratch_for(solid: Foundation) -> Scratch:
    """Return the workspace of one element."""
    modes, arms = solid.rates.size, solid.times.size
    return Scratch(np.empty(modes), np.empty(modes), np.empty(arms), np.empty((1, arms)))


@compiled
def fading(solid: Foundation, step: float, decay: FloatArray, fades: FloatArray) -> None:
    """Write how modes decay and arms fade over a time."""
    for k in range(decay.size):
        decay[k] = np.exp(-solid.rates[k] * step)
    for m in range(fades.size):
        fades[m] = np.exp(-step / solid.times[m])


@compiled
def fly(solid: Foundation, u: float, arms: FloatArray, i: int, decay: FloatArray, modes: FloatArray) -> float:
    """Let an element recover without force; `arms` is overwritten."""
    if solid.times.size == 0:
        return float(u * decay[0])
    extra = 1 if solid.viscosity > 0 else 0
    count = solid.rates.size
    for k in range(count):
        total = solid.inward[k, 0] * u if extra else 0.0
        for m in range(solid.times.size):
            total += solid.inward[k, m + extra] * arms[i, m]
        modes[k] = total * decay[k]
    for m in range(solid.times.size):
        total = 0.0
        for k in range(count):
            total += solid.outward[m + extra, k] * modes[k]
        arms[i, m] = total
    if extra:
        total = 0.0
        for k in range(count):
            total += solid.outward[0, k] * modes[k]
        return total
    return at_rest(solid, arms, i)


@compiled
def at_rest(solid: Foundation, arms: FloatArray, i: int) -> float:
    """Return the displacement without force of an element that has no dashpot."""
    pull, glass = 0.0, 1.0
    for m in range(solid.times.size):
        pull += solid.moduli[m] * arms[i, m]
        glass += solid.moduli[m]
    return pull / glass


@compiled
def press(
    solid: Foundation, u0: float, u1: float, arms: FloatArray, i: int, step: float, fades: FloatArray
) -> tuple[float, float]:
    """Move an element from u0 to u1 at constant speed; return work and loss, whose difference is stored exactly.

    The stretch q = u - a of an arm is A + B exp(-t / tau) with A = tau du/dt; work is the integral of f du, loss that
    of G q^2 / tau and of eta (du/dt)^2.
    """
    if step <= 0:
        return 0.0, 0.0
    speed = (u1 - u0) / step
    work = 0.5 * (u1 * u1 - u0 * u0) + solid.viscosity * speed * speed * step
    lost = solid.viscosity * speed * speed * step
    for m in range(solid.times.size):
        tau, fade = solid.times[m], fades[m]
        a = speed * tau
        b = (u0 - arms[i, m]) - a
        work += solid.moduli[m] * speed * (a * step + b * tau * (1 - fade))
        lost += solid.moduli[m] * (a * a * step / tau + 2 * a * b * (1 - fade) + 0.5 * b * b * (1 - fade * fade))
        arms[i, m] = u1 - (a + b * fade)
    return work, lost


@compiled
def stored(solid: Foundation, u: float, arms: FloatArray, i: int) -> float:
    """Return the energy stored in an element."""
    energy = 0.5 * u * u
    for m in range(solid.times.size):
        energy += 0.5 * solid.moduli[m] * (u - arms[i, m]) ** 2
    return energy


@compiled
def pull(solid: Foundation, u: float, arms: FloatArray, i: int) -> float:
    """Return the force of springs and arms."""
    force = 1.0 * u
    for m in range(solid.times.size):
        force += solid.moduli[m] * (u - arms[i, m])
    return float(force)


@compiled
def release(
    solid: Foundation,
    w0: float,
    w1: float,
    rise0: float,
    rise1: float,
    arms: FloatArray,
    i: int,
    step: float,
    fades: FloatArray,
    workspace: FloatArray,
) -> tuple[float, float]:
    """Return the part of a step after which an element pressed from w0 to w1 is let go, and where; 1 if it is not.

    `rise0` and `rise1` are the rates of w at both ends; the force is taken as linear between them, w as cubic.
    """
    begin = pull(solid, w0, arms, i) + solid.viscosity * rise0
    if begin <= 0:
        return 0.0, w0
    for m in range(solid.times.size):
        workspace[0, m] = arms[i, m]
    press(solid, w0, w1, workspace, 0, step, fades)
    end = pull(solid, w1, workspace, 0) + solid.viscosity * rise1
    if end >= 0:
        return 1.0, w1
    part, change = begin / (begin - end), w1 - w0
    bend = (1 - part) * (rise0 * step - change) - part * (rise1 * step - change)
    return part, w0 + part * change + part * (1 - part) * bend


@compiled
def flight(
    solid: Foundation,
    u0: float,
    arms: FloatArray,
    i: int,
    part: float,
    leaves: float,
    step: float,
    decay: FloatArray,
    scratch: Scratch,
) -> float:
    """Return where an element is after a step if it is pressed to `leaves` for a part of it and free for the rest."""
    for m in range(solid.times.size):
        scratch.arms[0, m] = arms[i, m]
    if part <= 0:
        return fly(solid, u0, scratch.arms, 0, decay, scratch.modes)
    fading(solid, part * step, scratch.decay, scratch.fades)
    press(solid, u0, leaves, scratch.arms, 0, part * step, scratch.fades)
    fading(solid, (1 - part) * step, scratch.decay, scratch.fades)
    return fly(solid, leaves, scratch.arms, 0, scratch.decay, scratch.modes)


@compiled
def advance(
    solid: Foundation,
    u0: float,
    arms: FloatArray,
    i: int,
    touching: bool,
    part: float,
    leaves: float,
    free: float,
    w0: float,
    w1: float,
    step: float,
    decay: FloatArray,
    fades: FloatArray,
    scratch: Scratch,
) -> tuple[float, bool, float, float]:
    """Move one element through a step; return displacement, contact, work and loss. `arms` is overwritten.

    `part` is after which part of the step it is let go if it is, `leaves` where, and `free` where it then ends.
    """
    before = stored(solid, u0, arms, i)
    if w1 > free:
        if touching:
            work, lost = press(solid, u0, w1, arms, i, step, fades)
            return w1, True, work, lost
        part = (u0 - w0) / ((u0 - w0) + (w1 - free)) if u0 > w0 else 0.0
        fading(solid, part * step, scratch.decay, scratch.fades)
        u = fly(solid, u0, arms, i, scratch.decay, scratch.modes) if part > 0 else u0
        loss = before - stored(solid, u, arms, i) if part > 0 else 0.0
        rest = (1 - part) * step
        fading(solid, rest, scratch.decay, scratch.fades)
        work, lost = press(solid, u, w1, arms, i, rest, scratch.fades)
        return w1, True, work, lost + loss
    if not touching or part <= 0:
        u = fly(solid, u0, arms, i, decay, scratch.modes)
        return u, False, 0.0, before - stored(solid, u, arms, i)
    fading(solid, part * step, scratch.decay, scratch.fades)
    work, lost = press(solid, u0, leaves, arms, i, part * step, scratch.fades)
    fading(solid, (1 - part) * step, scratch.decay, scratch.fades)
    before = stored(solid, leaves, arms, i)
    u = fly(solid, leaves, arms, i, scratch.decay, scratch.modes)
    return u, False, work, lost + before - stored(solid, u, arms, i)
