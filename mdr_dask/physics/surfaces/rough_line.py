"""A rough line before discretisation: roughness on a plane or on an indenter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.surfaces.cubic_line import CubicLine, highest_point, indented_line, periodic_line
from mdr_dask.physics.surfaces.shapes import PowerLaw
from mdr_dask.physics.surfaces.waves import Waves

SEEN = 8  # the highest point of a line is found on a grid with this many nodes per Nyquist point


@dataclass(frozen=True)
class RoughLine:
    """A rough line on an indenter, or a periodic line on a plane if there is no `body`; the length of the line is 1."""

    roughness: Waves
    body: PowerLaw | None = None

    @property
    def points(self) -> int:
        """Number of Nyquist points (see `Waves`)."""
        return self.roughness.points

    @cached_property
    def nodes(self) -> tuple[FloatArray, FloatArray]:
        """Heights and slopes of the roughness on a grid that has two nodes for each Nyquist point."""
        return self.roughness.heights(2 * self.points), self.roughness.slopes(2 * self.points)

    def through(self, height: FloatArray, slope: FloatArray | None) -> CubicLine:
        """Return the line through heights and slopes; the cells are cubic, or straight if no slopes are given."""
        return periodic_line(height, slope) if self.body is None else indented_line(height, slope, self.body)

    def cubic(self, nodes: int) -> CubicLine:
        """Return the line with `nodes` cubic cells."""
        line = self.through(self.roughness.heights(nodes), self.roughness.slopes(nodes))
        return line._replace(smooth=line.smooth and nodes > self.points)

    def straight(self, nodes: int) -> CubicLine:
        """Return the line with `nodes` straight cells."""
        return self.through(self.roughness.heights(nodes), None)

    def from_summit(self) -> RoughLine:
        """Return a periodic line that begins at its highest point; every grid then has a node at the highest point.

        The line of an indenter is not periodic and is returned as it is.
        """
        if self.body is not None:
            return self
        nodes = SEEN * self.points
        cell, place = highest_point(self.roughness.heights(nodes), self.roughness.slopes(nodes))
        return replace(self, roughness=self.roughness.from_place((cell + place) / nodes))
