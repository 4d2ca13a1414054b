"""A figure of any output on stores of every model: what is drawn against the store, and what is refused."""

import numpy as np
import planted
import pytest
import xarray as xr
from drawn import check_picture, mismatches, rows, stored
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from mdr_dask import units
from mdr_dask.errors import DataError
from mdr_dask.physics.sliding import laws
from mdr_dask.plots import curves, drawing, page, style
from mdr_dask.plots import laws as law_room
from mdr_dask.plots.outputs import View, of_output

V = "  velocity: {geometric: [0.01 mm/s, 1 m/s, 6]}\n"
F = "  normal_force: {geometric: [1 mN, 100 N, 9]}\n"
MU = "friction_coefficient"
STUDIES = {
    "grid": (planted.SLIDING + F + V + "  hurst: [0.3, 0.7]\n", {"failed": True}),
    "sampled": (
        planted.SLIDING + "  normal_force: {geometric: [1 mN, 100 N]}\n  velocity: {geometric: [0.1 mm/s, 1 m/s]}\n"
        "  hurst: {linear: [0.2, 0.8]}\nsampling: {latin_hypercube: 32}\n",
        {"failed": True},
    ),
    "cone": (planted.SLIDING + V + F + "  hurst: 0.7\n  indenter: {shape: cone, angle: 10 deg}\n", {}),
    "jump": (planted.JUMP + V + "  hurst: 0.6\n  velocity_change: [-0.2, 0.2]\n  normal_force: 1 N\n", {}),
    "rollers": (
        planted.ROLLERS + "  normal_force: [200 N, 800 N]\n  rotation_speed: {geometric: [10 rpm, 1000 rpm, 4]}\n"
        "  temperature: [40 degC, 60 degC]\n",
        {"realisations": 1},
    ),
    "film": (
        planted.NUMBERS + "  material_parameter: 5000\n  load_parameter: [1e-6, 1e-5]\n"
        "  speed_parameter: {geometric: [1e-12, 1e-10, 5]}\n",
        {},
    ),
    "sampled film": (
        planted.NUMBERS + "  material_parameter: 5000\n  load_parameter: {geometric: [1e-6, 1e-5]}\n"
        "  speed_parameter: {geometric: [1e-12, 1e-10]}\nsampling: {latin_hypercube: 3}\n",
        {},
    ),
    "wear": (
        planted.FRETTING
        + f"  {planted.RULE}: [exact, fast, limit]\n  stick_radius: [0.4, 0.6]\n  cycles: [0.5, 1, 2]\n",
        {"failed": True},
    ),
}


@pytest.fixture(scope="module")
def stores(tmp_path_factory):
    return {
        name: next(iter(planted.make(tmp_path_factory.mktemp(name), text, **special).values())).load()
        for name, (text, special) in STUDIES.items()
    }


def drawn(groups, output, over, **view):
    over = (over,) if isinstance(over, str) else over
    figure = of_output(View(output, over, **view)).figure(groups)
    check_picture(figure)
    return figure


def shown(data, name):
    return xr.DataArray(style.shown(name, data[name]), dims=data[name].dims)


LINES = [
    ("grid", MU, "velocity", {}),
    ("grid", MU, "velocity", {"by": "normal_force", "panels": "hurst"}),
    ("grid", "contact_fraction", "normal_force", {"by": "velocity"}),
    ("grid", f"{MU}_error", "velocity", {"log": "xy"}),
    ("sampled", MU, "velocity", {}),
    ("sampled", MU, "velocity", {"by": "hurst"}),
    ("jump", MU, "relaxation_times", {"by": "velocity"}),
    ("jump", "friction_coefficient_jump", "velocity", {}),
    ("jump", "friction_coefficient_before", "velocity", {}),
    ("cone", MU, "velocity", {"by": "normal_force"}),
    ("rollers", "film_ratio", "rotation_speed", {"panels": "temperature"}),
    ("film", "central_film", "speed_parameter", {}),
    ("film", "minimum_film", "load_parameter", {"by": "speed_parameter"}),
    ("film", "pressure", "position", {"by": "speed_parameter"}),
    ("wear", "wear_volume", "cycles", {"by": planted.RULE}),
    ("wear", "wear_volume", planted.RULE, {}),
    ("wear", "worn_profile", "radius", {"panels": "stick_radius"}),
]


