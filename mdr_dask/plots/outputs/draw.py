"""From what is asked to the figure that shows it."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from mdr_dask.plots import page, style
from mdr_dask.plots.base import Plot
from mdr_dask.plots.outputs.effects import draw_effects
from mdr_dask.plots.outputs.lines import draw_lines
from mdr_dask.plots.outputs.maps import draw_map
from mdr_dask.plots.outputs.view import View, holding, with_prefix
from mdr_dask.plots.table import Drawn


def of_output(view: View) -> Plot:
    """Return the figure of an output: its `draw` takes the groups of studies by the name that a legend gives them."""

    def draw(series: Mapping[str, xr.Dataset]) -> Drawn:
        found, told = holding(series, view)
        form = {0: draw_effects, 1: draw_lines, 2: draw_map}[len(view.over)]
        unit = with_prefix(found, view.output)
        with page.with_units({view.output: unit} if unit else {}):
            figure, left_out = form(found, view)
        style.leave_out(figure, [*told, *left_out])
        return figure

    return Plot(view.output, (), f"{view.output} against {' and '.join(view.over)}", draw)
