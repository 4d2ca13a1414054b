"""Motion of one element of a viscoelastic foundation: at constant speed in contact, or in free recovery.

The argument `terms` contains the strains of the dashpots of the Prony terms, with one row for each element, and i is
the index of one element. Functions take the index, because slicing an array would take longer. The static modulus is 1,
and the line has the length 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.solids import recovery_times


class Foundation(NamedTuple):
    """A solid with the static modulus 1, and the modes in which elements of this solid recover without force.

    `moduli` and `times` are G_m / G_inf and tau_m of the Prony terms. `viscosity` is eta / G_inf, or 0 without a
    dashpot. `rates` are the decay rates of the modes. There is one mode for each Prony term, and one more mode if the
    solid itself has a dashpot. The matrix `outward` transforms the modes to the state of an element, and the matrix
    `inward` transforms the state to the modes. The state consists of the strains a_m of the dashpots of the Prony
    terms. If the solid itself has a dashpot, the displacement u is the first entry of the state. `push` contains, for
    each mode, the rate at which a load of 1 increases the mean of this mode over all elements.
    """

    moduli: FloatArray
    times: FloatArray
    viscosity: float
    rates: FloatArray
    outward: FloatArray
    inward: FloatArray
    push: FloatArray


def foundation(moduli: ArrayLike, times: ArrayLike, viscosity: float) -> Foundation:
    """Return a foundation. `moduli` are G_m / G_inf, `times` are the distinct tau_m, and `viscosity` is eta / G_inf.

    For a Kelvin solid (no Prony terms), the viscosity is 1 if the unit of time is tau. A ValueError is raised for a
    solid without Prony terms and without a dashpot.
    """
    g, tau = (np.asarray(a, dtype=np.float64).reshape(-1) for a in (moduli, times))
    if g.size == 0 and not viscosity > 0:
        raise ValueError("expected a viscoelastic solid (with a Prony term or a dashpot), got an elastic one")
    order = np.argsort(tau)
    g, tau = g[order], tau[order]
    pole, weight = (np.append(0.0, tau), np.append(viscosity, g * tau)) if viscosity > 0 else (tau, g * tau)
    zeros, distance = recovery_times(weight, pole)
    # modes with u = 1 and a_m = -z / (tau_m - z), where z is the recovery time of the mode
    modes = -zeros / distance
    modes /= np.sqrt(weight @ modes**2)
    load = np.append(1.0, 0 * g) if viscosity > 0 else g / (1 + g.sum())
    inward = np.ascontiguousarray((weight[:, None] * modes).T)
    return Foundation(g, tau, float(viscosity), 1 / zeros, modes, inward, modes.T @ load)


class Lapse(NamedTuple):
    """A duration, the factors of decay during this duration, and work arrays for one element.

    `decay` contains the factors by which the recovery modes decay. `fades` contains the factors by which the springs of
    the Prony terms relax at constant displacement. `part_decay` and `part_fades` belong to a part of the duration.
    """

    time: float
    decay: FloatArray
    fades: FloatArray
    part_decay: FloatArray
    part_fades: FloatArray
    modes: FloatArray
    strains: FloatArray


@jit
def lapse_of(solid: Foundation, time: float) -> Lapse:
    """Return the `Lapse` of a duration for a solid."""
    modes, terms = solid.rates.size, solid.times.size
    lapse = Lapse(
        time, np.empty(modes), np.empty(terms), np.empty(modes), np.empty(terms), np.empty(modes), np.empty((1, terms))
    )
    fading(solid, time, lapse.decay, lapse.fades)
    return lapse


@jit
def fading(solid: Foundation, step: float, decay: FloatArray, fades: FloatArray) -> None:
    """Write the factors `decay` and `fades` of `Lapse` for the duration `step`."""
    for k in range(decay.size):
        decay[k] = np.exp(-solid.rates[k] * step)
    for m in range(fades.size):
        fades[m] = np.exp(-step / solid.times[m])


@jit
def recover(solid: Foundation, u: float, terms: FloatArray, i: int, decay: FloatArray, modes: FloatArray) -> float:
    """Return the displacement of an element after free recovery, and overwrite its strains in `terms`."""
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
    """Return the displacement at which the force on an element of a solid without a dashpot is zero."""
    pull, glass = 0.0, 1.0
    for m in range(solid.times.size):
        pull += solid.moduli[m] * terms[i, m]
        glass += solid.moduli[m]
    return pull / glass


@jit
def press(solid: Foundation, u0: float, u1: float, terms: FloatArray, i: int, step: float, fades: FloatArray) -> None:
    """Move an element from u0 to u1 at constant speed, and overwrite the strains of this element in `terms`."""
    if step <= 0:
        return
    for m in range(solid.times.size):
        # elongation of the spring of the Prony term after a long time at this speed
        steady = (u1 - u0) / step * solid.times[m]
        terms[i, m] = u1 - (steady + ((u0 - terms[i, m]) - steady) * fades[m])


@jit
def pull(solid: Foundation, u: float, terms: FloatArray, i: int) -> float:
    """Return the force of the spring and the Prony terms of an element."""
    force = 1.0 * u
    for m in range(solid.times.size):
        force += solid.moduli[m] * (u - terms[i, m])
    return float(force)


@jit_inline
def release(
    solid: Foundation, lapse: Lapse, w0: float, w1: float, rise0: float, rise1: float, terms: FloatArray, i: int
) -> tuple[float, float]:
    """Return the fraction of a duration after which an element in contact separates, and the displacement then.

    The displacement changes from w0 to w1. The rates of the displacement are `rise0` at the start and `rise1` at the
    end. The force is taken as a linear function of time, and the displacement as a cubic function of time. If the
    element does not separate, the fraction is 1.
    """
    begin = pull(solid, w0, terms, i) + solid.viscosity * rise0
    if begin <= 0:
        return 0.0, w0
    strains = lapse.strains
    for m in range(solid.times.size):
        strains[0, m] = terms[i, m]
    press(solid, w0, w1, strains, 0, lapse.time, lapse.fades)
    end = pull(solid, w1, strains, 0) + solid.viscosity * rise1
    if end >= 0:
        return 1.0, w1
    part, change = begin / (begin - end), w1 - w0
    bend = (1 - part) * (rise0 * lapse.time - change) - part * (rise1 * lapse.time - change)
    return part, w0 + part * change + part * (1 - part) * bend


@jit_inline
def free_after(
    solid: Foundation, lapse: Lapse, u0: float, part: float, leaves: float, terms: FloatArray, i: int
) -> float:
    """Return the displacement of an element at the end of a duration.

    The element is first moved to the displacement `leaves`, during the fraction `part` of the duration, and is then
    free. The strains at the end are written to `lapse.strains`. `terms` is not changed.
    """
    strains, decay, fades = lapse.strains, lapse.part_decay, lapse.part_fades
    for m in range(solid.times.size):
        strains[0, m] = terms[i, m]
    if part <= 0:
        return recover(solid, u0, strains, 0, lapse.decay, lapse.modes)
    fading(solid, part * lapse.time, decay, fades)
    press(solid, u0, leaves, strains, 0, part * lapse.time, fades)
    fading(solid, (1 - part) * lapse.time, decay, fades)
    return recover(solid, leaves, strains, 0, decay, lapse.modes)


@jit_inline
def advance(
    solid: Foundation,
    lapse: Lapse,
    w0: float,
    w1: float,
    u0: float,
    touching: bool,
    part: float,
    leaves: float,
    after: float,
    terms: FloatArray,
    i: int,
) -> tuple[float, bool]:
    """Move one element through a duration, and return its displacement and whether it is in contact at the end.

    The depth plus height of the line changes from w0 to w1. u0 is the displacement of the element at the start, and
    `touching` is True if the element is in contact at the start. `part` and `leaves` are results of :func:`release` for
    an element in contact. `after` is the displacement at the end of an element that separates or stays free. The
    element is in contact at the end if w1 is larger than `after`.
    """
    if w1 > after:
        rest, fades = lapse.time, lapse.fades
        if not touching:  # contact begins when the gap vanishes; the gap is taken as linear in time
            part = (u0 - w0) / ((u0 - w0) + (w1 - after)) if u0 > w0 else 0.0
            fading(solid, part * lapse.time, lapse.part_decay, lapse.part_fades)
            u0 = recover(solid, u0, terms, i, lapse.part_decay, lapse.modes) if part > 0 else u0
            rest, fades = (1 - part) * lapse.time, lapse.part_fades
            fading(solid, rest, lapse.part_decay, fades)
        press(solid, u0, w1, terms, i, rest, fades)
        return w1, True
    u = free_after(solid, lapse, u0, part if touching else 0.0, leaves, terms, i)
    for m in range(solid.times.size):
        terms[i, m] = lapse.strains[0, m]
    return u, False
