"""Figures of any output of any model, of one study or several.

Read `view` (what is asked, and which series can be drawn so), then `lines` (against a parameter), `maps` (over two) and
`effects` (of every parameter).
"""

from mdr_dask.plots.outputs.draw import of_output
from mdr_dask.plots.outputs.view import View

__all__ = ["View", "of_output"]
