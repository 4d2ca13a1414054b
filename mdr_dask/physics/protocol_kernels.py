"""One element of a viscoelastic foundation through one step, and all of them through a course of velocity and load.

Units: the static modulus is 1, heights are free, lengths over that of the line, times over one time of the material.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

CONVERGED, NOT_CONVERGED, OUTSIDE_LINE = 0, 1, 2
DRAG, DEPTH, RATE, CONTACT, STORED, WORK, LOST = range(7)
ROWS = 7
CORRECTIONS = 2  # of the moments of release and the depth within a step


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


class Line(NamedTuple):
    """Heights and slopes at n + 1 nodes of a line of unit length, and whether it closes."""

    height: FloatArray
    slope: FloatArray
    periodic: bool


class State(NamedTuple):
    """All elements at one moment: displacement, strain of the arms, where each would be without contact, contact."""

    displacement: FloatArray
    arms: FloatArray
    free: FloatArray
    touching: BoolArray


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
def _fading(solid: Foundation, step: float, decay: FloatArray, fades: FloatArray) -> None:
    """Write how modes decay and arms fade over a time."""
    for k in range(decay.size):
        decay[k] = np.exp(-solid.rates[k] * step)
    for m in range(fades.size):
        fades[m] = np.exp(-step / solid.times[m])


@njit(nogil=True, cache=True)
def _fly(solid: Foundation, u: float, arms: FloatArray, decay: FloatArray, modes: FloatArray) -> float:
    """Let an element recover without force; `arms` is overwritten."""
    if arms.size == 0:
        return u * decay[0]
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
def _press(
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
def _pull(solid: Foundation, u: float, arms: FloatArray) -> float:
    """Return the force of springs and arms."""
    force = u
    for m in range(arms.size):
        force += solid.moduli[m] * (u - arms[m])
    return force


@njit(nogil=True, cache=True)
def _release(
    solid: Foundation, w0: float, w1: float, arms: FloatArray, step: float, fades: FloatArray, room: FloatArray
) -> float:
    """Return the part of a step after which an element pressed along it is let go; 1 if it is not."""
    speed = (w1 - w0) / step
    begin = _pull(solid, w0, arms) + solid.viscosity * speed
    if begin <= 0:
        return 0.0
    room[:] = arms
    _press(solid, w0, w1, room, step, fades)
    end = _pull(solid, w1, room) + solid.viscosity * speed
    return 1.0 if end >= 0 else begin / (begin - end)


@njit(nogil=True, cache=True)
def _flight(
    solid: Foundation,
    u0: float,
    arms: FloatArray,
    part: float,
    w0: float,
    w1: float,
    step: float,
    decay: FloatArray,
    scratch: Scratch,
) -> float:
    """Return where an element is after a step if it is pressed for a part of it and free for the rest."""
    scratch.arms[:] = arms
    if part <= 0:
        return _fly(solid, u0, scratch.arms, decay, scratch.modes)
    u = w0 + part * (w1 - w0)
    _fading(solid, part * step, scratch.decay, scratch.fades)
    _press(solid, w0, u, scratch.arms, part * step, scratch.fades)
    _fading(solid, (1 - part) * step, scratch.decay, scratch.fades)
    return _fly(solid, u, scratch.arms, scratch.decay, scratch.modes)


@njit(nogil=True, cache=True)
def advance(
    solid: Foundation,
    u0: float,
    arms: FloatArray,
    touching: bool,
    part: float,
    free: float,
    w0: float,
    w1: float,
    step: float,
    decay: FloatArray,
    fades: FloatArray,
    scratch: Scratch,
) -> tuple[float, bool, float, float]:
    """Move one element through a step; return displacement, contact, work and loss. `arms` is overwritten.

    `part` is after which part of the step it is let go if it is, `free` where it then ends.
    """
    before = stored(solid, u0, arms)
    if w1 > free:
        if touching:
            work, lost = _press(solid, u0, w1, arms, step, fades)
            return w1, True, work, lost
        part = (u0 - w0) / ((u0 - w0) + (w1 - free)) if u0 > w0 else 0.0
        _fading(solid, part * step, scratch.decay, scratch.fades)
        u = _fly(solid, u0, arms, scratch.decay, scratch.modes) if part > 0 else u0
        loss = before - stored(solid, u, arms) if part > 0 else 0.0
        rest = (1 - part) * step
        _fading(solid, rest, scratch.decay, scratch.fades)
        work, lost = _press(solid, u, w1, arms, rest, scratch.fades)
        return w1, True, work, lost + loss
    if not touching or part <= 0:
        u = _fly(solid, u0, arms, decay, scratch.modes)
        return u, False, 0.0, before - stored(solid, u, arms)
    u = u0 + part * (w1 - u0)
    _fading(solid, part * step, scratch.decay, scratch.fades)
    work, lost = _press(solid, u0, u, arms, part * step, scratch.fades)
    _fading(solid, (1 - part) * step, scratch.decay, scratch.fades)
    before = stored(solid, u, arms)
    u = _fly(solid, u, arms, scratch.decay, scratch.modes)
    return u, False, work, lost + before - stored(solid, u, arms)


@njit(nogil=True, cache=True)
def under_elements(line: Line, travel: float, under: FloatArray, slope_under: FloatArray) -> int:
    """Write height and slope over every element after a travel, from cubic cells; return the whole cells of it."""
    n = under.size
    cells = travel * n
    shift = int(np.floor(cells))
    y = cells - shift
    a0, a1 = (1 + 2 * y) * (1 - y) ** 2, y * y * (3 - 2 * y)
    b0, b1 = y * (1 - y) ** 2 / n, y * y * (y - 1) / n
    g0, k0, k1 = 6 * y * (y - 1) * n, (1 - y) * (1 - 3 * y), y * (3 * y - 2)
    i = shift % n
    for j in range(n):
        under[j] = a0 * line.height[i] + a1 * line.height[i + 1] + b0 * line.slope[i] + b1 * line.slope[i + 1]
        slope_under[j] = g0 * (line.height[i] - line.height[i + 1]) + k0 * line.slope[i] + k1 * line.slope[i + 1]
        i = i + 1 if i + 1 < n else 0
    return shift


@njit(nogil=True, cache=True)
def depth_for(under: FloatArray, free: FloatArray, mean: float, depth: float) -> tuple[float, bool]:
    """Find the depth at which the mean displacement max(d + p, free) has its value; convex and increasing in d."""
    n = under.size
    for _ in range(200):
        total, touching = 0.0, 0
        for j in range(n):
            w = depth + under[j]
            if w > free[j]:
                total += w
                touching += 1
            else:
                total += free[j]
        if touching == 0:
            nearest = np.inf
            for j in range(n):
                nearest = min(nearest, free[j] - under[j])
            if abs(total - mean * n) <= 1e-12 * abs(mean) * n:
                return nearest, True
            depth = nearest + (mean * n - total)
            continue
        step = (mean * n - total) / touching
        depth += step
        if abs(step) <= 1e-12 * (abs(depth) + abs(mean)):
            return depth, True
    return depth, False


@njit(nogil=True, cache=True)
def _forces(
    gaps: FloatArray, pulls: FloatArray, slope: FloatArray, damping: float, rate: float, reach: float, first: int
) -> tuple[float, float, float]:
    """Return mean load, drag and fraction in contact; edges are placed inside the cells by linear interpolation.

    `first` is the element at the start of the line, behind which there is none if the line does not close, else -1.
    """
    n = gaps.size
    load, drag, length = 0.0, 0.0, 0.0
    gap0, f0, s0 = gaps[n - 1], pulls[n - 1] + damping * (rate + reach * slope[n - 1]), slope[n - 1]
    for j in range(n):
        gap1, f1, s1 = gaps[j], pulls[j] + damping * (rate + reach * slope[j]), slope[j]
        low, high = 0.0, 1.0
        if (gap0 < 0 and gap1 < 0) or j == first:
            high = 0.0
        elif gap0 < 0:
            low = gap0 / (gap0 - gap1)
        elif gap1 < 0:
            high = gap0 / (gap0 - gap1)
        if f0 <= 0 and f1 <= 0:
            high = low
        elif f0 < 0:
            low = max(low, f0 / (f0 - f1))
        elif f1 < 0:
            high = min(high, f0 / (f0 - f1))
        if high > low:
            width, middle = high - low, 0.5 * (low + high)
            f, s = f0 + (f1 - f0) * middle, s0 + (s1 - s0) * middle
            load += width * f
            drag += width * (f * s + width * width / 12 * (f1 - f0) * (s1 - s0))
            length += width
        gap0, f0, s0 = gap1, f1, s1
    return load / n, drag / n, length / n


@njit(nogil=True, cache=True)
def _balance(
    solid: Foundation,
    state: State,
    under: FloatArray,
    slope: FloatArray,
    depth: float,
    rate: float,
    reach: float,
    load: float,
    gaps: FloatArray,
    pulls: FloatArray,
    first: int,
) -> tuple[float, float, float]:
    """Return the rate of the depth that carries the load (of a dashpot), drag and fraction in contact."""
    for j in range(under.size):
        gaps[j] = depth + under[j] - state.free[j]
        pulls[j] = _pull(solid, depth + under[j], state.arms[j])
    carried, drag, length = _forces(gaps, pulls, slope, solid.viscosity, rate, reach, first)
    if solid.viscosity == 0:
        return rate, drag, length
    for _ in range(60):
        if length <= 0 or abs(carried - load) <= 1e-11 * load:
            break
        rate += (load - carried) / (length * solid.viscosity)
        carried, drag, length = _forces(gaps, pulls, slope, solid.viscosity, rate, reach, first)
    return rate, drag, length


@njit(nogil=True, cache=True)
def mean_after(solid: Foundation, state: State, load: float, next_load: float, step: float, modes: FloatArray) -> float:
    """Return the mean displacement that the course of the load decides, whatever is in contact."""
    n, extra = state.displacement.size, 1 if solid.viscosity > 0 else 0
    count, arms = solid.rates.size, solid.times.size
    modes[:] = 0.0
    for j in range(n):
        for k in range(count):
            if extra:
                modes[k] += solid.inward[k, 0] * state.displacement[j] / n
            for m in range(arms):
                modes[k] += solid.inward[k, m + extra] * state.arms[j, m] / n
    for k in range(count):
        z = solid.rates[k] * step
        one = -np.expm1(-z) / z
        late = (1 - one) / z if z > 1e-3 else 0.5 - z / 6 + z * z / 24
        modes[k] = modes[k] * np.exp(-z) + solid.push[k] * step * (load * (one - late) + next_load * late)
    glass, total = 1.0, 0.0
    if extra:
        for k in range(count):
            total += solid.outward[0, k] * modes[k]
        return total
    for m in range(arms):
        glass += solid.moduli[m]
        for k in range(count):
            total += solid.moduli[m] * solid.outward[m, k] * modes[k]
    return (next_load + total) / glass


@njit(nogil=True, cache=True)
def _instant(
    solid: Foundation, state: State, under: FloatArray, load: float, depth: float
) -> tuple[float, float, bool]:
    """Bring elements without a dashpot under a load at once; return the depth and the work, all of which is stored."""
    n = under.size
    mean, work, glass = 0.0, 0.0, 1.0 + solid.moduli.sum()
    for j in range(n):
        state.free[j] = at_rest(solid, state.arms[j])
        mean += state.free[j] / n
    depth, good = depth_for(under, state.free, mean + load / glass, depth)
    for j in range(n):
        before = stored(solid, state.displacement[j], state.arms[j])
        w = depth + under[j]
        state.touching[j] = w > state.free[j]
        state.displacement[j] = max(w, state.free[j])
        work += stored(solid, state.displacement[j], state.arms[j]) - before
    return depth, work / n, good


@njit(nogil=True, cache=True)
def _forget(solid: Foundation, state: State, old: int, new: int) -> float:
    """Replace elements that have left the line by undeformed ones; return the energy that they will lose."""
    n, lost = state.displacement.size, 0.0
    for j in range(n):
        if (j + old) // n != (j + new) // n:
            lost += stored(solid, state.displacement[j], state.arms[j])
            state.displacement[j] = state.free[j] = 0.0
            state.arms[j, :] = 0.0
            state.touching[j] = False
    return lost / n


@njit(nogil=True, cache=True)
def follow_elements(
    solid: Foundation,
    line: Line,
    moments: FloatArray,
    travels: FloatArray,
    reaches: FloatArray,
    loads: FloatArray,
    state: State,
    depth: float,
    out: FloatArray,
) -> int:
    """March all elements through the moments and write `out`, shape (ROWS, moments)."""
    n, scratch = line.height.size - 1, scratch_for(solid)
    under, grade, below = np.empty(n), np.empty(n), np.empty(n)
    gaps, pulls, parts = np.empty(n), np.empty(n), np.empty(n)
    decay, fades, modes = np.empty(solid.rates.size), np.empty(solid.times.size), np.empty(solid.rates.size)
    shift = under_elements(line, travels[0], under, grade)
    rate, work, lost = 0.0, 0.0, 0.0
    if solid.viscosity == 0:
        depth, work, good = _instant(solid, state, under, loads[0], depth)
        if not good:
            return NOT_CONVERGED
    for now in range(moments.size):
        if now > 0:
            step = moments[now] - moments[now - 1]
            below[:] = under
            old_depth, old_shift = depth, shift
            shift = under_elements(line, travels[now], under, grade)
            if not line.periodic and shift != old_shift:
                lost += _forget(solid, state, old_shift, shift)
            _fading(solid, step, decay, fades)
            mean = mean_after(solid, state, loads[now - 1], loads[now], step, modes)
            depth += rate * step
            for j in range(n):
                parts[j] = 0.0
                state.free[j] = _flight(
                    solid, state.displacement[j], state.arms[j], 0.0, 0.0, 0.0, step, decay, scratch
                )
            for _ in range(CORRECTIONS):
                depth, good = depth_for(under, state.free, mean, depth)
                if not good:
                    return NOT_CONVERGED
                for j in range(n):
                    if state.touching[j]:
                        w0, w1 = state.displacement[j], depth + under[j]
                        parts[j] = _release(solid, w0, w1, state.arms[j], step, fades, scratch.arms)
                        part = parts[j] if parts[j] < 1 else 0.0
                        state.free[j] = _flight(solid, w0, state.arms[j], part, w0, w1, step, decay, scratch)
            depth, good = depth_for(under, state.free, mean, depth)
            if not good:
                return NOT_CONVERGED
            for j in range(n):
                w0, w1 = old_depth + below[j], depth + under[j]
                u, touching, done, gone = advance(
                    solid,
                    state.displacement[j],
                    state.arms[j],
                    state.touching[j],
                    parts[j],
                    state.free[j],
                    w0,
                    w1,
                    step,
                    decay,
                    fades,
                    scratch,
                )
                state.displacement[j], state.touching[j] = u, touching
                work += done / n
                lost += gone / n
            if solid.viscosity == 0:
                rate = (depth - old_depth) / step
        first = -1 if line.periodic else (-shift) % n
        if not line.periodic and (state.touching[first] or state.touching[(first - 1) % n]):
            return OUTSIDE_LINE
        rate, drag, length = _balance(
            solid, state, under, grade, depth, rate, reaches[now], loads[now], gaps, pulls, first
        )
        energy = 0.0
        for j in range(n):
            energy += stored(solid, state.displacement[j], state.arms[j]) / n
        out[DRAG, now], out[DEPTH, now], out[RATE, now], out[CONTACT, now] = drag, depth, rate, length
        out[STORED, now], out[WORK, now], out[LOST, now] = energy, work, lost
    return CONVERGED


@njit(nogil=True, cache=True)
def orbit(solid: Foundation, line: Line, reach: float, depth: float, state: State, turns: int) -> tuple[bool, float]:
    """Carry one element along the line at constant depth until it comes back as it was; fill all elements from it.

    Return whether it did, and its displacement at the end.
    """
    n, scratch = line.height.size - 1, scratch_for(solid)
    step = 1 / (n * reach)
    decay, fades = np.empty(solid.rates.size), np.empty(solid.times.size)
    _fading(solid, step, decay, fades)
    arms, last = np.zeros(solid.times.size), np.zeros(solid.times.size)
    top = int(np.argmax(line.height[:n])) if line.periodic else 0
    w0 = depth + line.height[top]
    u, touching = max(w0, 0.0), w0 > 0
    for _ in range(turns if line.periodic else 1):
        last[:] = arms
        before = u
        for cell in range(n):
            i = (top + cell) % n
            state.displacement[i], state.touching[i] = u, touching
            state.arms[i, :] = arms
            w0, w1 = depth + line.height[i], depth + line.height[i + 1]
            part = _release(solid, w0, w1, arms, step, fades, scratch.arms) if touching else 0.0
            used = part if part < 1 else 0.0
            free = _flight(solid, u, arms, used, w0, w1, step, decay, scratch)
            state.free[(i + 1) % n] = free
            u, touching, _, _ = advance(solid, u, arms, touching, part, free, w0, w1, step, decay, fades, scratch)
        change = abs(u - before)
        for m in range(arms.size):
            change = max(change, abs(arms[m] - last[m]))
        if line.periodic and change <= 1e-13 * abs(u):
            return True, u
    if not line.periodic:
        state.free[0] = 0.0
    return not line.periodic, u
