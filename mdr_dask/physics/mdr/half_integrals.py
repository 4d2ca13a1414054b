"""Matrices of both transforms on graded panels.

The matrices are exact for functions that are a polynomial inside each panel.

As functions of z, the square of the radius, both transforms of the MDR are Abel's half-integrals. The substitution
``z' = z - t^2`` turns the integrands into polynomials in t, which Gauss's rule integrates exactly. All contacts are
scaled to the interval [0, 1], so that one set of matrices is enough.
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
    """The panels (intervals) and nodes on which a function is a piecewise polynomial.

    The first panel begins at 0. There is no node at 0, because functions may jump there.

    Parameters
    ----------
    edges : array, shape (panels + 1,)
        Ends of the panels.
    order : int
        Number of nodes per panel: the interior Lobatto points and the right end.
    nodes : array, shape (n,)
        Nodes of all panels, increasing.
    barycentric : array, shape (panels, order + 1)
        Barycentric weights for the interpolation inside each panel. The first panel has no node at its left end, and
        uses only the last `order` weights.
    """

    edges: FloatArray
    order: int
    nodes: FloatArray
    barycentric: FloatArray

    def extended(self, end: float) -> Mesh:
        """Return the mesh with an additional last panel, which ends at `end`."""
        last = self.edges[-1]
        local = (self.nodes[-self.order :] - self.edges[-2]) / (last - self.edges[-2])
        nodes = np.append(self.nodes, last + (end - last) * local)
        return Mesh(np.append(self.edges, end), self.order, nodes, np.vstack([self.barycentric, self.barycentric[-1:]]))


@dataclass(frozen=True, eq=False)
class Panels:
    """Nodes on [0, 1], and matrices for functions that are given by their values u at the nodes.

    The product of a matrix and u contains the expression stated below, with z equal to the position of each node. The
    last node is at 1.

    Parameters
    ----------
    mesh : Mesh
        The panels, with n nodes.
    inner : array, shape (n, n)
        (1/pi) int_0^z u(z') / sqrt(z - z') dz'.
    full : array, shape (n, n)
        (1/pi) int_0^z u(z') / sqrt(z' (z - z')) dz'.
    outer : array, shape (n, n)
        (1/pi) int_z^1 u'(z') / sqrt(z' - z) dz'.
    slope : array, shape (n, n)
        u'(z). At the common end of two panels, this is the slope in the left panel.
    weights : array, shape (n,)
        Weights of the integral int_0^1 u dz.
    """

    mesh: Mesh
    inner: FloatArray
    full: FloatArray
    outer: FloatArray
    slope: FloatArray
    weights: FloatArray

    @cached_property
    def nodes(self) -> FloatArray:
        """Nodes of all panels, increasing."""
        return self.mesh.nodes


@lru_cache(maxsize=64)
def graded_panels(left: int, right: int, order: int) -> Panels:
    """Return panels that become narrower towards both ends, by repeated halving of the panel at the end.

    Parameters
    ----------
    left, right : int
        Number of halvings of the panel at the left end, and of the panel at the right end.
    order : int
        Nodes per panel, at least 2.

    Returns
    -------
    Panels
        Nodes and matrices with (left + right + 2) * order nodes; cached.
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
    """Return the indices of the nodes of a panel, and of the last node of the previous panel.

    The polynomial of the panel interpolates at these nodes.
    """
    return np.arange(max(panel * order - 1, 0), (panel + 1) * order)


def _add_panel(
    nodes: FloatArray,
    low: float,
    high: float,
    members: NDArray[np.intp],
    matrices: tuple[FloatArray, ...],
    weights: FloatArray,
) -> None:
    """Add the exact weights of one panel to the matrices, and to the weights of the integral over [0, 1]."""
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


def interpolate(mesh: Mesh, values: FloatArray, places: FloatArray) -> FloatArray:
    """Return the piecewise polynomial through `values`, shape (n,), at the positions `places`.

    Beyond the mesh the result is 0.
    """
    result = np.zeros_like(places)
    _interpolate(mesh, values, places, result)
    return result


def interpolate_weighted(mesh: Mesh, rows: FloatArray, shares: FloatArray, stretch: FloatArray) -> FloatArray:
    """Return a weighted sum of piecewise polynomials at all nodes.

    At the node z, term k of the sum is shares[k] p_k(stretch[k] z), where p_k is the piecewise polynomial through
    rows[k].
    """
    result = np.zeros(mesh.nodes.size)
    _weighted(mesh, rows, shares, stretch, result)
    return result


@jit
def _weighted(mesh: Mesh, rows: FloatArray, shares: FloatArray, stretch: FloatArray, result: FloatArray) -> None:
    for k in range(shares.size):
        for node in range(mesh.nodes.size):
            result[node] += shares[k] * value_at(mesh, rows[k], mesh.nodes[node] * stretch[k])


@jit
def _interpolate(mesh: Mesh, values: FloatArray, places: FloatArray, result: FloatArray) -> None:
    for number in range(places.size):
        result[number] = value_at(mesh, values, places[number])


@jit_inline
def value_at(mesh: Mesh, values: FloatArray, place: float) -> float:
    """Return the piecewise polynomial through `values` at the position `place`; beyond the mesh the result is 0."""
    if place >= mesh.edges[-1]:
        return 0.0
    order = mesh.order
    panel = last_until(mesh.edges, place, 0, mesh.edges.size - 1)
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