@pytest.mark.parametrize(("study", "output", "over", "view"), LINES)
def test_an_output_against_a_parameter_is_what_the_store_holds(study, output, over, view, stores):
    data = stores[study]
    figure = drawn({"": data}, output, over, **view)
    table = figure.table()
    x = shown(data, over) if data[over].dtype.kind in "fiu" else xr.DataArray(np.arange(data[over].size), dims=over)
    factor = table.loc[table["what"] == "data", "y"].abs().max() / np.nanmax(abs(stored(data, output)[0]))
    factor = 10.0 ** np.round(np.log10(factor)) if output == "pressure" else 1.0
    value = stored(data, output, factor)
    known = rows(x, value, shown(data, "hurst")) if view.get("by") == "hurst" else rows(x, value)
    found = table[table["what"] == "data"]
    assert mismatches(found, known).empty
    assert "values of" in style.left_out(figure) or mismatches(known, found).empty
    assert not mismatches(found.tail(1).assign(y=lambda row: 1.001 * row["y"]), known).empty
    empty = bool(data[output].isnull().all("realisation").any())
    marked = set(table["what"]) & {"failed"}
    assert bool(marked) == empty or "values of" in style.left_out(figure)


def test_what_is_held_fixed_stands_in_the_title_and_in_the_table(stores):
    figure = drawn({"": stores["grid"].isel(hurst=[1])}, MU, "velocity", by="normal_force")
    table = figure.table()
    for name, text in (
        ("rms_roughness", "$h$ = 0.5 µm"),
        ("relaxation_time", r"$\tau$ = 1 ms"),
        ("hurst", "$H$ = 0.7"),
    ):
        assert text in figure.get_suptitle().replace("\n", " ")
        assert table.attrs["held"][name] == float(stores["grid"].isel(hurst=1)[name])
    assert any(axes.get_label() == "<colorbar>" for axes in figure.axes), "nine curves have a colour bar"


def test_a_map_has_the_values_of_the_store_and_crosses_out_what_failed(stores):
    data = stores["grid"].isel(hurst=0)
    figure = drawn({"": data}, MU, ("velocity", "normal_force"))
    value = stored(data, MU)
    known = rows(shown(data, "velocity"), shown(data, "normal_force"), value)
    found = figure.table()
    assert mismatches(found, known).empty
    assert mismatches(known, found).empty
    (crosses,) = (line for line in figure.axes[0].lines if line.get_label() == "no value")
    assert len(crosses.get_xdata()) == int(value[0].isnull().sum()) > 0
    (mesh,) = figure.axes[0].collections
    assert isinstance(mesh.norm, LogNorm)
    edges = mesh.get_coordinates()[0, :, 0]
    np.testing.assert_allclose(edges[1:-1] ** 2, data["velocity"][1:] * data["velocity"][:-1].values)
    half = float(((value[2] - value[1]) / 2).max())
    assert f"at most ±{half:.2g}" in figure.get_suptitle()
    drawn({"": stores["sampled"]}, MU, ("velocity", "hurst"))
    drawn({"": stores["grid"]}, MU, ("velocity", "normal_force"), panels="hurst")


def test_the_colours_of_a_map_have_a_name_and_a_unit(stores):
    for output, label in (
        (MU, "coefficient of friction"),
        ("indentation_depth", "penetration of the mean line into the undeformed body [m]"),
    ):
        figure = drawn({"": stores["grid"].isel(hurst=0)}, output, ("velocity", "normal_force"))
        (bar,) = (axes for axes in figure.axes if axes.get_label() == "<colorbar>")
        assert bar.get_ylabel().replace("\n", " ") == label


def test_cells_of_a_map_end_between_the_values_of_an_axis_and_around_a_single_one():
    np.testing.assert_allclose(drawing.edges(np.array([2.0, 4.0, 5.0])), [1.0, 3.0, 4.5, 5.5])
    np.testing.assert_allclose(drawing.edges(np.array([5.0])), [2.5, 7.5])
    np.testing.assert_allclose(drawing.edges(np.array([0.0])), [-0.5, 0.5])


def test_effects_are_means_over_all_that_varies_besides(stores):
    data = stores["rollers"]
    table = drawn({"": data}, "film_ratio", ()).table()
    means = table[table["curve"] == "mean, 95 % interval"]
    for panel, name in enumerate(("normal_force", "rotation_speed", "temperature"), start=1):
        rest = {"normal_force", "rotation_speed", "temperature", "realisation"} - {name}
        here = means[means["panel"] == panel]
        np.testing.assert_allclose(here["x"], style.shown(name, data[name]))
        np.testing.assert_allclose(here["y"], data["film_ratio"].mean(rest))
    table = drawn({"": stores["sampled"]}, MU, ()).table()
    cases = stores["sampled"][MU].mean("realisation").dropna("case")
    for panel in (1, 2, 3):
        here = table[(table["panel"] == panel) & (table["curve"] == "mean, 95 % interval")]
        assert len(here) == cases.size // 8
        assert here["y"].mean() == pytest.approx(float(cases.mean()), rel=0.35)
        assert np.all((here["y_low"] <= here["y"]) & (here["y"] <= here["y_high"]))


