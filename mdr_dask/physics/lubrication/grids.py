"""Graded grids for a lubricated line contact. Positions are in half widths, and films in units of ``a^2/R``.

The nodes are placed according to a given density of nodes along the contact. Two grids with the same density but
different numbers of nodes are therefore geometrically similar, as Richardson extrapolation requires.
"""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray

#: Distance of a flooded inlet from X = -1, divided by sqrt(2 H(0)). Because the distance is finite, the film has a
#: relative error of 2e-5.
FLOODED = 300.0


def inlet_position(central_film: float) -> float:
    """Return the position where a fully flooded film begins, in half widths."""
    return -1.0 - FLOODED * float(np.sqrt(2 * central_film))


def outlet_position(central_film: float) -> float:
    """Return a position downstream of the point where the film ends, in half widths."""
    return 1.1 + float(np.sqrt(2 * central_film))


def sample(positions: FloatArray, density: FloatArray, count: int) -> FloatArray:
    """Return `count` nodes whose spacing is inversely proportional to a piecewise linear density."""
    number = _cells(positions, density)
    nodes = _placed(positions, density, number, np.linspace(0.0, number[-1], count))
    nodes[-1] = positions[-1]
    return nodes


def _cells(positions: FloatArray, density: FloatArray) -> FloatArray:
    """Return the number of cells upstream of each position, not rounded."""
    return np.concatenate([[0.0], np.cumsum(np.diff(positions) * (density[1:] + density[:-1]) / 2)])


def _placed(positions: FloatArray, density: FloatArray, number: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the positions that have the numbers of cells `wanted` upstream.

    If there are fewer cells, the density is constant from the last but one of the `positions` on.
    """
    width = np.diff(positions)
    cell = np.clip(np.searchsorted(number, wanted, side="right") - 1, 0, width.size - 1)
    rest = wanted - number[cell]
    slope = np.where(wanted > number[-1], 0.0, (density[cell + 1] - density[cell]) / width[cell])
    root = np.sqrt(np.maximum(density[cell] ** 2 + 2 * slope * rest, 0.0))
    nodes = positions[cell] + 2 * rest / (density[cell] + root)
    nodes[0] = positions[0]
    return np.asarray(nodes)


def aligned(positions: FloatArray, density: FloatArray, count: int, rupture: float) -> tuple[FloatArray, float]:
    """Return about `count` nodes with a given density, and the product of node spacing and density.

    A node lies at `rupture`, where the film ends, so that errors on several grids can be compared.
    """
    number = _cells(positions, density)
    reached = _cells_before(rupture, positions, density, number)
    spacing = reached / round(reached / number[-1] * (count - 1))
    last = int(np.ceil(number[-1] / spacing * (1 - 1e-12)))
    return _placed(positions, density, number, spacing * np.arange(last + 1)), float(spacing)


def _cells_before(position: float, positions: FloatArray, density: FloatArray, number: FloatArray) -> float:
    """Return the number of cells before `position`, from the `number` of cells before each of the `positions`."""
    before = int(np.clip(np.searchsorted(positions, position) - 1, 0, positions.size - 2))
    rest = position - positions[before]
    slope = (density[before + 1] - density[before]) / (positions[before + 1] - positions[before])
    return float(number[before] + rest * (density[before] + slope * rest / 2))


def first_grid(central_film: float, inlet: float, count: int) -> FloatArray:
    """Return a grid of `count` nodes for an expected central film.

    The nodes are densest at both ends of the dry contact if the film is thin, and around ``X = 0`` if the film is
    thick.
    """
    length = max(1.0, float(np.sqrt(2 * central_film)))
    finest = min(0.7 * central_film ** (2 / 3), length)
    outlet = outlet_position(central_film)
    offsets = np.geomspace(1e-7, max(-inlet, outlet) + length, 1000)
    positions = np.concatenate(
        [[-length], -length - offsets, -length + offsets, [length], length - offsets, length + offsets]
    )
    positions = np.unique(np.clip(positions, inlet, outlet))
    distance = np.minimum(np.abs(positions + length), np.abs(positions - length))
    if length > 1:
        distance = np.maximum(0.0, np.abs(positions) - length)
    density = 1 / (0.15 * (distance + 2 * finest))
    return sample(positions, np.maximum(density, np.where(np.abs(positions) < 1.5 * length, 8 / length, 0.0)), count)


def first_pressure(nodes: FloatArray, central: float) -> FloatArray:
    """Return a first guess of the pressure: Hertz' ellipse, or, for a thick film, an ellipse centred upstream."""
    reach = float(np.sqrt(2 * central))
    width, centre = (1.0, 0.0) if reach < 1 else (max(1.0, 0.8 * reach), -0.4 * reach)
    return np.sqrt(np.maximum(1 - ((nodes - centre) / width) ** 2, 0.0)) / width


def second_derivative(nodes: FloatArray, values: FloatArray) -> FloatArray:
    """Return the second derivative at the nodes. Both end nodes get the second derivative at the neighbouring node."""
    width = np.diff(nodes)
    inner = 2 * np.diff(np.diff(values) / width) / (width[1:] + width[:-1])
    return np.concatenate([inner[:1], inner, inner[-1:]])


def adapted_density(nodes: FloatArray, pressure: FloatArray, film: FloatArray, central_film: float) -> FloatArray:
    """Return the density of nodes that is suitable for a solution, shape (n,).

    The flow, with errors of second order, needs a density proportional to ``sqrt(|H''|/H)``. The deformation, with
    errors of third order, needs a density proportional to the cube root of ``|P''|``. A third term provides nodes in
    the contact and in the inlet. The sum is smoothed, so that neighbouring cells have similar widths.
    """
    length = max(1.0, float(np.sqrt(2 * central_film)))
    of_film = np.sqrt(np.abs(second_derivative(nodes, film)) / film)
    of_pressure = np.cbrt(np.abs(second_derivative(nodes, pressure)) / (pressure.max() * length))
    floor = np.where(np.abs(nodes) < 1.2 * length, 1 / length, 0.0) + 0.5 / np.maximum(np.abs(nodes), length)
    density = of_film + of_pressure + floor
    for widen in (True,) * 4 + (False,) * 4:
        mean = 0.25 * density[:-2] + 0.5 * density[1:-1] + 0.25 * density[2:]
        density[1:-1] = np.maximum(density[1:-1], mean) if widen else mean
    return np.asarray(density)
