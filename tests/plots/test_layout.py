"""Figures at the widths of a journal: nothing overlaps and nothing is cut, for any number of curves."""

import numpy as np
import pytest
import xarray as xr
from overlaps import problems

from mdr_dask.plots import page
from mdr_dask.plots.figure import Axis, Figure, Key, Panel, Trace, columns
from mdr_dask.plots.render import render
from mdr_dask.plots.view import View, draw


def study(curves, second=1, words=False, name="a_parameter_with_a_rather_long_name"):
    """Return a series of an output against velocity, with other axes of some values."""
    values = np.array([f"word number {k}" for k in range(curves)]) if words else np.linspace(1.0, 2.0, curves)
    velocity = np.geomspace(1e-4, 1e2, 13)
    shape = (curves, second, 13, 3)
    random = np.random.default_rng(1)
    output = 1e-3 * (1 + np.arange(curves))[:, None, None, None] * random.uniform(0.9, 1.1, shape)
    output *= (velocity / (1 + velocity))[:, None]
    data = xr.Dataset(
        {
            "mu": (
                (name, "load", "velocity", "realisation"),
                output,
                {"long_name": "coefficient of friction in the whole contact"},
            ),
            "status": ((name, "load", "velocity", "realisation"), np.ones(shape, dtype=np.int8)),
        },
        coords={
            name: (name, values, {"units": "1"}),
            "load": ("load", np.linspace(1, 2, second), {"units": "N"}),
            "velocity": ("velocity", velocity, {"units": "m/s"}),
        },
        attrs={"axes": [{"name": axis, "dim": axis, "path": axis} for axis in (name, "load", "velocity")]},
    )
    return data.squeeze([dim for dim in (name, "load") if data.sizes[dim] == 1])


@pytest.mark.parametrize("size", ["85mm", *(pytest.param(s, marks=pytest.mark.slow) for s in ("", "170mm", "85x60mm"))])
@pytest.mark.parametrize("case", [(1, 1, False), (5, 1, False), (25, 1, False), (6, 3, False), (25, 3, True)])
def test_nothing_overlaps_and_nothing_is_cut(size, case):
    curves, second, words = case
    asked = page.requested(size)
    with page.drawing_for(asked):
        figure = render(draw({"": study(curves, second, words)}, View("mu", "velocity")))
        assert not list(problems(figure))
        assert min(axes.get_window_extent().height / figure.dpi for axes in figure.axes) > 0.5
        assert bool(figure.get_suptitle()) == (not size)
        if size:
            assert figure.get_figwidth() == pytest.approx(asked.width)


@pytest.mark.parametrize("view", [View("mu", ("velocity", "load")), View("mu", "velocity", panels="load")])
def test_maps_and_panels_do_not_overlap(view):
    with page.drawing_for(page.requested("85mm")):
        figure = render(draw({"": study(5, 4)}, view))
        assert not list(problems(figure))


@pytest.mark.parametrize("size", ["85mm", "170mm"])
@pytest.mark.parametrize(("count", "stack", "ratio"), [(3, 1, 0.85), (12, 1, 0.7), (15, 3, 0.45), (6, 1, 0.3)])
def test_a_figure_of_a_requested_width_fits_on_a_page(size, count, stack, ratio):
    x, y = np.linspace(0, 1, 5), np.linspace(0, 3, 5)
    panels = [
        Panel(Axis("velocity [m/s]"), Axis(f"output {k}"), [Trace("curve", columns(x=x, y=y), line="-")])
        for k in range(count)
    ]
    panels[0].keys = [Key(f"a surface with a long name, number {k}", "#000000") for k in range(25)]
    with page.drawing_for(page.requested(size)):
        figure = render(Figure(panels, "", stack=stack, ratio=ratio))
        assert not list(problems(figure))
    assert figure.get_figheight() * 25.4 < 231
    sizes = [axes.get_window_extent() for axes in figure.axes]
    assert all(1 / 6 < box.height / box.width < 3 for box in sizes)
    assert min(box.height for box in sizes) / figure.dpi > 0.4


def test_a_title_can_be_set_and_switched_off():
    for title, size, shown in (("Mine", "85mm", "Mine"), ("", "", ""), (None, "85mm", "")):
        with page.drawing_for(page.requested(size, title)):
            assert render(draw({"": study(3)}, View("mu", "velocity"))).get_suptitle() == shown


def test_a_name_that_all_entries_of_a_legend_share_is_its_title():
    (legend,) = render(draw({"": study(3, name="hardness")}, View("mu", "velocity"))).legends
    assert legend.get_title().get_text() == "hardness"
    assert [text.get_text() for text in legend.get_texts()] == ["1", "1.5", "2"]


def test_styles_of_matplotlib_are_used():
    with page.drawing_for(page.requested(style="grayscale")):
        figure = render(draw({"": study(4)}, View("mu", "velocity")))
    lines = [line for line in figure.axes[0].lines if line.get_gid() == "curve"]
    assert len({line.get_linestyle() for line in lines}) == 4
    with pytest.raises(Exception, match="expected a style file"), page.drawing_for(page.requested(style="greyscale")):
        pass


@pytest.mark.parametrize("text", ["85", "1mm", "85 x 60", "2 m", "wide"])
def test_bad_sizes_are_refused(text):
    with pytest.raises(Exception, match="expected"):
        page.requested(text)


def test_matplotlib_draws_the_data_of_the_description():
    description = draw({"": study(3)}, View("mu", "velocity"))
    figure = render(description)
    drawn = [line for line in figure.axes[0].lines if line.get_gid() == "curve"]
    for line, trace in zip(drawn, description.panels[0].traces, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), trace.column("x"))
        np.testing.assert_array_equal(line.get_ydata(), trace.column("y"))