def test_several_studies_have_one_entry_each_and_panels_where_there_are_too_many(stores):
    one = stores["grid"].isel(hurst=[0], normal_force=[0])
    other = stores["grid"].isel(hurst=[1], normal_force=[0])
    figure = drawn({"first": one, "second": other}, MU, "velocity")
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert labels[:2] == ["first", "second"]
    assert "law (eq. 3.18)" in labels
    assert "$H$" not in figure.get_suptitle(), "what differs is not held fixed"
    figure = drawn({"first": stores["grid"], "second": stores["grid"]}, MU, "velocity")
    assert [axes.get_title() for axes in figure.axes[:2]] == ["first", "second"]


def test_units_size_and_style_of_the_page(stores, tmp_path):
    data = stores["rollers"]
    sheet = tmp_path / "paper.mplstyle"
    sheet.write_text("axes.linewidth: 3\n")
    asked = page.Page(*page.size("85x60mm"), {"rotation_speed": "rad/s", "temperature": "K", "film_ratio": "percent"})
    with page.drawing_for(asked, str(sheet)):
        figure = drawn({"": data}, "film_ratio", "rotation_speed", by="temperature")
    assert figure.get_size_inches() * 25.4 == pytest.approx([85, 60])
    axes = figure.axes[0]
    assert axes.spines["left"].get_linewidth() == 3
    assert axes.get_xlabel() == "rotation speed [rad/s]"
    assert "[%]" in axes.get_ylabel()
    np.testing.assert_allclose(axes.lines[0].get_xdata(), data["rotation_speed"])
    np.testing.assert_allclose(np.nanmax(axes.lines[0].get_ydata()) / 100, data["film_ratio"].max(), rtol=0.3)
    assert axes.get_legend_handles_labels()[1][0] == "$F_N$ = 200 N, temperature = 313.1 K"


STYLES = {
    "grayscale": (("0.00", "0.40", "0.60"), 3, "gray"),
    "ggplot": (("#E24A33", "#348ABD", "#988ED5"), 1, "viridis"),
    "dashes.mplstyle": (("r", "g", "b"), 2, "viridis"),
    None: (style.COLOURS[:3], 1, "viridis"),
}


