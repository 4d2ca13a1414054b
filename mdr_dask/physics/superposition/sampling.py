"""Draw shifts from their probability density by Hamiltonian Monte Carlo, starting from the most probable shifts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import softmax

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.refine import EPS
from mdr_dask.physics.superposition.posterior import CELLS, STEP_SCATTER, Curves, Solved, solve, step_covariance

HOPS = 2
"""Number of jumps after each move; a jump changes the step between two neighbouring curves. Chosen by trial."""

CHAINS, KEPT = 24, 20
"""Number of chains, and number of draws from each chain. At least as many earlier moves of the chain are discarded.

The 24 x 20 = 480 draws determine the ends of a 95 % interval to about 6 % of its half width.
"""

CONVERGED = 1.1
"""Potential scale reduction factor of the shifts below which chains count as converged, after Gelman and Rubin."""

STEPS = 3
"""Number of integration steps of a Hamiltonian move, chosen by trial.

A move is on average a quarter of an oscillation in a normal density.
"""


def first_guess(curves: Curves) -> FloatArray:
    """Return a first guess of the shifts, shape (curves - 1,).

    For each pair of neighbouring curves, many values of the step between their two shifts are tried. The probabilities
    of these values give the mean and the variance of the step, which are then combined with the prior of the steps.
    """
    steps = np.linspace(-2.0, 2.0, 81)  # in widths of the wider of the two curves
    means, variances = [], []
    for k in range(curves.count - 1):
        pair = (curves.member == k) | (curves.member == k + 1)
        x, member = curves.x[pair], curves.member[pair] - k
        begin = np.array([x[member == 0].min(), x[member == 1].min()])
        aligned = x - begin[member]
        two = replace(curves, x=aligned, y=curves.y[:, pair], member=member, count=2, splines=3 * CELLS + 3)
        width, channels = float(np.ptp(aligned)), curves.y.shape[0]
        rows = np.column_stack([steps * width, np.tile(two.prior[0][1:], (steps.size, 1))])
        # the best step may lie between two tried steps; the noise is therefore at least the resulting error of y
        coarse = curves.height * width * (steps[1] - steps[0]) / np.sqrt(12)
        noise = slice(1 + 2 * channels, 1 + 3 * channels)
        rows[:, noise] = np.maximum(rows[:, noise], np.log(coarse))
        share = softmax(-solve(two, rows).energy)
        mean = float(share @ rows[:, 0])
        means.append(mean + begin[0] - begin[1])
        variances.append(float(share @ (rows[:, 0] - mean) ** 2) + (steps[1] - steps[0]) ** 2)
    prior = step_covariance(curves.count)
    return np.cumsum(prior @ np.linalg.solve(prior + np.diag(variances), means))


def laid_out(curves: Curves, shifts: FloatArray) -> Curves:
    """Return the curves with as many spline coefficients as the shifted curves need.

    The spline extends beyond the shifted curves on both sides by `STEP_SCATTER`.
    """
    moved = curves.x + np.append(0.0, shifts)[curves.member]
    return replace(curves, splines=int(np.ceil((np.ptp(moved) + 2 * STEP_SCATTER) * CELLS)) + 3)


@np.errstate(over="ignore", invalid="ignore")  # moves that diverge are rejected
def draws(curves: Curves, generator: np.random.Generator) -> tuple[Curves, FloatArray]:
    """Return the curves, with the number of `splines` that was used, and a row of parameters for each draw.

    In the first attempt, the position of a chain after every move is a draw. As long as the chains have not converged,
    a longer attempt follows, with a draw after every second, fourth or eighth move. If the chains have not converged
    after the longest attempt, its draws are returned all the same.
    """
    shifts = first_guess(curves)
    curves = laid_out(curves, shifts)
    start = _best(curves, np.append(shifts, curves.prior[0][shifts.size :]), shifts.size)
    start = _best(curves, start)
    curves = laid_out(curves, start[: shifts.size])
    start = _best(curves, start)
    scale = _scale(curves, start)
    place = start + generator.standard_normal((CHAINS, start.size)) @ scale.T
    here, share = solve(curves, place), 1.0
    for _ in range(KEPT):
        place, here, accepted = _moved(curves, place, here, share * scale, generator)
        share = min(share * (1.25 if accepted > 0.8 else 0.75), 1.0)
    for length in (1, 2, 4, 8):
        kept = []
        for _ in range(KEPT):
            for _ in range(length):
                place, here, _ = _moved(curves, place, here, share * scale, generator)
            kept.append(place)
        if _reduction(np.array(kept)[:, :, : shifts.size]) < CONVERGED:
            break
    return curves, np.concatenate(kept)


def _moved(
    curves: Curves, place: FloatArray, here: Solved, scale: FloatArray, generator: np.random.Generator
) -> tuple[FloatArray, Solved, float]:
    """Move all chains by one Hamiltonian move and `HOPS` jumps, each of which may be rejected.

    The last result is the mean acceptance probability of the Hamiltonian moves.
    """
    length = np.pi / 2 / STEPS * generator.uniform(0.7, 1.3, (CHAINS, 1))
    momentum = generator.standard_normal(place.shape)
    speed, new, there = momentum, place, here
    for _ in range(STEPS):
        speed = speed - 0.5 * length * (there.gradient @ scale)
        further = new + length * (speed @ scale.T)
        new = np.where(np.all(np.isfinite(further), axis=1, keepdims=True), further, place)
        there = solve(curves, new)
        speed = speed - 0.5 * length * (there.gradient @ scale)
    rise = there.energy - here.energy + 0.5 * np.sum(speed**2 - momentum**2, axis=1)
    probability = np.exp(-np.clip(np.nan_to_num(rise, nan=np.inf), 0, 700))
    taken = generator.uniform(size=CHAINS) < probability
    place, here = np.where(taken[:, None], new, place), _chosen(taken, there, here)
    for _ in range(HOPS):
        new, rise = _hop(curves, place, generator)
        there = solve(curves, new)
        rise = there.energy - here.energy - rise
        taken = np.log(generator.uniform(size=CHAINS)) < -rise
        place, here = np.where(taken[:, None], new, place), _chosen(taken, there, here)
    return place, here, float(np.mean(probability))


def _reduction(kept: FloatArray) -> float:
    """Return the largest potential scale reduction factor of any parameter, close to 1 if all chains have converged.

    The factor compares the variance of the means of the chains with the variance within the chains (A. Gelman, D. B.
    Rubin, Stat. Sci. 7 (1992) 457). The shape of `kept` is (moves, chains, parameters).
    """
    within = kept.var(axis=0, ddof=1).mean(axis=0)
    between = kept.mean(axis=0).var(axis=0, ddof=1)
    return float(np.sqrt(np.max((len(kept) - 1) / len(kept) + between / np.maximum(within, 1e-300))))


def _chosen(taken: NDArray[np.bool_], new: Solved, old: Solved) -> Solved:
    return replace(
        old,
        energy=np.where(taken, new.energy, old.energy),
        gradient=np.where(taken[:, None], new.gradient, old.gradient),
    )


def _hop(curves: Curves, place: FloatArray, generator: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """In each row, draw one step again; return the new rows and the decrease of the log prior.

    The step is drawn from its prior, given the other steps. A step is the difference between the shifts of two
    neighbouring curves. On a plateau the density has many small maxima; with jumps, a chain passes from one maximum to
    another.
    """
    lines, rows = curves.count - 1, np.arange(place.shape[0])
    known = np.linalg.inv(step_covariance(curves.count))
    steps = np.diff(place[:, :lines], axis=1, prepend=0.0)
    which = generator.integers(lines, size=rows.size)
    old, width = steps[rows, which], known[which, which] ** -0.5
    mean = old - (steps @ known)[rows, which] * width**2
    new = mean + width * generator.standard_normal(rows.size)
    moved = place.copy()
    moved[:, :lines] += (new - old)[:, None] * (np.arange(lines) >= which[:, None])
    return moved, 0.5 * ((new - mean) ** 2 - (old - mean) ** 2) / width**2


def _best(curves: Curves, start: FloatArray, fixed: int = 0) -> FloatArray:
    """Return the most probable parameters; the first `fixed` parameters are not changed."""
    scale = np.eye(start.size)[:, fixed:] if fixed else _scale(curves, start)

    def energy(away: FloatArray) -> tuple[float, FloatArray]:
        found = solve(curves, (start + scale @ away)[None])
        return float(found.energy[0]), found.gradient[0] @ scale

    found = minimize(energy, np.zeros(scale.shape[1]), jac=True, method="L-BFGS-B", options={"maxiter": 300})
    return np.asarray(start + scale @ found.x, dtype=np.float64)


def _scale(curves: Curves, best: FloatArray) -> FloatArray:
    """Return a matrix S such that S S^T approximates the covariance of the parameters."""
    known = curves.prior[1]
    step = np.cbrt(EPS / np.diag(known) ** 1.5)  # balances rounding and truncation errors
    rows = np.concatenate([best + np.diag(step), best - np.diag(step)])
    plus, minus = np.split(solve(curves, rows).gradient, 2)
    bend = (plus - minus) / (2 * step[:, None])
    prior = np.linalg.inv(np.linalg.cholesky(known)).T
    values, vectors = np.linalg.eigh(prior.T @ (bend + bend.T) @ prior / 2)
    return np.asarray(prior @ vectors / np.sqrt(np.maximum(values, 1.0)))
