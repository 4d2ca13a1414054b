"""The Kelvin body by each scheme, from heights and slopes at nodes."""

from mdr_dask.physics.sliding import steady
from mdr_dask.physics.surfaces.cubic_line import indented_line, periodic_line
from mdr_dask.physics.surfaces.shapes import PowerLaw


def on_line(height, slope, deborah, loads, scheme="hermite", **options):
    return _solved(periodic_line(height, slope if scheme == "hermite" else None), deborah, loads, scheme, options)


def under_indenter(height, slope, coefficient, exponent, deborah, loads, scheme="hermite", **options):
    line = indented_line(height, slope if scheme == "hermite" else None, PowerLaw(coefficient, exponent))
    return _solved(line, deborah, loads, scheme, options)


def _solved(line, deborah, loads, scheme, options):
    solve = steady.stepped_sliding if scheme == "backward_euler" else steady.steady_sliding
    return solve(line, deborah, loads, **options)
