"""A slow reference for steady friction: follow one element along a fine line and sum its losses.

It shares only the equations with the solvers. In a step the displacement is a straight line: that of the line where the
force is not negative, and otherwise that of zero force. Friction is what Prony terms and dashpot dissipate. Grids are
refined until three of them agree.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

PERIODS = 300  # after which no periodic state is found
DEEP = 8  # periods that the next one is made from
CLOSED = 1e-9  # change of the state over a period, relative to the largest displacement
AGREED = 5e-4  # relative change between grids that is small enough
COARSEST, WORK = 2**12, 2**22  # cells to begin with, and cells times Prony terms in the end


@dataclass(frozen=True)
class Body:
    """A linear solid under a line of length 1: static modulus 1, moduli and Deborah numbers of Prony terms, dashpot."""

    moduli: np.ndarray
    deborahs: np.ndarray
    dashpot: float


@dataclass(frozen=True)
class Reference:
    """F_N / (4 G L), the coefficient of friction, and the relative difference of grids in both."""

    load: float
    friction: float
    doubt: float


@njit
def _coefficients(step, deborahs, keep, hold, gain):
    """Write the coefficients of a step: of the term itself, of the displacement before, and of its increase."""
    for m in range(deborahs.size):
        x = step / deborahs[m]
        keep[m] = np.exp(-x)
        gain[m] = 1 + np.expm1(-x) / x if x > 1e-4 else 0.5 * x - x * x / 6
        hold[m] = -np.expm1(-x)


@njit
def _free(u, step, moduli, dashpot, keep, hold, gain, terms):
    """Return the displacement after a step without force."""
    stiffness, pull = 1 + dashpot / step, dashpot / step * u
    for m in range(moduli.size):
        stiffness += moduli[m] * (1 - gain[m])
        pull += moduli[m] * (keep[m] * terms[m] + (hold[m] - gain[m]) * u)
    return pull / stiffness


@njit
def _energy(u, moduli, terms):
    stored = 0.5 * u * u
    for m in range(moduli.size):
        stored += 0.5 * moduli[m] * (u - terms[m]) ** 2
    return stored


@njit
def _move(before, u, keep, hold, gain, terms):
    for m in range(keep.size):
        terms[m] = keep[m] * terms[m] + hold[m] * before + gain[m] * (u - before)


@njit
def _loss(before, u, step, moduli, deborahs, dashpot, terms_before, terms):
    """Return what Prony terms and dashpot lose in a step in which the displacement is a straight line."""
    speed = (u - before) / step
    lost = dashpot * speed * speed * step
    for m in range(moduli.size):
        first, last = before - terms_before[m], u - terms[m]
        if deborahs[m] > step:
            lost += moduli[m] * step / deborahs[m] * (first * first + first * last + last * last) / 3
        else:
            moved = deborahs[m] * (terms[m] - terms_before[m])
            lost += moduli[m] * (speed * moved - 0.5 * (last * last - first * first))
    return lost


@njit
def _pass(w, moduli, deborahs, dashpot, terms, fresh, u, sums):
    """Follow an element from node to node; sums are integrals of u and of the loss, and nodes in contact at the ends.

    `fresh` receives the Prony terms of an element whose terms were zero at the beginning.
    """
    whole = 1 / (w.size - 1)
    keep, hold, gain = np.empty(moduli.size), np.empty(moduli.size), np.empty(moduli.size)
    part_keep, part_hold, part_gain = np.empty(moduli.size), np.empty(moduli.size), np.empty(moduli.size)
    _coefficients(whole, deborahs, keep, hold, gain)
    old = np.empty(moduli.size)
    sums[:] = 0.0
    fresh[:] = 0.0
    was = False
    for i in range(1, w.size):
        step, used_keep, used_hold, used_gain = whole, keep, hold, gain
        free = _free(u, step, moduli, dashpot, keep, hold, gain, terms)
        touching = w[i] >= free
        if touching and not was and u > w[i - 1]:
            # it recovers freely until it touches
            used_keep, used_hold, used_gain = part_keep, part_hold, part_gain
            flight = min((u - w[i - 1]) / (u - w[i - 1] + w[i] - free + 1e-300), 0.999999)
            step = flight * whole
            _coefficients(step, deborahs, part_keep, part_hold, part_gain)
            free = _free(u, step, moduli, dashpot, part_keep, part_hold, part_gain, terms)
            old[:] = terms
            _move(u, free, part_keep, part_hold, part_gain, terms)
            _move(u, free, part_keep, part_hold, part_gain, fresh)
            sums[0] += 0.5 * step * (u + free)
            sums[1] += _loss(u, free, step, moduli, deborahs, dashpot, old, terms)
            u, step = free, whole - step
            _coefficients(step, deborahs, part_keep, part_hold, part_gain)
        then = w[i] if touching else free
        old[:] = terms
        _move(u, then, used_keep, used_hold, used_gain, terms)
        _move(u, then, used_keep, used_hold, used_gain, fresh)
        sums[0] += 0.5 * step * (u + then)
        sums[1] += _loss(u, then, step, moduli, deborahs, dashpot, old, terms)
        sums[2] += touching and (i == 1 or i == w.size - 1)
        u, was = then, touching
    return u


def _ahead(states, images):
    """Return where a fixed point is expected after some states and their images (Anderson)."""
    residual = np.array(images) - np.array(states)
    steps, rises = np.diff(images, axis=0), np.diff(residual, axis=0)
    weights = np.linalg.lstsq(rises.T, residual[-1], rcond=1e-10)[0] if len(rises) else np.zeros(0)
    return images[-1] - weights @ steps if len(rises) else images[-1]


def _solved(w, body, periodic, terms):
    """Return load and loss of a line of nodes, or None where the state is not found or leaves the line."""
    moduli, deborahs, sums, fresh = body.moduli, body.deborahs, np.zeros(3), np.empty(body.moduli.size)
    solid = moduli, deborahs, body.dashpot
    if not periodic:
        terms[:] = 0.0
        u = _pass(w, *solid, terms, fresh, 0.0, sums)
        # beyond the line what is stored is lost, and the integral of u is what dashpot and Prony terms hold
        beyond = body.dashpot * u + moduli @ (deborahs * terms)
        return None if sums[2] else (sums[0] + beyond, sums[1] + _energy(u, moduli, terms))
    lost = -np.expm1(-1 / deborahs)
    u, states, images = max(w[0], 0.0), [], []
    for _ in range(PERIODS):
        began, u_began = terms.copy(), u
        u = _pass(w, *solid, terms, fresh, u, sums)
        # as if the displacement of this period had always been
        terms[:] = fresh / lost
        if max(abs(u - u_began), np.max(np.abs(terms - began), initial=0.0)) < CLOSED * max(w.max(), u):
            return sums[0], sums[1]
        states, images = [*states[-DEEP:], began], [*images[-DEEP:], terms.copy()]
        terms[:] = _ahead(states, images)
    return None


def reference(line, depth, body, periodic=True, agreed=AGREED, work=WORK):
    """Return the steady state at a depth of a function line(nodes) that gives heights at nodes, both ends included."""
    cells, before, earlier = COARSEST, None, np.inf
    terms = np.full(body.moduli.size, np.maximum(depth + line(cells + 1), 0.0).mean())
    while True:
        found = _solved(depth + line(cells + 1), body, periodic, terms)
        if found is None or min(found) <= 0:
            return None
        load, friction = found[0], found[1] / found[0]
        if before is not None:
            change = abs(load / before[0] - 1) + abs(friction / before[1] - 1)
            # two grids may agree by chance
            doubt = max(change, earlier / 3)
            if doubt < agreed or 2 * cells * (body.moduli.size + 1) > work:
                return Reference(load, friction, doubt)
            earlier = change
        cells, before = 2 * cells, (load, friction)


def waves(amplitude, phase):
    """Return the function of a periodic line that is a sum of cosines."""

    def line(nodes):
        spectrum = np.zeros(nodes // 2 + 1, dtype=complex)
        spectrum[1 : amplitude.size + 1] = 0.5 * (nodes - 1) * amplitude * np.exp(1j * phase)
        period = np.fft.irfft(spectrum, nodes - 1)
        return np.append(period, period[0])

    return line


def samples(heights):
    """Return the function of a periodic line of the waves that an even number of samples holds."""
    count = heights.size

    def line(nodes):
        spectrum = np.zeros(nodes // 2 + 1, dtype=complex)
        spectrum[: count // 2 + 1] = np.fft.rfft(heights) * (nodes - 1) / count
        spectrum[count // 2] /= 2
        period = np.fft.irfft(spectrum, nodes - 1)
        return np.append(period, period[0])

    return line
