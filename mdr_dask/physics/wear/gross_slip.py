"""Gross slip at constant depth or constant force as the equations of one step, for `wear_evolution.march`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.half_integrals import Panels
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.wear.evolution import FixedBorder, Moment


@dataclass(frozen=True, eq=False)
class GrossSlip(FixedBorder):
    """Slip everywhere; unknowns g at the nodes but the last, a, and the depth d if the force is given."""

    profile: Profile
    panels: Panels
    force: float | None = None
    inner_radius: float = 0.0

    def radii(self, edge: float) -> FloatArray:
        """Return the radii of the nodes for an edge."""
        return np.asarray(edge * np.sqrt(self.panels.nodes))

    def start(self) -> Moment:
        """Return the virgin contact."""
        g = self.profile.image(self.radii(1.0))
        tail = [1.0] if self.force is None else [1.0, 1.0]
        return Moment(0.0, np.append(g[:-1], tail), np.zeros_like(g), 1.0)

    def split(self, unknowns: FloatArray) -> tuple[FloatArray, float, float]:
        """Return g at all nodes, the edge and the depth."""
        last = self.panels.nodes.size - 1
        depth = 1.0 if self.force is None else float(unknowns[-1])
        return np.append(unknowns[:last], depth), float(unknowns[last]), depth

    def pressure(self, unknowns: FloatArray) -> FloatArray:
        """Return p at the nodes."""
        g, a, _ = self.split(unknowns)
        return self.panels.outer @ g / a

    def worn(self, unknowns: FloatArray) -> FloatArray:
        """Return f at the nodes."""
        return self.panels.full @ self.split(unknowns)[0]

    def normal_force(self, unknowns: FloatArray) -> float:
        """Return F_N = 2 int_0^a (d - g) dx."""
        g, a, depth = self.split(unknowns)
        # int_0^1 u dz / sqrt(z) is the last row of the full half-integral of u sqrt(1 - z)
        return float(np.pi * a * self.panels.full[-1] @ ((depth - g) * np.sqrt(1.0 - self.panels.nodes)))

    def residual(self, unknowns: FloatArray, theta: float, known: FloatArray) -> FloatArray:
        """Return f - f0 - known - theta p; then continuity at the edge, and the force."""
        gain = self._gain(unknowns)
        rows = np.append((gain - known - theta * self.pressure(unknowns))[:-1], gain[-1])
        return rows if self.force is None else np.append(rows, self.normal_force(unknowns) - self.force)

    def jacobian(self, unknowns: FloatArray, theta: float) -> FloatArray:
        """Return the derivatives by g."""
        _, a, _ = self.split(unknowns)
        size = unknowns.size
        nodes = self.panels.nodes.size
        result = np.zeros((size, size))
        result[:nodes, :nodes] = self.panels.full
        result[: nodes - 1, :nodes] -= theta / a * self.panels.outer[:-1]
        if self.force is not None:
            result[-1, :nodes] = -np.pi * a * self.panels.full[-1] * np.sqrt(1.0 - self.panels.nodes)
        return result

    def gathered(self, unknowns: FloatArray) -> FloatArray:
        """Return the worn depth."""
        gain = self._gain(unknowns)
        gain[-1] = 0.0
        return gain

    def _gain(self, unknowns: FloatArray) -> FloatArray:
        g, a, _ = self.split(unknowns)
        return np.asarray(self.panels.full @ g - self.profile.height(self.radii(a)))
