"""What the slip zone remembers under constant force: the path of border and depth, and what past moments had worn.

The plateau behind the border changes by df* = (2/pi) arccos(b / r) dd, so that the path of border b and depth d is all
that is kept of the annulus which the border has passed. Squared radii are counted from c^2 in units of 1 - c^2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.mdr.half_integrals import Mesh, value_at
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear.slip import LogTable, log_slip

#: Floor of (r^2 - c^2) / (1 - c^2).
SMALLEST = 1e-30
#: Half the spread of the roots along a piece, over their mean, below which its middle stands for it.
SHORT = 0.02
_ABSCISSA, _WEIGHT = gauss(3)


class VirginBody(NamedTuple):
    """The virgin body: its slip, c^2 and 1 - c^2."""

    slip: LogTable
    square: float
    width: float


class Place(NamedTuple):
    """Where a contact stands: border b and width of the slip zone in squared radii, and depth over eta, from 1."""

    border: float
    width: float
    depth: float


class Past(NamedTuple):
    """What past moments had worn, in the shares of one step.

    Parameters
    ----------
    shares, borders, widths : array, shape (m,)
        One for each moment.
    worn : array, shape (m, n)
        The worn depth over eta at the nodes; less `frozen` and over the root of z where the border stands.
    frozen : float
        The worn depth at the border where it stands, else NaN.
    moved : array, shape (n + order,)
        `plateau_rise` along the path at the places of the last moment, and beyond.
    path : array, shape (2, k)
        Border and depth up to where the border moved last.
    carried : float
        See `Pressed`.
    """

    shares: FloatArray
    borders: FloatArray
    widths: FloatArray
    worn: FloatArray
    frozen: float
    moved: FloatArray
    path: FloatArray
    carried: float


@jit
def remember(mesh: Mesh, body: VirginBody, past: Past, place: Place, result: FloatArray) -> None:
    """Put what is known of s and of the worn depth at the nodes, and the load that sticks."""
    nodes, path, stands = result.size // 2, past.path, past.frozen == past.frozen
    last = path.shape[1] - 1
    for i in range(nodes):
        q = place.border + place.width * mesh.nodes[i]
        worn = 0.0
        for k in range(past.shares.size if i < nodes - 1 else 0):  # nothing is worn at the edge
            z = (q - past.borders[k]) / past.widths[k]
            if z < 1.0:
                value = value_at(mesh, past.worn[k], z)
                worn += past.shares[k] * (past.frozen + math.sqrt(z) * value if stands else value)
        z = (q - past.borders[0]) / past.widths[0]
        rise = value_at(mesh, past.moved, z) if z < mesh.edges[-1] else _rise(body, path, last, q)
        square = body.square + body.width * q
        angle = _mean_angle(square, body.width, _root(q, path[0, last]), _root(q, place.border))
        rise += 2.0 / math.pi * angle * (place.depth - path[1, last])
        result[i] = math.exp(log_slip(body.slip, body.width * max(q, SMALLEST))) - rise + worn
        result[nodes + i] = worn
    result[2 * nodes] = sticking_load(body, path[0, last], path[1, last], past.carried, place)


@jit_inline
def sticking_load(body: VirginBody, border: float, depth: float, carried: float, place: Place) -> float:
    """Return int_0^b (d - g) dx - int_0^c (1 - g) dx over eta, on what sticks."""
    radius = math.sqrt(body.square + body.width * border)
    further = body.width * (place.border - border) / (radius + math.sqrt(body.square + body.width * place.border))
    return radius * place.depth + carried + further * (0.5 * (place.depth - depth) + 1.0)


@jit
def plateau_rise(body: VirginBody, path: FloatArray, place: FloatArray, result: FloatArray) -> None:
    """Put (2/pi) int arccos(b / r) dd along a path of straight pieces, at places beyond it."""
    for i in range(place.size):
        result[i] = _rise(body, path, path.shape[1] - 1, place[i])


@jit
def frozen_depth(body: VirginBody, path: FloatArray, place: FloatArray, result: FloatArray) -> None:
    """Put the worn depth over eta that the border left at places it passed, on a path on which it never returned."""
    for i in range(place.size):
        q = place[i]
        if q <= 0.0:
            result[i] = 0.0
            continue
        before = np.searchsorted(path[0], q) - 1
        rise = _rise(body, path, before, q)
        if before + 1 < path.shape[1]:
            share = (q - path[0, before]) / (path[0, before + 1] - path[0, before])
            angle = _mean_angle(body.square + body.width * q, body.width, _root(q, path[0, before]), 0.0)
            rise += 2.0 / math.pi * angle * share * (path[1, before + 1] - path[1, before])
        result[i] = rise - math.exp(log_slip(body.slip, body.width * max(q, SMALLEST)))


@jit
def _rise(body: VirginBody, path: FloatArray, last: int, q: float) -> float:
    """Return the rise of the plateau along the first pieces of a path."""
    square, total = body.square + body.width * q, 0.0
    first = _root(q, path[0, 0])
    for k in range(1, last + 1):
        end = _root(q, path[0, k])
        total += _mean_angle(square, body.width, first, end) * (path[1, k] - path[1, k - 1])
        first = end
    return 2.0 / math.pi * total


@jit_inline
def _root(q: float, border: float) -> float:
    return math.sqrt(max(q - border, 0.0))


@jit_inline
def _mean_angle(square: float, width: float, first: float, last: float) -> float:
    """Return the mean of arccos(b / r) along a straight piece, in the root of r^2 - b^2, in which it is smooth."""
    scale = math.sqrt(width / square)
    whole = first + last
    spread = (first - last) / whole if whole > 0.0 else 0.0
    if abs(spread) < SHORT:
        return math.asin(min(0.5 * scale * whole, 1.0)) * (1.0 + spread * spread / 3.0)
    mean, weights = 0.0, 0.0
    for node in range(_ABSCISSA.size):
        root = first + (last - first) * _ABSCISSA[node]
        mean += _WEIGHT[node] * root * math.asin(min(scale * root, 1.0))
        weights += _WEIGHT[node] * root
    return mean / weights
