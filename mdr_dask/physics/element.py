"""One element of a viscoelastic foundation through one step: pressed at constant speed, or recovering without force.

Units: the static modulus is 1, heights are free, lengths over that of the line, times over one time of the material.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


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


class Scratch(NamedTuple):
    """Room for one element: modes, decay over part of a step, fading of the arms over it, arms, modes again."""

    modes: FloatArray
    decay: FloatArray
    fades: FloatArray
    arms: FloatArray


@njit(nogil=True, cache=True)
def scratch_for(solid: Foundation) -> Scratch:
    """Return room for one element."""
    modes, arms = solid.rates.size, solid.times.size
    return Scratch(np.empty(modes), np.empty(modes), np.empty(arms), np.empty(arms))


@njit(nogil=True, cache=True)
def fading(solid: Foundation, step: float, decay: FloatArray, fades: FloatArray) -> None:
    """Write how modes decay and arms fade over a time."""
    for k in range(decay.size):
        decay[k] = np.exp(-solid.rates[k] * step)
    for m in range(fades.size):
        fades[m] = np.exp(-step / solid.times[m])


@njit(nogil=True, cache=True)
def fly(solid: Foundation, u: float, arms: FloatArray, decay: FloatArray, modes: FloatArray) -> float:
    """Let an element recover without force; `arms` is overwritten."""
    if arms.size == 0:
        return float(u * decay[0])
    extra = 1 if solid.viscosity > 0 else 0
    count = solid.rates.size
    for k in range(count):
        total = solid.inward[k, 0] * u if extra else 0.0
        for m in range(arms.size):
            total += solid.inward[k, m + extra] * arms[m]
        modes[k] = total * decay[k]
    for m in range(arms.size):
        total = 0.0
        for k in range(count):
            total += solid.outward[m + extra, k] * modes[k]
        arms[m] = total
    if extra:
        total = 0.0
        for k in range(count):
            total += solid.outward[0, k] * modes[k]
        return total
    return at_rest(solid, arms)


@njit(nogil=True, cache=True)
def at_rest(solid: Foundation, arms: FloatArray) -> float:
    """Return the displacement without force of an element that has no dashpot."""
    pull, glass = 0.0, 1.0
    for m in range(arms.size):
        pull += solid.moduli[m] * arms[m]
        glass += solid.moduli[m]
    return pull / glass


@njit(nogil=True, cache=True)
def press(
    solid: Foundation, u0: float, u1: float, arms: FloatArray, step: float, fades: FloatArray
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
    for m in range(arms.size):
        tau, fade = solid.times[m], fades[m]
        a = speed * tau
        b = (u0 - arms[m]) - a
        work += solid.moduli[m] * speed * (a * step + b * tau * (1 - fade))
        lost += solid.moduli[m] * (a * a * step / tau + 2 * a * b * (1 - fade) + 0.5 * b * b * (1 - fade * fade))
        arms[m] = u1 - (a + b * fade)
    return work, lost


@njit(nogil=True, cache=True)
def stored(solid: Foundation, u: float, arms: FloatArray) -> float:
    """Return the energy stored in an element."""
    energy = 0.5 * u * u
    for m in range(arms.size):
        energy += 0.5 * solid.moduli[m] * (u - arms[m]) ** 2
    return energy


@njit(nogil=True, cache=True)
def pull(solid: Foundation, u: float, arms: FloatArray) -> float:
    """Return the force of springs and arms."""
    force = 1.0 * u
    for m in range(arms.size):
        force += solid.moduli[m] * (u - arms[m])
    return float(force)


@njit(nogil=True, cache=True)
def release(
    solid: Foundation,
    w0: float,
    w1: float,
    rise0: float,
    rise1: float,
    arms: FloatArray,
    step: float,
    fades: FloatArray,
    room: FloatArray,
) -> tuple[float, float]:
    """Return the part of a step after which an element pressed from w0 to w1 is let go, and where; 1 if it is not.

    `rise0` and `rise1` are the rates of w at both ends; the force is taken as linear between them, w as cubic.
    """
    begin = pull(solid, w0, arms) + solid.viscosity * rise0
    if begin <= 0:
        return 0.0, w0
    room[:] = arms
    press(solid, w0, w1, room, step, fades)
    end = pull(solid, w1, room) + solid.viscosity * rise1
    if end >= 0:
        return 1.0, w1
    part, change = begin / (begin - end), w1 - w0
    bend = (1 - part) * (rise0 * step - change) - part * (rise1 * step - change)
    return part, w0 + part * change + part * (1 - part) * bend


@njit(nogil=True, cache=True)
def flight(
    solid: Foundation,
    u0: float,
    arms: FloatArray,
    part: float,
    leaves: float,
    step: float,
    decay: FloatArray,
    scratch: Scratch,
) -> float:
    """Return where an element is after a step if it is pressed to `leaves` for a part of it and free for the rest."""
    scratch.arms[:] = arms
    if part <= 0:
        return fly(solid, u0, scratch.arms, decay, scratch.modes)
    fading(solid, part * step, scratch.decay, scratch.fades)
    press(solid, u0, leaves, scratch.arms, part * step, scratch.fades)
    fading(solid, (1 - part) * step, scratch.decay, scratch.fades)
    return fly(solid, leaves, scratch.arms, scratch.decay, scratch.modes)


@njit(nogil=True, cache=True)
def advance(
    solid: Foundation,
    u0: float,
    arms: FloatArray,
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
    before = stored(solid, u0, arms)
    if w1 > free:
        if touching:
            work, lost = press(solid, u0, w1, arms, step, fades)
            return w1, True, work, lost
        part = (u0 - w0) / ((u0 - w0) + (w1 - free)) if u0 > w0 else 0.0
        fading(solid, part * step, scratch.decay, scratch.fades)
        u = fly(solid, u0, arms, scratch.decay, scratch.modes) if part > 0 else u0
        loss = before - stored(solid, u, arms) if part > 0 else 0.0
        rest = (1 - part) * step
        fading(solid, rest, scratch.decay, scratch.fades)
        work, lost = press(solid, u, w1, arms, rest, scratch.fades)
        return w1, True, work, lost + loss
    if not touching or part <= 0:
        u = fly(solid, u0, arms, decay, scratch.modes)
        return u, False, 0.0, before - stored(solid, u, arms)
    fading(solid, part * step, scratch.decay, scratch.fades)
    work, lost = press(solid, u0, leaves, arms, part * step, scratch.fades)
    fading(solid, (1 - part) * step, scratch.decay, scratch.fades)
    before = stored(solid, leaves, arms)
    u = fly(solid, leaves, arms, scratch.decay, scratch.modes)
    return u, False, work, lost + before - stored(solid, u, arms)
