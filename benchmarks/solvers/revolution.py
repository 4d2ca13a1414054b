"""Benchmarks of worn profiles by all rules."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from references.literal_wear import literal

from benchmarks.solvers.sliding import power
from benchmarks.solvers.solver import Found, Solver, Truth
from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.wear.accuracy import checked_exact
from mdr_dask.physics.wear.exact import exact
from mdr_dask.physics.wear.history import LoadBlock, history
from mdr_dask.physics.wear.rules import fast
from mdr_dask.physics.wear.worn import Worn, virgin_load

FEW = 20.0  # largest amount of wear for which every cycle is simulated


class Wearing(NamedTuple):
    """A wear problem: a body r^n, its c / a0 (0 for gross slip), and the amount of wear.

    `held` states whether the force (or else the depth) is constant; results are compared at `radii`.
    """

    profile: PowerProfile
    stick: float
    amount: float
    held: bool
    radii: np.ndarray = np.zeros(1)

    @property
    def scale(self) -> float:
        """Largest wear depth over indentation depth."""
        return 1 - float(self.profile.image(np.array(self.stick)))

    def heights(self, worn: Worn) -> Found:
        """Return a worn profile without a stated error."""
        return Found(worn.height(self.radii))

    def exact(self, accuracy: float) -> Found:
        """Return the worn profile by the exact rule, and its error."""
        outputs, force = ["height"], self.held
        ((worn, errors),) = checked_exact(
            self.profile, self.stick, [self.amount], outputs, self.radii, accuracy, constant_force=force
        )
        return Found(worn.height(self.radii), np.full(self.radii.size, errors["height"]))

    def by_blocks(self, cells: int) -> Found:
        """Return the worn profile for one block of load, in steps on a uniform grid."""
        kept = {"force": 2 * virgin_load(self.profile, 1.0)} if self.held else {"depth": 1.0}
        block = LoadBlock(self.amount, self.scale if self.stick > 0 else np.inf, **kept)
        return self.heights(history(self.profile, [block], cells=cells)[0])

    def by_fast_rule(self) -> Found | None:
        """Return the worn profile by the fast rule of the thesis."""
        if self.held or self.stick == 0:
            return None
        return self.heights(fast(self.profile, self.stick, self.amount, 0.8))

    def by_cycles(self, cells: int) -> Found | None:
        """Return the worn profile by simulating every cycle."""
        if self.stick == 0 or self.amount > FEW:
            return None
        radii, height, _ = literal(self.profile, self.stick, self.amount, cells=cells, constant_force=self.held)
        worn = height - self.profile.height(radii)
        return Found(self.profile.height(self.radii) + np.interp(self.radii, radii, worn, right=0.0))


def wearing(slips: bool, held: bool, random: np.random.Generator) -> tuple[Wearing, Truth]:
    """Draw a body and an amount of wear; the truth is the exact rule at 1e-4."""
    stick = 0.0 if slips else random.uniform(0.1, 0.95)
    case = Wearing(PowerProfile(power(random, -0.2, 0.9)), stick, power(random, -1, 1), held)
    (worn,) = exact(case.profile, stick, [case.amount], 3e-5, constant_force=held)
    case = case._replace(radii=np.linspace(0, 1.2 * worn.contact_radius, 400))
    return case, Truth(worn.height(case.radii), 3e-5, case.scale)


SOLVERS = (
    Solver(
        "wear",
        {
            "depth held": partial(wearing, False, False),
            "force held": partial(wearing, False, True),
            "gross slip": partial(wearing, True, False),
        },
        {
            "exact rule": {f"accuracy {a:g}": partial(Wearing.exact, accuracy=a) for a in (0.1, 0.01, 1e-3)},
            "fast rule": {"ξ = 0.8": Wearing.by_fast_rule},
            "blocks of load": {f"{cells} cells": partial(Wearing.by_blocks, cells=cells) for cells in (50, 200)},
            "every cycle (thesis)": {f"{cells} cells": partial(Wearing.by_cycles, cells=cells) for cells in (50, 100)},
        },
        rounds=2,
    ),
)
