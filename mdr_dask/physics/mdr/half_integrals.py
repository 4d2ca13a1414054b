"""Matrices of the MDR transforms on graded panels, for functions that are a polynomial inside each panel.

If all functions are written as functions of z = r^2, the two MDR transforms are Abel's half-integrals. Substitutions
remove the square roots, so that Gauss's rule is exact to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline, last_until
from mdr_dask.physics.mdr.transforms import gauss


class Mesh(NamedTuple):
    """Panels between `edges`, and the `nodes` at which the values of a function are given.

    Each panel has `order` nodes: the interior Lobatto points and the right end of the panel. There is no node at the
    first edge, 0, because functions may jump at 0. In a panel, a function is represented by the polynomial through the
    values at the nodes of this panel and, except in the first panel, at the last node of the previous panel.
    `barycentric`, shape (panels, order + 1), contains the weights of barycentric interpolation. In the row of the first
    panel, only the last `order` weights are used.
    """

    edges: FloatArray
    order: int
    nodes: FloatArray
    barycentric: FloatArray


@dataclass(frozen=True, eq=False)
class Panels:
    """Nodes z on [0, 1], and matrices that turn the values u at the nodes into integrals and slopes at the nodes.

    `inner`: (1/pi) int_0^z u(z') / sqrt(z - z') dz'
    `full`: (1/pi) int_0^z u(z') / sqrt(z' (z - z')) dz'
    `outer`: (1/pi) int_z^1 u'(z') / sqrt(z' - z) dz'
    `slope`: u'(z); at the common end of two panels, the slope of u in the left panel
    `weights`: weights of the nodes in int_0^1 u dz
    """

    mesh: Mesh
    inner: FloatArray
    full: FloatArray
    outer: FloatArray
    slope: FloatArray
    weights: FloatArray

    @cached_property
    def nodes(self) -> FloatArray:
        """Nodes of all panels, in ascending order."""
        return self.mesh.nodes


@lru_cache(maxsize=64)
def graded_panels(left: int, right: int, order: int) -> Panels:
    """Return panels on [0, 1], each with `order` > 1 nodes, that become narrower towards both ends.

    The interval [0, 1/2] is halved `left` times towards 0, and the interval [1/2, 1] is halved `right` times towards 1.
    """
    towards_left = 0.5 * 0.5 ** np.arange(left, -1, -1.0)
    towards_right = 1.0 - 0.5 * 0.5 ** np.arange(1.0, right + 1.0)
    edges = np.concatenate([[0.0], towards_left, towards_right, [1.0]])
    interior = np.sort(legendre.legroots(legendre.legder([0.0] * order + [1.0])).real)
    local = np.append(0.5 * (1.0 + interior), 1.0)
    nodes = (edges[:-1, None] + np.diff(edges)[:, None] * local).ravel()
    n = nodes.size
    matrices = tuple(np.zeros((n, n)) for _ in range(4))
    weights = np.zeros(n)
    barycentric = np.zeros((edges.size - 1, order + 1))
    for panel in range(edges.size - 1):
        members = panel_members(panel, order)
        _add_panel(nodes, edges[panel], edges[panel + 1], members, matrices, weights)
        scaled = (nodes[members] - edges[panel]) / (edges[panel + 1] - edges[panel])
        distance = scaled[:, None] - scaled + np.eye(members.size)
        barycentric[panel, -members.size :] = 1.0 / np.prod(distance, axis=1)
    inner, full, outer, slope = matrices
    return Panels(Mesh(edges, order, nodes, barycentric), inner, full, outer, slope, weights)


def panel_members(panel: int, order: int) -> NDArray[np.intp]:
    """Return the indices of the nodes of a panel, preceded by the last node of the previous panel if there is one."""
    return np.arange(max(panel * order - 1, 0), (panel + 1) * order)


def _add_panel(
    nodes: FloatArray,
    low: float,
    high: float,
    members: NDArray[np.intp],
    matrices: tuple[FloatArray, ...],
    weights: FloatArray,
) -> None:
    """Add the contributions of one panel to the matrices, and to the weights of the integral over [0, 1]."""
    inner, full, outer, derivative = matrices
    size = members.size
    scale, middle = 2.0 / (high - low), 0.5 * (low + high)
    to_series = np.linalg.inv(legendre.legvander((nodes[members] - middle) * scale, size - 1))
    to_slope = legendre.legder(np.eye(size), axis=0) @ to_series * scale
    abscissa, weight = gauss(size + 1)
    many, heavy = gauss(2 * size + 8)
    series = legendre.legvander(2.0 * abscissa - 1.0, size - 1)
    weights[members] += (high - low) * weight @ series @ to_series
    own = members[nodes[members] > low]
    derivative[np.ix_(own, members)] = legendre.legvander((nodes[own] - middle) * scale, size - 2) @ to_slope
    rows = np.flatnonzero(nodes > low)
    z = nodes[rows, None]
    first, last = np.sqrt(np.maximum(z - high, 0.0)), np.sqrt(z - low)
    step = first + (last - first) * abscissa
    basis = legendre.legvander((z - step**2 - middle) * scale, size - 1) @ to_series
    inner[np.ix_(rows, members)] += 2.0 / np.pi * (last - first) * np.einsum("k,rkm->rm", weight, basis)
    begin, end = np.arcsin(np.sqrt(low / z)), np.arcsin(np.sqrt(np.minimum(high, z) / z))
    angle = begin + (end - begin) * many
    basis = legendre.legvander((z * np.sin(angle) ** 2 - middle) * scale, size - 1) @ to_series
    full[np.ix_(rows, members)] += 2.0 / np.pi * (end - begin) * np.einsum("k,rkm->rm", heavy, basis)
    rows = np.flatnonzero(nodes < high)
    z = nodes[rows, None]
    first, last = np.sqrt(np.maximum(low - z, 0.0)), np.sqrt(high - z)
    step = first + (last - first) * abscissa
    slope = legendre.legvander((z + step**2 - middle) * scale, size - 2) @ to_slope
    outer[np.ix_(rows, members)] += 2.0 / np.pi * (last - first) * np.einsum("k,rkm->rm", weight, slope)


@jit
def interpolate(mesh: Mesh, values: FloatArray, places: FloatArray) -> FloatArray:
    """Return the piecewise polynomial through `values` at the positions `places`, or 0 from the end of the mesh on."""
    result = np.empty_like(places)
    for number in range(places.size):
        result[number] = value_at(mesh, values, places[number])
    return result


@jit_inline
def value_at(mesh: Mesh, values: FloatArray, place: float) -> float:
    """Return the piecewise polynomial through `values` at the position `place`, or 0 from the end of the mesh on.

    Before the first edge, the polynomial of the first panel is continued.
    """
    if place >= mesh.edges[-1]:
        return 0.0
    order = mesh.order
    panel = last_until(mesh.edges, place, mesh.edges.size - 1)
    above, below = 0.0, 0.0
    for member in range(0 if panel > 0 else 1, order + 1):
        node = panel * order + member - 1
        distance = place - mesh.nodes[node]
        if distance == 0.0:
            return float(values[node])
        share = mesh.barycentric[panel, member] / distance
        above += share * values[node]
        below += share
    return float(above / below)
