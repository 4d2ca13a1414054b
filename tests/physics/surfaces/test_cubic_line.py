"""Lines of cubic cells: highest points and integrals."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from schemes import sampled

from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import CubicLine, cut, indented_line, periodic_line, running
from mdr_dask.physics.surfaces.shapes import PowerLaw


def lines(nodes=48):
    amplitude, phase = roughness.amplitudes(12, 0.5), roughness.phases(3, 0, 12)
    height, slope = (sampled(amplitude, phase, nodes, order) for order in (0, 1))
    return {
        "periodic": periodic_line(height, slope),
        "straight": periodic_line(height, None),
        "cone": indented_line(height, slope, PowerLaw(8.0, 1.0)),
        "parabola": indented_line(height, slope, PowerLaw(8.0, 2.0)),
    }


def cubics(line):
    """Return the polynomials of the cells over 0..1."""
    for h, after, e, f in zip(line.height[:-1], line.height[1:], line.enter, line.leave, strict=True):
        rise = after - h
        yield Polynomial([h, e, 3 * rise - 2 * e - f, e + f - 2 * rise])


@pytest.mark.parametrize("name", ["periodic", "straight", "cone", "parabola"])
def test_cells_begin_at_the_highest_point_with_the_integrals_of_their_cubics(name):
    line = lines()[name]
    cells, polynomials = cut(line), list(cubics(line))
    n, x = len(polynomials), np.linspace(0, 1, 2001)
    assert cells.top == pytest.approx(max(p(x).max() for p in polynomials), rel=1e-6)
    first = int(np.argmax([p(x).max() for p in polynomials])) if line.periodic else 0
    turned = polynomials[first:] + polynomials[:first]
    np.testing.assert_allclose(cells.peak[:n], [p(x).max() - cells.top for p in turned], atol=1e-6)
    np.testing.assert_allclose(cells.mean[:n], [p.integ()(1) - cells.top for p in turned], atol=1e-13)
    squares = [(p.deriv() ** 2).integ()(1) for p in turned]
    # by Euler and Maclaurin: each cell to its order, the whole line exactly
    assert np.sum(cells.stretch[:n]) == pytest.approx(np.sum(squares), rel=1e-2 if line.smooth else 1e-13)
    if line.periodic:
        assert turned[0](cells.start) == pytest.approx(cells.top, abs=1e-13)
    assert running(cells.mean)[n] == pytest.approx(np.sum(cells.mean[:n]))


@pytest.mark.parametrize("seed", range(5))
def test_the_highest_point_is_found_wherever_slopes_are_steep(seed):
    """Far above the nodes, inside of cells that rise and fall, or at a node: as a look at every cell finds it."""
    draw = np.random.default_rng(seed)
    height, enter, leave = draw.normal(size=31), *(10 ** draw.uniform(-2, 2) * draw.normal(size=(2, 30)))
    line = CubicLine(height, enter, leave, False, False)
    tops = [p(np.append(p.deriv().roots().real.clip(0, 1), [0, 1])).max() for p in cubics(line)]
    cells = cut(line)
    assert cells.top == pytest.approx(max(tops), rel=1e-12)
    np.testing.assert_allclose(cells.peak[:30] + cells.top, tops, atol=1e-9)
    closed = cut(line._replace(periodic=True))
    np.testing.assert_array_equal(closed.peak[:30], np.roll(cells.peak[:30], -int(np.argmax(tops))))
    assert closed.peak[0] == 0


def test_the_slope_squared_of_a_resolved_line_is_exact():
    amplitude = roughness.amplitudes(12, 0.5)
    cells = cut(lines()["periodic"])
    n = cells.mean.size - 1
    assert n * np.sum(cells.stretch[:n]) == pytest.approx(roughness.spectral_slope(amplitude) ** 2, rel=1e-13)
