"""What the table of a figure has to hold, worked out from the store alone, and whether a picture shows its table."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from matplotlib.lines import Line2D
from scipy.spatial import cKDTree

from mdr_dask import aggregation, fits
from mdr_dask.errors import FitError
from mdr_dask.fits.friction import numbers, spectral_slope
from mdr_dask.fits.indenter import indenter_xi, within_indenter_law
from mdr_dask.fits.kinetics import well_known
from mdr_dask.models.ehl_line import groups as groups_of
from mdr_dask.physics.lubrication import film_formulas
from mdr_dask.physics.sliding import laws
from mdr_dask.plots import style
from mdr_dask.plots.table import FIRST, LAST

#: Values agree to this part: rounding of sums in another order.
SAME = 1e-7
UNKNOWN = 1e4  # stands for a number that is not there


def rows(x=None, y=None, value=None):
    """Expected rows of a table; each of the three is an array, or a mean with the ends of its interval."""
    given = {"x": x, "y": y, "value": value}
    parts = {}
    for name, each in given.items():
        ends = each if isinstance(each, tuple) else (each, None, None)
        parts |= {f"{name}{end}": part for end, part in zip(("", "_low", "_high"), ends, strict=True)}
    known = {name: xr.DataArray(part) for name, part in parts.items() if part is not None}
    known = {name: part.drop_vars([*part.coords]) for name, part in known.items()}
    flat = dict(zip(known, (np.ravel(part) for part in xr.broadcast(*known.values())), strict=True))
    frame = pd.DataFrame({name: flat.get(name, np.nan) for name in LAST})
    last = "value" if value is not None else "y"
    return frame[np.isfinite(frame[last])]


def stored(data, name, factor=1.0, offset=0.0):
    """Mean and ends of the interval of an output: scatter and error of the grid."""
    values = data[name] * factor + offset
    error = data[f"{name}_error"] * factor if f"{name}_error" in data else None
    middle = values.mean("realisation")
    low, high = (aggregation.interval(values, error).isel(bound=k, drop=True) for k in (0, 1))
    if error is not None:
        half = abs(error).mean("realisation")
        low, high = low.fillna(middle - half), high.fillna(middle + half)
    return middle, low, high


def mismatches(found: pd.DataFrame, known: pd.DataFrame) -> pd.DataFrame:
    """Return the rows that are not among those known."""
    found, known = (each.reindex(columns=LAST) for each in (found, known))
    if not len(known):
        return found
    scales = known.abs().where(np.isfinite(known)).max().fillna(1.0).replace(0.0, 1.0)

    def places(frame):
        return np.arcsinh((frame / scales).fillna(UNKNOWN) * 1e12).to_numpy(dtype=float)

    distance, _ = cKDTree(places(known)).query(places(found), p=np.inf)
    return found[distance > SAME]


def check_picture(figure) -> None:
    """Everything that is drawn in data coordinates is marked, and what is marked stands in the table."""
    table = figure.table()
    for number, axes in enumerate(figure.panels(), start=1):
        here = table[table["panel"] == number]
        shown = [line.get_xydata() for line in axes.lines if line.get_gid() in (style.DATA, style.LAW)]
        shown += [part.get_offsets().data for part in axes.collections if _is(part, "PathCollection")]
        meshes = [np.ravel(part.get_array()) for part in axes.collections if _is(part, "QuadMesh")]
        points = np.concatenate([np.zeros((0, 2)), *shown]).astype(float)
        points = points[np.isfinite(points[:, 1])]
        wanted = here[["x", "y"]].to_numpy(dtype=float)
        if meshes:
            wanted = here[["value"]].to_numpy(dtype=float)
            points = np.concatenate(meshes)[:, None]
            points = points[np.isfinite(points[:, 0])]
        wanted = wanted[np.isfinite(wanted[:, -1])]
        order, wanted_order = (np.lexsort(each.T) for each in (points, wanted))
        np.testing.assert_array_equal(points[order], wanted[wanted_order])
        ends = _ends(axes)
        known = np.sort(here.filter(regex="^[xy]").to_numpy(dtype=float).ravel())
        known = known[np.isfinite(known)]
        near = known[np.clip(np.searchsorted(known, ends), 0, known.size - 1)]
        before = known[np.clip(np.searchsorted(known, ends) - 1, 0, None)]
        assert np.all(np.minimum(abs(near - ends), abs(before - ends)) <= 1e-9 * abs(ends) + 1e-300)
    for axes in figure.axes:
        _check_look(axes)
        for artist in [*axes.lines, *axes.collections]:
            if axes.get_label() != "<colorbar>" and _shows_data(artist, axes):
                assert artist.get_gid(), f"{artist} is in no table"


def _check_look(axes) -> None:
    """A legend stands in its panel or beside it; colours that part at white part at zero."""
    if legend := axes.get_legend():
        corners = axes.transAxes.inverted().transform(legend.get_bbox_to_anchor().get_points())
        assert np.all((corners > -0.6) & (corners < 1.6))
    for part in axes.collections:
        if _is(part, "QuadMesh") and part.get_cmap().name.startswith("RdBu"):
            low, high = part.get_clim()
            assert -low == high > 0


#: Laws as figures name them, in closed form once more; each has to be drawn wherever its figure is.
CLOSED_LAWS = {
    "plateau": {"√2 (eq. 3.15)": lambda x: 2**0.5 + 0 * x},
    "zone_one": {"H / (1 + H) (eq. 3.13)": lambda x: x / (1 + x), "1.6 of the docs": lambda x: 1.6 + 0 * x},
    "collapse": {"law (eq. 3.18)": lambda x: x / (1 + x**2) ** 0.5},
    "indenter": {
        "law (eq. 3.40), alpha = 1.5": lambda x: x / (1 + x**1.5) ** (2 / 3),
        "limits (eq. 3.34, 3.36)": lambda x: np.minimum(x, 1),
    },
    "jump_law": {"eq. 4.11, 0.4": lambda x: x / (1 + (x / 0.4) ** 2) ** 0.5, "eq. 4.9": lambda x: x},
    "relaxation_power": {"1 - H": lambda x: 1 - x, "1": lambda x: 1 + 0 * x},
    "film_regimes": {
        "rigid isoviscous": lambda x: 4.895 / (2 * x),
        "elastic isoviscous": lambda x: 2.05 * x**-0.2,
    },
}
#: Lines across a panel at fixed places: those that stand up, and those that lie.
GUIDES = {
    "relaxation_rate": ((1.0,), ()),
    "jump_fit": ((), (0.0,)),
    "profiles": ((-1.0, 1.0), ()),
    "stribeck": ((), (1.0,)),
    "film_formula": ((), (1.0,)),
}
#: Figures whose ordinate begins at zero.
FROM_ZERO = {"regions", "velocity", "plateau", "zone_one", "trace", "traction", "starvation", "film_profile"}
#: Bands that a law is known within.
BANDS = {"jump_law": "fitted", "jump_fit": "one exponential"}


def check_laws(name: str, figure) -> None:
    """Laws are where their names say, all of them, and bands are about what they belong to."""
    table = figure.table()
    for curve, law in CLOSED_LAWS.get(name, {}).items():
        drawn = table[(table["curve"] == curve) | table["curve"].str.startswith(f"{curve}:")]
        assert len(drawn), f"{curve} is not drawn"
        np.testing.assert_allclose(drawn["y"], law(drawn["x"]), rtol=2e-4, atol=1e-9, err_msg=curve)
    if name == "relaxation_rate":
        _check_powers(table)
    if name == "jump_fit":
        _check_exponentials(table)
        _check_window(*figure.axes[:2])
    table = table.reindex(columns=[*FIRST, *LAST])
    bands = table[table["y_low"].notna() & table["y"].isna()]
    assert (bands["y_low"] <= bands["y_high"]).all()
    if name in BANDS:
        assert bands["what"].str.startswith(BANDS[name]).any()


def check_limits(name: str, figure) -> None:
    """All data lie within their panels, the ends that a figure sets are where they belong, and so are its guides."""
    standing, lying = GUIDES.get(name, ((), ()))
    seen = [_guides(axes) for axes in figure.panels()]
    assert set(standing) <= {x for found, _ in seen for x in found}
    assert set(lying) <= {y for _, found in seen for y in found}
    for axes in figure.panels():
        points = np.concatenate([np.zeros((0, 2)), *_points(axes)])
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            continue
        for k, (ends, scale) in enumerate(((axes.get_xlim(), axes.get_xscale()), (axes.get_ylim(), axes.get_yscale()))):
            shown = points[:, k][(points[:, k] > 0) | (scale != "log")]
            if name != "jump_fit" or k == 1:  # of which `_check_window` knows more
                assert np.all((shown >= min(ends)) & (shown <= max(ends))), (name, "xy"[k])
        _check_ends(name, axes, points)


def check_words(name: str, figure) -> None:
    """Parameters that titles and labels name have the values of the points; those of a case are named where held."""
    table = figure.table()
    over = figure.get_suptitle().replace("\n", " ")
    titles = [over, *(axes.get_title().replace("\n", " ") for axes in figure.axes)]
    for parameter, value in table.attrs["held"].items():
        here = [title for title in titles if _names(title, parameter)]
        assert here or parameter not in OF_A_CASE or name in BARE, f"{parameter} is held, and not named"
        assert all(_says(title, parameter, value, table.attrs["units"][parameter]) for title in here)
    for each in figure.rows:
        for parameter, unit in each.units.items():
            values = set(each.columns[parameter])
            if len(values) == 1:
                for text in (each.label, each.axes.get_title().replace("\n", " ")):
                    assert _says(text, parameter, *values, unit), (text, parameter, values)


#: What titles have to name, as far as nothing on the figure varies it; and figures of cases that have no numbers alike.
OF_A_CASE = {
    *("normal_force", "velocity", "velocity_change", "shear_modulus", "relaxation_time", "rms_roughness"),
    *("temperature", "rotation_speed", "layer_thickness", "stick_radius", "cycles", "load_parameter"),
    *("line_load", "mean_velocity", "radius", "viscosity"),
}
BARE = {"film_formula", "film_regimes", "regime_map"}


def _names(text: str, parameter: str) -> bool:
    symbol = style.named(parameter, xr.DataArray(1.0)).split(" = ")[0]
    return f" {symbol} = " in f" {text}"


def _says(text: str, parameter: str, value, unit: str) -> bool:
    """Return whether a text that names a parameter gives it this value, in the unit of figures or as it was written."""
    known = xr.DataArray(value, attrs={"units": unit})
    written = f" = {value:.4g} {unit}" if known.dtype.kind in "fiu" else str(value)
    return not _names(text, parameter) or style.named(parameter, known) in text or written in text


def check_colours(figure) -> None:
    """Curves of more colours than can be told apart have a colour bar, and each the colour of its value there."""
    for axes in figure.panels():
        curves = [each for each in figure.rows if each.axes is axes and each.artist.get_gid() == style.DATA]
        lines = [each for each in curves if isinstance(each.artist, Line2D) and len(each.columns["x"])]
        bars = [
            bar.drawn for bar in figure.bars if any(axes.bbox.bounds == beside.bbox.bounds for beside in bar.panels)
        ]
        assert bars or len({str(each.artist.get_color()) for each in lines}) <= style.most_colours()
        for bar in bars:
            named = [each for each in lines for name in each.units if style.label(name) == bar.ax.get_ylabel()]
            for each in named:
                (name,) = (name for name in each.units if style.label(name) == bar.ax.get_ylabel())
                value = style.shown(name, xr.DataArray(each.columns[name][0], attrs={"units": each.units[name]}))
                assert each.artist.get_color() == pytest.approx(bar.mappable.to_rgba(value)), name
                rounding = 1e-9 * abs(value)
                assert bar.vmin - rounding <= value <= bar.vmax + rounding, name


def _check_ends(name: str, axes, points: np.ndarray) -> None:
    """Ends that are a part of the data, once more."""
    (least, low), (most, high) = points.min(axis=0), points.max(axis=0)
    bottom, top = axes.get_ylim()
    if name in FROM_ZERO:
        assert bottom == 0
    if name == "jump_law":
        assert (bottom, top) == pytest.approx((points[points[:, 1] > 0, 1].min() / 2, 3 * high))
    if name == "film_regimes":
        assert (bottom, top) == pytest.approx((0.5 * min(low, 2.05 * (2 * most) ** -0.2), 2 * high))
    if name == "starvation":
        assert axes.get_xlim() == pytest.approx((1.15 * least, 0.95 * most))
    if name == "film_profile" and axes.get_ylabel().startswith("film"):
        assert top == pytest.approx(3 * points[abs(points[:, 0]) <= 1, 1].max())


def _points(axes) -> list[np.ndarray]:
    shown = [line.get_xydata() for line in axes.lines if line.get_gid() == style.DATA]
    shown += [part.get_offsets().data for part in axes.collections if _is(part, "PathCollection")]
    return [np.asarray(each, dtype=float) for each in shown]


def _guides(axes) -> tuple[list[float], list[float]]:
    """Return where lines stand that go from bottom to top, and where those lie that go from side to side."""
    lines = [line for line in axes.lines if line.get_transform() != axes.transData]
    standing = [line.get_xdata()[0] for line in lines if list(line.get_ydata()) == [0, 1]]
    return standing, [line.get_ydata()[0] for line in lines if list(line.get_xdata()) == [0, 1]]


def _check_powers(table: pd.DataFrame) -> None:
    """The power of a regime goes from one of its rates to another, and not into the other regime."""
    x = table.loc[table["what"] == "power fitted", "x"]
    assert set(x) <= set(table.loc[table["what"] == "data", "x"])
    for first, last in zip(x.iloc[::2], x.iloc[1::2], strict=True):
        assert first < last < 1 or 1 <= first < last


def _check_exponentials(table: pd.DataFrame) -> None:
    """A relaxation falls with the rate that its label tells to three digits."""
    told = table["curve"].str.extract(r"^b = ([\d.]+)", expand=False).astype(float)
    for law in ("weights 1/variance", "all times alike", "of eq. 4.12"):
        assert table["curve"].str.endswith(law).any(), f"{law} is not drawn"
    for (panel, curve), rows in table[told.notna()].groupby(["panel", "curve"]):
        rate = -np.polyfit(rows["x"], np.log(np.abs(rows["y"])), 1)[0]
        assert abs(rate / told[rows.index[0]] - 1) < 0.01, (panel, curve, rate)


def _check_window(linear, logarithmic) -> None:
    """The window of the fit fills five sixths of one panel, and the other goes from the first moment to the last."""
    (window,) = (line.get_xdata()[0] for line in linear.lines if line.get_label() == "end of the window")
    assert linear.get_xlim() == pytest.approx((0, 1.2 * window))
    moments = np.concatenate([line.get_xdata() for line in logarithmic.lines if line.get_gid() == style.DATA])
    assert logarithmic.get_xlim() == pytest.approx((moments[moments > 0].min(), moments.max()))


def _is(artist, kind: str) -> bool:
    return type(artist).__name__ == kind and artist.get_gid() == style.DATA


def _shows_data(artist, axes) -> bool:
    if isinstance(artist, Line2D):
        drawn = np.size(artist.get_xdata()) and np.isfinite(np.asarray(artist.get_ydata(), dtype=float)).any()
        return bool(drawn) and artist.get_transform() == axes.transData
    return True


def _ends(axes) -> np.ndarray:
    """Return the ends of all bars and bands: their heights, or their places where bars lie sideways."""
    found = [np.zeros(0)]
    for part in axes.collections:
        if part.get_gid() == style.BAND:
            for path in part.get_paths():
                lies = np.ptp(path.vertices[:, 1]) == 0 and np.ptp(path.vertices[:, 0]) > 0
                found.append(path.vertices[:, 0 if lies else 1])
    ends = np.concatenate(found)
    return ends[np.isfinite(ends)]


def constants(found, name):
    return tuple(found[f"{name}{end}"] for end in ("", "_low", "_high"))


def fitted(name):
    """Return a function from a series to the constants of a fit."""

    def of(data):
        try:
            return fits.available(data.attrs["model"])[name].compute({"": data})
        except FitError:
            return None

    return of


# --- sliding friction


def _kelvin(data):
    return {"shear_modulus", "rms_roughness", "hurst"} <= set(data.coords)


def _plane(data):
    return _kelvin(data) and not any(str(name).startswith("indenter_") for name in data.coords)


def friction(data):
    factor = 1 / spectral_slope(data) if _kelvin(data) else 1.0
    return [rows(data["velocity"], stored(data, "friction_coefficient", factor))]


def in_numbers(data):
    if not _plane(data):
        return friction(data)
    _, _, velocity = numbers(data)
    return [rows(velocity, stored(data, "friction_coefficient", 2**-0.5 / spectral_slope(data)))]


def collapse(data):
    ratio, force, velocity = numbers(data)
    crossover = laws.crossover(force, laws.alpha(data["hurst"]), laws.BETA)
    y = ratio.mean("realisation") / 2**0.5
    y = y.where(y > 0)
    return [rows(velocity / crossover, y.broadcast_like(by + y), by + 0 * y) for by in (data["hurst"], force)]


def growth(data):
    force, _ = (numbers(data)[k] for k in (1, 2))
    slope = spectral_slope(data)
    return [
        rows(force, stored(data, "contact_fraction")),
        rows(force, stored(data, "contact_slope", 1 / slope)),
    ]


def against_hurst(name, *of):
    def expected(data):
        found = fitted(name)(data)
        return [] if found is None else [rows(data["hurst"], constants(found, each)) for each in of]

    return expected


def indenter(data):
    slope = spectral_slope(data)
    value = stored(data, "friction_coefficient", 2**-0.5 / slope)
    xi, within = indenter_xi(data, slope), within_indenter_law(data, slope)
    inside = [each.where(within) for each in value]
    return [rows(xi, tuple(inside)), rows(xi, value[0].where(~within & (value[0] > 0)))]


# --- velocity jump


def trace(data):
    slope = data["rms_slope"]
    before, jump = (f"friction_coefficient_{part}" for part in ("before", "jump"))
    at = data.assign(at=data[before] + data[jump])
    if f"{before}_error" in data:
        at["at_error"] = abs(data[f"{before}_error"]) + abs(data[f"{jump}_error"])
    time = data["relaxation_times"]
    course = stored(data, "friction_coefficient", 1 / slope)
    start, instant = stored(data, before, 1 / slope), stored(at, "at", 1 / slope)
    shown = float(time[time <= max(3.0, float(time[1]))][-1])
    whole = [rows(time, course), rows(-0.3 * shown, start), rows(0.0, start), rows(0.0, instant)]
    bare = [rows(time, course[0]), *(rows(x, y[0]) for x, y in ((-0.3 * shown, start), (0.0, start), (0.0, instant)))]
    steady = [rows(data["velocity"], start)]
    return [*whole, *bare, *steady]


def relaxing(data):
    part = (data["friction_coefficient"] - data["friction_coefficient_after"]) / data["rms_slope"]
    return [rows(data["relaxation_times"], stored(xr.Dataset({"part": part}), "part"))]


def jump_height(data):
    found = fitted("kinetics")(data)
    names = ("before_over_slope", "jump_over_slope")
    return [] if found is None else [rows(data["velocity"], constants(found, name)) for name in names]


def jump_law(data):
    found = fitted("kinetics")(data)
    if found is None:
        return []
    return [rows(constants(found, "before_over_slope"), constants(found, "jump_over_slope"))]


def rate(data):
    found = fitted("relaxation")(data)
    if found is None:
        return []
    known = well_known(found["rate_low"], found["rate_high"])
    return [rows(found["passing_number"], tuple(each.where(known) for each in constants(found, "rate")))]


def power(data):
    found = fitted("rate_power")(data)
    if found is None:
        return []
    alike = constants(found.sel(regime="above"), "power_unweighted")
    return [rows(data["hurst"], constants(found, "power")), rows(data["hurst"], alike)]


# --- rollers, films, wear


def share(data):
    return stored(data, "contact_length", 50 / data["contact_half_width"])


def rolling(x):
    def expected(data):
        of = dict.fromkeys(("breakthrough_probability", "asperity_load_share"), 100.0)
        of |= dict.fromkeys(("friction_coefficient", "film_ratio"), 1.0)
        found = [rows(x(data), stored(data, name, factor)) for name, factor in of.items() if name in data]
        return [*found, rows(x(data), share(data))] if "contact_half_width" in data else found

    return expected


def sensitivity(data):
    return [
        rows(
            style.shown(name, data[name])
            if data[name].ndim == 0
            else xr.DataArray(style.shown(name, data[name]), dims=data[name].dims),
            stored(data, "breakthrough_probability", 100.0),
        )
        for name in data.coords
        if data[name].dims and set(data[name].dims) <= set(data["status"].dims) and data[name].dtype.kind in "fiu"
    ]


def surfaces(data):
    return [rows(data["position"], data[name].isel(realisation=0) * 1e6) for name in ("upper_profile", "lower_profile")]


def turn(data):
    time = data["angle"] / data["rotation_speed"] * 1e3
    return [rows(time, data["contact_length_trace"].isel(realisation=0) * 1e6)]


def film(name, factor=1.0):
    return stored_one(name, factor)


def stored_one(name, factor):
    return lambda data: stored(data.isel(realisation=[0]), name, factor)


def film_profile(data):
    one = data.isel(realisation=[0])
    return [rows(data["position"], stored(one, "pressure", 1e-9)), rows(data["position"], stored(one, "film"))]


def _case(data, output):
    return (*groups_of(data.coords.get), data[output].isel(realisation=0))


def film_formula(data):
    found = []
    for output, formula in (
        ("central_film", film_formulas.PAN_HAMROCK_CENTRAL),
        ("minimum_film", film_formulas.PAN_HAMROCK_MINIMUM),
    ):
        W, U, G, value = xr.broadcast(*map(xr.DataArray, _case(data, output)))
        law = xr.DataArray(formula(W.values, U.values, G.values), dims=value.dims)
        found.append(rows(law, value / law))
    return found


def _moes(data):
    W, U, G, value = xr.broadcast(*map(xr.DataArray, _case(data, "minimum_film")))
    return W * (2 * U) ** -0.5, G * (2 * U) ** 0.25, W, U, G, value


def film_regimes(data):
    M, L, _, U, _, value = _moes(data)
    return [rows(M, value * (2 * U) ** -0.5, L + 0 * value)]


def regime_map(data):
    M, L, W, U, G, value = _moes(data)
    flat = [np.ravel(each) for each in (W, U, G)]
    limits = film_formulas.limiting_films(*flat)[film_formulas.regime(*flat), range(flat[0].size)]
    return [rows(M, L, value / limits.reshape(value.shape))]


def along(name, *outputs):
    def expected(data):
        return [rows(data[name], stored(data.isel(realisation=[0]), output)) for output in outputs]

    return expected


def worn(data):
    names = (("worn_profile", "radius"), ("worn_image", "position"))
    return [rows(data[place], stored(data, output)) for output, place in names if output in data]


def volume(data):
    found = []
    for name in ("cycles", "path"):
        if name in data.coords:
            values = data["wear_volume"]
            if values.sizes["realisation"] < 2:
                found.append(rows(data[name], stored(data, "wear_volume")))
                continue
            known = values.notnull().any("realisation")
            ends = [values.where(known, 0.0).quantile(q, "realisation").where(known) for q in (0.5, 0.025, 0.975)]
            found.append(rows(data[name], tuple(ends)))
    return found


def fast_error(groups):
    exact, fast = (
        groups[name].isel(realisation=0).transpose("stick_radius", "cycles", ...) for name in ("exact", "fast")
    )
    fast = fast.isel(hold=fast.sizes["hold"] // 2)
    off = fast["worn_profile"] - exact["worn_profile"].drop_vars("xi")
    rms = (off**2).mean("radius") ** 0.5
    near = int(np.argmin(abs(fast["xi"].values - 0.8)))
    largest = abs(off).max("radius").isel(xi=near)
    volumes = 100 * (fast["wear_volume"] / exact["wear_volume"].drop_vars("xi") - 1).isel(xi=near)
    best = fast["xi"].isel(xi=rms.argmin("xi"))
    maps = [rows(rms["cycles"], rms["stick_radius"], each) for each in (largest, volumes, best)]
    return [*maps, rows(fast["xi"], (rms**2).mean(["stick_radius", "cycles"]) ** 0.5)]


#: Rows that a figure may draw of a series; `fast_error` takes all series of a store.
EXPECTED = {
    "regions": friction,
    "force": friction,
    "velocity": in_numbers,
    "collapse": collapse,
    "contact_growth": growth,
    "zone_one": against_hurst("zone_one", "alpha", "beta"),
    "plateau": against_hurst("plateau", "plateau"),
    "indenter": indenter,
    "jump_trace": trace,
    "jump_velocities": trace,
    "jump_fit": relaxing,
    "jump_height": jump_height,
    "jump_law": jump_law,
    "relaxation_rate": rate,
    "relaxation_power": power,
    "relaxation_course": trace,
    "temperature": rolling(lambda data: data["temperature"] - 273.15),
    "stribeck": rolling(lambda data: data["rotation_speed"] * 30 / np.pi),
    "sensitivity": sensitivity,
    "profiles": surfaces,
    "trace": turn,
    "film_profile": film_profile,
    "film_formula": film_formula,
    "film_regimes": film_regimes,
    "regime_map": regime_map,
    "starvation": along("inlet", "central_film", "minimum_film"),
    "traction": along("slide_roll_ratio", "traction_coefficient"),
    "wear_development": worn,
    "wear_profiles": worn,
    "wear_growth": volume,
    "fast_wear_error": fast_error,
}


def expected(name: str, groups) -> pd.DataFrame:
    """Return all rows that a figure may draw of a store."""
    if name == "fast_wear_error":
        return pd.concat(fast_error(groups))
    parts = []
    for data in groups.values():
        try:
            parts += EXPECTED[name](data)
        except (KeyError, FitError):
            continue
    return pd.concat(parts)