@pytest.mark.parametrize("name", STYLES)
def test_curves_are_told_apart_as_the_style_says(name, stores, tmp_path, monkeypatch):
    """In greys by lines and markers, too."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dashes.mplstyle").write_text(
        "axes.prop_cycle: cycler('color', ['r', 'g', 'b']) + cycler('linestyle', ['-', '--', '-'])\n"
    )
    colours, looks, shades = STYLES[name]
    data = stores["grid"].isel(normal_force=slice(3), hurst=0)
    with page.drawing_for(page.Page(), name):
        figure = drawn({"": data}, MU, "velocity", by="normal_force")
        assert style.shades([1.0, 2.0])[0].name == shades
    lines = [line for line in figure.axes[0].lines if str(line.get_label()).startswith("$F_N$")]
    assert tuple(line.get_color() for line in lines) == colours
    assert len({(line.get_linestyle(), line.get_marker()) for line in lines}) == looks


def test_a_title_names_what_has_a_say(stores):
    data = stores["wear"].isel(stick_radius=0)
    for rule, named in (("exact", False), ("fast", True)):
        figure = drawn({"": data.sel({planted.RULE: rule})}, "wear_volume", "cycles")
        assert (r"$\xi$" in figure.get_suptitle()) == named
        assert "points" not in figure.get_suptitle()


def test_a_legend_names_what_is_seen(stores):
    data = stores["grid"].isel(normal_force=slice(2), hurst=0)
    none = data.where(data["normal_force"] < data["normal_force"][1])
    spared = none.assign(status=xr.where(none["status"].notnull(), data["status"], 4).astype(np.int8))
    failed = none.assign(status=xr.where(none["status"].notnull(), data["status"], 3).astype(np.int8))
    for study, count in ((data, 2), (spared, 1), (failed, 2)):
        labels = drawn({"": study}, MU, "velocity", by="normal_force").axes[0].get_legend_handles_labels()[1]
        assert sum(label.startswith("$F_N$") for label in labels) == count


@pytest.mark.parametrize(
    ("study", "output", "over", "view", "sentence"),
    [
        (
            "grid",
            "friction",
            ("velocity",),
            {},
            "no output 'friction' in this study .did you mean 'friction_coefficient'",
        ),
        ("grid", MU, ("speed",), {}, "no axis 'speed'.*varies along normal_force, velocity, hurst"),
        ("grid", MU, ("shear_modulus",), {}, r"shear_modulus is fixed, \$G\$ = 10 MPa; .*varies along"),
        ("grid", MU, ("velocity",), {"by": "velocity"}, "velocity is asked for twice"),
        ("grid", MU, ("velocity", "hurst"), {"by": "normal_force"}, "a map of one series, without --by"),
        ("film", "pressure", ("speed_parameter",), {}, "pressure goes along position: --over position, or --select"),
        ("sampled", MU, ("velocity",), {"panels": "hurst"}, "every case of a sampled study has another hurst: --by"),
        (
            "sampled film",
            "pressure",
            ("position",),
            {"panels": "speed_parameter"},
            "every case of a sampled study has another speed_parameter: --by",
        ),
    ],
)
def test_what_cannot_be_drawn_is_one_sentence(study, output, over, view, sentence, stores):
    with pytest.raises(DataError, match=sentence) as refused:
        of_output(View(output, over, **view)).figure({"": stores[study]})
    assert refused.value.__cause__ is None


@pytest.mark.parametrize(("least", "is_geometric"), [(0.0, False), (-1.0, False), (1e-3, True)])
def test_a_law_is_drawn_over_zero_too(least, is_geometric):
    data = xr.Dataset(coords={"velocity": [least, 1.0, 4.0]})
    fine = law_room.along(data, "velocity", 5)["velocity"].to_numpy()
    np.testing.assert_allclose(fine, (np.geomspace if is_geometric else np.linspace)(least, 4.0, 5))


@pytest.mark.parametrize("text", ["85", "85x60", "mm", "85mmx", "1mm", "3m", "85 kg", "85mm x 60N"])
def test_a_size_is_lengths_that_a_page_has(text):
    with pytest.raises(DataError, match=r"expected|size"):
        page.size(text)


def test_sizes_are_read():
    assert page.size("85mm") == (pytest.approx(85 / 25.4), None)
    assert page.size("8.5 cm x 60 mm") == (pytest.approx(85 / 25.4), pytest.approx(60 / 25.4))
    assert page.size("3x2in") == (pytest.approx(3), pytest.approx(2))


def test_a_style_that_is_not_there_is_one_sentence():
    with (
        pytest.raises(
            DataError, match=r"expected a style file, or the name of a style of matplotlib .*'nowhere\.mplstyle'"
        ),
        page.drawing_for(page.Page(), "nowhere.mplstyle"),
    ):
        pass


@pytest.mark.parametrize(("best", "place", "said"), [([1.0, 2.0, 9.0, 3.0, 0.0], 2, "4 of 5"), (None, 2, "4 of 5")])
def test_what_is_held_is_held_in_the_middle_or_where_the_best_is(best, place, said):
    """Of two axes that are held together, one value each; NaN is no best."""
    data = xr.Dataset({"y": (("a", "b"), np.arange(20.0).reshape(5, 4))}, {"a": np.arange(5.0), "b": np.arange(4.0)})
    for shift in range(-1, 2) if best else (0,):
        known = None if best is None else xr.DataArray(np.roll(best, shift), dims="a")
        held, sentences = curves.hold(data, ["a", "b"], known)
        assert (held["a"].item(), held["b"].item()) == (place + shift, 2)
        assert [sentence.startswith(start) for sentence, start in zip(sentences, (said, "3 of 4"), strict=True)]
    nowhere = xr.DataArray(np.full(5, np.nan), dims="a")
    assert curves.hold(data, ["a"], nowhere)[0]["a"].item() == 2


def test_a_long_title_is_small_print_that_leaves_room_for_the_curves():
    figure = Figure(figsize=(3.35, 2.9), layout="constrained")
    axes = figure.subplots()
    style.title(figure, "friction against velocity", ", ".join(f"parameter {k} = {k} mm" for k in range(12)), "bars")
    figure.draw_without_rendering()
    assert axes.get_window_extent().height > 0.5 * figure.bbox.height


@pytest.mark.parametrize("name", style.QUANTITIES)
def test_numbers_are_shown_in_the_unit_that_stands_behind_them(name):
    """Back in SI they are what they were: factors of figures against the units of campaigns."""
    quantity = style.QUANTITIES[name]
    unit = quantity.unit or "1"
    factor, zero = units.conversion(unit, units.dimension_of(unit)[1])
    assert quantity.of(293.7) * factor + zero == pytest.approx(293.7, rel=1e-12)


@pytest.mark.parametrize(("unit", "there"), [("degC", 20.0), ("K", 293.15)])
def test_a_temperature_is_shown_in_the_unit_asked_for(unit, there):
    """Its zero lies elsewhere."""
    temperature = xr.DataArray(293.15, attrs={"units": "K"})
    with page.drawing_for(page.Page(units={"temperature": unit})):
        assert style.shown("temperature", temperature) == pytest.approx(there, rel=1e-12)


@pytest.mark.parametrize("low", [0.02, 0.2, 2.0, 200.0])
def test_an_axis_of_less_than_two_decades_has_plain_numbers(low):
    axes = Figure().subplots()
    axes.plot([low, 6 * low], [1, 2])
    axes.set_xlim(low, 6 * low)
    style.logarithmic(axes, "x")
    axes.figure.draw_without_rendering()
    shown = [float(label.get_text()) for label in axes.get_xticklabels() if label.get_text()]
    assert shown == pytest.approx([low, 2.5 * low, 5 * low])


@pytest.mark.parametrize(("unit", "boiling"), [("K", 373.15), ("degC", 100.0)])
def test_a_temperature_is_drawn_on_the_scale_that_was_asked_for(unit, boiling):
    values = xr.DataArray([373.15], dims="temperature", attrs={"units": "K"})
    with page.with_units({"temperature": unit}):
        shown = style.quantity("temperature", values.rename("temperature"))
    assert shown.unit == unit
    assert 373.15 * shown.factor + shown.offset == pytest.approx(boiling)


@pytest.mark.parametrize("colours", [3, 4, 5])
def test_studies_share_a_panel_while_there_are_colours_for_all_of_their_curves(colours, stores, monkeypatch):
    """Two studies of two curves each."""
    data = stores["grid"].isel(normal_force=[0])
    monkeypatch.setattr(style, "most_colours", lambda: colours)
    figure = drawn({"first": data, "second": data}, MU, "velocity", by="hurst")
    apart = [axes.get_title() for axes in figure.axes[:2]] == ["first", "second"]
    assert apart == (colours < 4)


def test_bars_reach_from_a_value_to_its_ends_and_nowhere_where_those_are_not_known():
    value, low, high = np.array([1.0, 2.0, 3.0]), np.array([0.5, np.nan, 3.5]), np.array([np.inf, np.nan, 3.25])
    np.testing.assert_array_equal(drawing._lengths(value, low, high), [[0.5, 0, 0], [0, 0, 0.25]])


def test_the_law_of_a_rough_indenter_is_that_of_its_hertzian_width(tmp_path):
    """mu / (sqrt 2 slope) = (1 + xi^-alpha)^(-1/alpha) with xi from 8 G a tau v slope^2 / F_N (eqs. 3.34, 3.40)."""
    text = planted.SLIDING + "  indenter: {shape: parabola, radius: 10 mm}\n  normal_force: 1 N\n"
    data = planted.make(tmp_path, text + "  velocity: {geometric: [1 mm/s, 1 m/s, 9]}\n")[""].load()
    figure = drawn({"": data}, MU, "velocity")
    (line,) = (each for each in figure.axes[0].lines if each.get_gid() == style.LAW)
    slope, velocity = data["rms_slope"].mean("realisation").to_numpy(), data["velocity"].to_numpy()
    modulus, time = float(data["shear_modulus"]), float(data["relaxation_time"])
    width = (3 * 1.0 * 0.01 / (16 * modulus)) ** (1 / 3)
    xi = 8 * modulus * width * time * velocity * slope**2 / 1.0 / (np.sqrt(2) * slope)
    np.testing.assert_allclose(line.get_xdata(), velocity)
    law = np.sqrt(2) * slope * (1 + xi**-laws.INDENTER_EXPONENT) ** (-1 / laws.INDENTER_EXPONENT)
    np.testing.assert_allclose(line.get_ydata(), law, rtol=1e-6)
