"""Full contact of any linear solid with a rough plane.

The problem is linear, and is solved separately for each wave. The displacement is u = d + h, with the depth d and the
height h. The height is a sum of waves. Wave k, with the wavenumber q_k and the amplitude c_k, causes a pressure of
amplitude G*(q_k v) c_k, where G* is the complex modulus (thesis eq. 3.14 for the Kelvin solid). The drag is therefore a
sum over the spectrum and does not depend on the phases.

Contact is full if the pressure is positive everywhere. The pressure is computed at m nodes, two for each Nyquist point.
Between the nodes, the varying part of the pressure may be larger than at the nodes, but at most by a factor of
1 / cos(pi K / m), where K is the number of periods of the shortest wave on the line (Ehlich and Zeller, Z. Angew. Math.
Mech. 44, T22, 1964).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.cases import Cases, Steady
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import series


def steady_full_contact(line: RoughLine, terms: Sequence[tuple[float, float]], cases: Cases) -> Steady:
    """Return the steady states of the cases that are certainly in full contact with a plane.

    All other cases get `Outcome.INVALID`. These include some cases in which contact is barely full, because the
    pressure between the nodes is known only from a bound.

    `terms` contains the pair (G_m / G_inf, tau_m v / L) for each Prony term, and is empty for a Kelvin solid. The
    Deborah number of a case is eta v / (G_inf L), where eta is the viscosity of the dashpot. The load, in the unit of
    height, is F_N / (4 G_inf L). In full contact, the load is equal to the mean displacement.
    """
    deborah, loads = cases
    pressure, slope = line.nodes
    nodes, waves = slope.size, line.roughness.coefficients
    wave = 2j * np.pi * np.arange(1, waves.size + 1)
    if terms:
        relaxing = sum((stiffness * (1 - 1 / (1 + wave * time)) for stiffness, time in terms), np.zeros(wave.size))
        pressure = pressure + series(waves * relaxing, nodes)
    # drag: mean of pressure times slope; the static pressure adds no drag, as the mean of height times slope is 0
    lost, stretch = pressure @ slope / nodes if terms else 0.0, slope @ slope / nodes
    bound = np.cos(np.pi * waves.size / nodes)
    # first test only the nodes with extreme slope or extreme pressure (without the dashpot); the loop tests all nodes
    worst = [pressure.argmin(), pressure.argmax(), slope.argmin(), slope.argmax()]
    with np.errstate(over="ignore", invalid="ignore"):
        drag = lost + deborah * stretch
        pull = np.abs(pressure[worst] + np.multiply.outer(deborah, slope[worst])).max(axis=1)
        full = np.isfinite(deborah) & (deborah >= 0 if terms else deborah > 0) & np.isfinite(loads)
        full &= loads * bound > pull
    for speed in np.unique(deborah[full]):
        total = np.abs(pressure + speed * slope)
        full[(deborah == speed) & (loads * bound <= total.max())] = False
    status = np.where(full, np.int8(Outcome.CONVERGED), np.int8(Outcome.INVALID))
    ones = np.ones(loads.size)
    return Steady.of(np.array([drag, loads, ones, np.sqrt(stretch) * ones]), status)
