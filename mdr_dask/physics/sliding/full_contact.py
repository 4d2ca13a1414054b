"""Full contact of any linear solid with a rough plane: the harmonics are independent.

The displacement is u = d + h, and the pressure of wave k, with the amplitude c_k, is G*(q_k v) c_k (thesis eq. 3.14 for
the Kelvin solid).
The drag is therefore a sum over the spectrum and does not depend on the phases. This is valid if the pressure is
positive everywhere. The pressure is computed at m nodes. Between them, a sum of waves with up to k periods on the line
is at most 1 / cos(pi k / m) times its largest value at the nodes (Ehlich and Zeller, 1964).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.cases import Steady
from mdr_dask.physics.surfaces.waves import Waves, series

OVERSAMPLING = 2  # nodes per Nyquist point: the pressure between nodes is at most 41 % larger
DEEP = 4.0  # ratio of the load to the rms pressure of the waves; below it full contact is too rare to be checked
ROUNDING = 1e-12  # relative rounding error of sums over a spectrum


def steady_full_contact(
    waves: Waves,
    terms: Sequence[tuple[float, float]],
    nodes: tuple[FloatArray, FloatArray],
    deborah: FloatArray,
    loads: FloatArray,
) -> Steady | None:
    """Return the steady states of the cases in full contact, or None if no case is in full contact.

    The status of cases that are not in full contact is `Outcome.INVALID`.

    Parameters
    ----------
    waves : Waves
        Spectrum of the line, whose length is 1.
    terms : sequence of (float, float)
        G_m / G_inf and tau_m v / L of the Prony terms; empty for a Kelvin solid.
    nodes : pair of array, shape (nodes,)
        Heights and slopes of the line on a grid of more than two nodes per shortest wave.
    deborah : array, shape (cases,)
        eta v / (G_inf L) of the dashpot.
    loads : array, shape (cases,)
        F_N / (4 G_inf L), in the unit of height; equal to the mean displacement.

    Examples
    --------
    >>> wave = Waves(np.array([0.5 + 0j]), 2)
    >>> found = steady_full_contact(wave, [], (wave.heights(4), wave.slopes(4)), np.array([0.1]), np.array([5.0]))
    >>> print((found.drag / 0.1).round(4), found.depth)  # De <h'^2>
    [19.7392] [5.]
    """
    height, slope = nodes
    # sums over nodes give the same results as sums over the spectrum; Prony terms only increase the pressure of a wave
    pressure, heaviest = height, np.max(loads, initial=0.0)
    if not heaviest > DEEP * np.sqrt(height @ height / height.size):
        return None
    if terms:
        wave = 2j * np.pi * np.arange(1, waves.coefficients.size + 1)
        relaxing = sum((stiffness * (1 - 1 / (1 + wave * time)) for stiffness, time in terms), np.zeros(1))
        pressure = height + series(waves.coefficients * relaxing, height.size)
    elastic = pressure @ pressure / height.size
    if not heaviest > DEEP * np.sqrt(elastic):
        return None
    lost, stretch = (pressure @ slope / height.size if terms else 0.0), slope @ slope / height.size
    with np.errstate(over="ignore", invalid="ignore"):
        drag = lost + deborah * stretch
        moves = np.isfinite(deborah) & (deborah >= 0 if terms else deborah > 0)
        full = moves & np.isfinite(loads) & (loads > DEEP * np.sqrt(elastic + deborah * (lost + drag)))
    speeds, which = np.unique(deborah[full], return_inverse=True)
    highest, total = np.empty(speeds.size), np.empty(height.size)
    for k, speed in enumerate(speeds):
        np.multiply(slope, speed, out=total)
        total += pressure
        highest[k] = max(total.max(), -total.min())
    full[full] = highest[which] < loads[full] * np.cos(np.pi * waves.coefficients.size / height.size)
    if not np.any(full):
        return None
    status = np.where(full, np.int8(Outcome.CONVERGED), np.int8(Outcome.INVALID))
    slopes, ones = np.full(loads.size, np.sqrt(stretch)), np.ones(loads.size)
    return Steady.of(np.array([drag, loads, ones, slopes]), status)
