"""Compare the pressure from a line load with PyAbel."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.interpolate import CubicSpline

from benchmarks.peers import OURS, installed
from benchmarks.rows import Row, timed_in_turns
from mdr_dask.physics.mdr.transforms import pressure

RADII = np.linspace(0, 2, 1601)  # the edges of the contacts are among these radii
WIDTH = 0.3


def bell(r):
    """Return the line load, its slope, and the pressure for a Gaussian."""
    load = np.sqrt(np.pi) * WIDTH * np.exp(-((r / WIDTH) ** 2))
    return load, -2 * r / WIDTH**2 * load, np.exp(-((r / WIDTH) ** 2))


def hertz(r):
    """Return the line load, its slope, and the pressure for a parabola with contact radius 1."""
    return np.pi / 2 * np.maximum(1 - r**2, 0), np.where(r <= 1, -np.pi * r, 0.0), np.sqrt(np.maximum(1 - r**2, 0))


#: Cases: the functions, and the radius at the edge of the contact.
CASES = {"smooth: Gaussian": (bell, 2.0), "edge: Hertz": (hertz, 1.0)}


def peers(load, spacing):
    """Return the methods of PyAbel for one row of samples."""
    name = installed("PyAbel")
    if name is None:
        return {}
    from abel import basex, dasch, daun, hansenlaw

    row, kept = load[None, :], {"basis_dir": None, "verbose": False}
    return {
        (name, "three_point"): lambda: dasch.three_point_transform(row, dr=spacing, direction="inverse", **kept),
        (name, "basex"): lambda: basex.basex_transform(row, dr=spacing, direction="inverse", **kept),
        (name, "daun, cubic"): lambda: daun.daun_transform(row, dr=spacing, degree=3, direction="inverse", **kept),
        (name, "hansenlaw"): lambda: hansenlaw.hansenlaw_transform(row, dr=spacing, direction="inverse"),
    }


def compared() -> Iterator[Row]:
    """Yield rows with the largest error of each method."""
    for case, (function, edge) in CASES.items():
        load, _, truth = function(RADII)

        def known(edge=edge, function=function):
            return pressure(lambda x: -function(x)[1], RADII, edge).value

        def sampled(edge=edge, load=load):
            inside = edge >= RADII
            slope = CubicSpline(RADII[inside], load[inside], bc_type=("clamped", "not-a-knot")).derivative()
            return pressure(lambda x: -slope(x), RADII, edge).value

        methods = {(OURS, ""): known, (OURS, "spline"): sampled} | peers(load, RADII[1])
        for (name, setting), (found, seconds) in timed_in_turns(methods, 3).items():
            error = max(float(np.max(np.abs(np.ravel(found) - truth))), 1e-16)
            yield Row("Abel transform", case, name, setting, 1, seconds, error)
