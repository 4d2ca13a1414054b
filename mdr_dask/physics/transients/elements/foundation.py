"""One element of a viscoelastic foundation during one step: moved at constant speed, or recovering without force.

`terms` contains the strains of the dashpots of the Prony terms of all elements, shape (n, terms), and i is the index of
one element: passing an index is faster than slicing.

Units: the static modulus is 1, heights are in any unit, lengths in the length of the line, all times in the same unit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.solids import recovery_times


class Foundation(NamedTuple):
    """A solid whose static modulus is 1, and the modes in which its elements recover without force.

    Parameters
    ----------
    moduli, times : array, shape (terms,)
        G_m / G_inf and tau_m.
    viscosity : float
        eta / G_inf of the dashpot; 0 without a dashpot.
    rates : array, shape (modes,)
        Decay rates of the modes, positive. There is one mode for each Prony term, and one more for a dashpot.
    outward, inward : array, shape (modes, modes)
        Transformation from the modes to the state, and back. The state is (u, a_1, ...) with a dashpot, otherwise
        (a_1, ...).
    push : array, shape (modes,)
        Growth rates of the modes of the mean state of all elements under a unit load.
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
    moduli, times : array_like, shape (terms,)
        G_m / G_inf, positive, and tau_m, distinct, in any unit of time.
    viscosity : float
        eta / G_inf in the same unit of time. For a Kelvin solid (no terms) this is 1 if the unit is tau.

    Raises
    ------
    ValueError
        If the solid is elastic, so that nothing relaxes.
    """
    g, tau = (np.asarray(a, dtype=np.float64).reshape(-1) for a in (moduli, times))
    if g.size == 0 and not viscosity > 0:
        raise ValueError("expected a solid with a Prony term or a dashpot, got an elastic one")
    order = np.argsort(tau)
    g, tau = g[order], tau[order]
    pole, weight = (np.append(0.0, tau), np.append(viscosity, g * tau)) if viscosity > 0 else (tau, g * tau)
    zeros, distance = recovery_times(weight, pole)
    # modes of unit displacement, u = 1 and a_m = -lambda / (tau_m - lambda), which are orthogonal with the weights
    modes = -zeros / distance
    modes /= np.sqrt(weight @ modes**2)
    load = np.append(1.0, 0 * g) if viscosity > 0 else g / (1 + g.sum())
    inward = np.ascontiguousarray((weight[:, None] * modes).T)
    return Foundation(g, tau, float(viscosity), 1 / zeros, modes, inward, modes.T @ load)


KELVIN = foundation([], [], 1.0)


class ElementWorkspace(NamedTuple):
    """Work arrays of one element: modes, decay of modes and terms during a part of a step, strains of the terms."""

    modes: FloatArray
    decay: FloatArray
    fades: FloatArray
    terms: FloatArray


@jit
def element_workspace(solid: Foundation) -> ElementWorkspace:
    """Return the workspace of one element."""
    modes, terms = solid.rates.size, solid.times.size
    return ElementWorkspace(np.empty(modes), np.empty(modes), np.empty(terms), np.empty((1, terms)))


class Lapse(NamedTuple):
    """A duration, the decay of modes and terms during it, and the workspace of one element."""

    time: float
    decay: FloatArray
    fades: FloatArray
    workspace: ElementWorkspace


class Rise(NamedTuple):
    """Height of the line at one element at the start and at the end of a duration, and the rates of this height."""

    w0: float
    w1: float
    rise0: float
    rise1: float


class Release(NamedTuple):
    """Separation of an element in a step.

    `part` is the time until the separation as a fraction of the step, or 1 if the element does not separate. `leaves`
    is the displacement at the separation, and `after` the displacement at the end of the step.
    """

    part: float
    leaves: float
    after: float


@jit
def fading(solid: Foundation, step: float, decay: FloatArray, fades: FloatArray) -> None:
    """Write the decay of modes and terms over a duration."""
    for k in range(decay.size):
        decay[k] = np.exp(-solid.rates[k] * step)
    for m in range(fades.size):
        fades[m] = np.exp(-step / solid.times[m])


@jit
def recover(solid: Foundation, u: float, terms: FloatArray, i: int, decay: FloatArray, modes: FloatArray) -> float:
    """Return the displacement of an element after free recovery; its `terms` are overwritten."""
    if solid.times.size == 0:
        return float(u * decay[0])
    extra = 1 if solid.viscosity > 0 else 0
    count = solid.rates.size
    for k in range(count):
        total = solid.inward[k, 0] * u if extra else 0.0
        for m in range(solid.times.size):
            total += solid.inward[k, m + extra] * terms[i, m]
        modes[k] = total * decay[k]
    for m in range(solid.times.size):
        total = 0.0
        for k in range(count):
            total += solid.outward[m + extra, k] * modes[k]
        terms[i, m] = total
    if extra:
        total = 0.0
        for k in range(count):
            total += solid.outward[0, k] * modes[k]
        return total
    return at_rest(solid, terms, i)


@jit
def at_rest(solid: Foundation, terms: FloatArray, i: int) -> float:
    """Return the force-free displacement of an element without a dashpot."""
    pull, glass = 0.0, 1.0
    for m in range(solid.times.size):
        pull += solid.moduli[m] * terms[i, m]
        glass += solid.moduli[m]
    return pull / glass


@jit
def press(
    solid: Foundation, u0: float, u1: float, terms: FloatArray, i: int, step: float, fades: FloatArray
) -> tuple[float, float]:
    """Move an element from u0 to u1 at constant speed; return work and dissipation.

    The difference of work and dissipation is stored. The stretch q = u - a of a term is A + B exp(-t / tau) with A =
    tau du/dt. Work is the integral of f du, dissipation the integral of G q^2 / tau and of eta (du/dt)^2 over time.
    """
    if step <= 0:
        return 0.0, 0.0
    speed = (u1 - u0) / step
    work = 0.5 * (u1 * u1 - u0 * u0) + solid.viscosity * speed * speed * step
    dissipated = solid.viscosity * speed * speed * step
    for m in range(solid.times.size):
        tau, fade = solid.times[m], fades[m]
        a = speed * tau
        b = (u0 - terms[i, m]) - a
        work += solid.moduli[m] * speed * (a * step + b * tau * (1 - fade))
        dissipated += solid.moduli[m] * (a * a * step / tau + 2 * a * b * (1 - fade) + 0.5 * b * b * (1 - fade * fade))
        terms[i, m] = u1 - (a + b * fade)
    return work, dissipated


@jit
def stored(solid: Foundation, u: float, terms: FloatArray, i: int) -> float:
    """Return the energy stored in an element."""
    energy = 0.5 * u * u
    for m in range(solid.times.size):
        energy += 0.5 * solid.moduli[m] * (u - terms[i, m]) ** 2
    return energy


@jit
def pull(solid: Foundation, u: float, terms: FloatArray, i: int) -> float:
    """Return the force of the spring and the Prony terms of an element."""
    force = 1.0 * u
    for m in range(solid.times.size):
        force += solid.moduli[m] * (u - terms[i, m])
    return float(force)


@jit_inline
def release(solid: Foundation, lapse: Lapse, rise: Rise, terms: FloatArray, i: int) -> tuple[float, float]:
    """Return the fraction of a duration after which an element in contact separates, and its displacement at that time.

    The fraction is 1 if the element does not separate. The force is taken as linear in time, the height of the line as
    cubic.
    """
    begin = pull(solid, rise.w0, terms, i) + solid.viscosity * rise.rise0
    if begin <= 0:
        return 0.0, rise.w0
    strains = lapse.workspace.terms
    for m in range(solid.times.size):
        strains[0, m] = terms[i, m]
    press(solid, rise.w0, rise.w1, strains, 0, lapse.time, lapse.fades)
    end = pull(solid, rise.w1, strains, 0) + solid.viscosity * rise.rise1
    if end >= 0:
        return 1.0, rise.w1
    part, change = begin / (begin - end), rise.w1 - rise.w0
    bend = (1 - part) * (rise.rise0 * lapse.time - change) - part * (rise.rise1 * lapse.time - change)
    return part, rise.w0 + part * change + part * (1 - part) * bend


@jit_inline
def free_after(
    solid: Foundation, lapse: Lapse, u0: float, part: float, leaves: float, terms: FloatArray, i: int
) -> float:
    """Return the final displacement of an element that is pressed to `leaves` for a part of a duration, then free."""
    workspace = lapse.workspace
    for m in range(solid.times.size):
        workspace.terms[0, m] = terms[i, m]
    if part <= 0:
        return recover(solid, u0, workspace.terms, 0, lapse.decay, workspace.modes)
    fading(solid, part * lapse.time, workspace.decay, workspace.fades)
    press(solid, u0, leaves, workspace.terms, 0, part * lapse.time, workspace.fades)
    fading(solid, (1 - part) * lapse.time, workspace.decay, workspace.fades)
    return recover(solid, leaves, workspace.terms, 0, workspace.decay, workspace.modes)


@jit_inline
def advance(
    solid: Foundation,
    lapse: Lapse,
    w: tuple[float, float],
    element: tuple[float, bool],
    separation: Release,
    terms: FloatArray,
    i: int,
) -> tuple[float, bool, float, float]:
    """Move one element through a duration; return displacement, contact, work and dissipation; overwrite its `terms`.

    `w` is the displacement at the line (depth plus height) at the start and at the end. `element` contains displacement
    and contact at the start.
    """
    (w0, w1), (u0, touching), step, workspace = w, element, lapse.time, lapse.workspace
    before = stored(solid, u0, terms, i)
    if w1 > separation.after:
        if touching:
            work, dissipated = press(solid, u0, w1, terms, i, step, lapse.fades)
            return w1, True, work, dissipated
        part = (u0 - w0) / ((u0 - w0) + (w1 - separation.after)) if u0 > w0 else 0.0
        fading(solid, part * step, workspace.decay, workspace.fades)
        u = recover(solid, u0, terms, i, workspace.decay, workspace.modes) if part > 0 else u0
        loss = before - stored(solid, u, terms, i) if part > 0 else 0.0
        rest = (1 - part) * step
        fading(solid, rest, workspace.decay, workspace.fades)
        work, dissipated = press(solid, u, w1, terms, i, rest, workspace.fades)
        return w1, True, work, dissipated + loss
    part, leaves = separation.part, separation.leaves
    if not touching or part <= 0:
        u = recover(solid, u0, terms, i, lapse.decay, workspace.modes)
        return u, False, 0.0, before - stored(solid, u, terms, i)
    fading(solid, part * step, workspace.decay, workspace.fades)
    work, dissipated = press(solid, u0, leaves, terms, i, part * step, workspace.fades)
    fading(solid, (1 - part) * step, workspace.decay, workspace.fades)
    before = stored(solid, leaves, terms, i)
    u = recover(solid, leaves, terms, i, workspace.decay, workspace.modes)
    return u, False, work, dissipated + before - stored(solid, u, terms, i)
