"""Reading of height maps and line scans in the layouts of instruments."""

import numpy as np
import pytest
from references.areal import areal_surface

from mdr_dask.errors import DataError
from mdr_dask.models.data_file import DataFile
from mdr_dask.models.parts.height_file import Units, dimensions, read_map, read_scan
from mdr_dask.models.parts.surface_files import MapFiles, levelled_map
from mdr_dask.physics.surfaces.spectrum import self_affine

LENGTH, NX, NY = 1e-4, 40, 32
STEP = LENGTH / NX
SPECTRUM = self_affine(0.7, LENGTH / 2, LENGTH / 16, 1e-6)
#: Rows along x, in um, and positions in um.
ROWS = 1e6 * areal_surface(SPECTRUM, (NX, NY), (LENGTH, LENGTH * NY / NX), 1, 0).T
X, Y = 1e6 * STEP * np.arange(NX), 1e6 * STEP * np.arange(NY)
UNITS = Units("um", "", STEP)


def joined(rows, separator="\t", write="{:.9g}"):
    return "\n".join(separator.join(write.format(cell) for cell in row) for row in rows) + "\n"


def xyz(rows=ROWS, order=slice(None)):
    x, y = np.meshgrid(X, Y)
    return np.column_stack([x.ravel(), y.ravel(), rows.ravel()])[order]


def damaged(word, separator="\t"):
    """The map with two points as a word."""
    rows = [[f"{cell:.9g}" for cell in row] for row in ROWS]
    rows[3][5] = rows[20][7] = word
    return "\n".join(separator.join(row) for row in rows) + "\n"


def holed(code, again=True):
    rows = ROWS.copy()
    rows[3, 5] = code
    rows[20, 7] = code if again else np.nan
    return rows


SLOPE = ROWS + 40 * X + 30 * Y[:, None]
JITTERED_X, JITTERED_Y = (axis + 0.1 * np.random.default_rng(2).uniform(-1, 1, axis.size) for axis in (X, Y))
GAPS = np.delete(np.arange(NX * NY), [3 * NX + 5, 20 * NX + 7])
SHUFFLED = np.random.default_rng(1).permutation(GAPS)
JITTER = 0.1 * np.random.default_rng(3).uniform(-1, 1, (GAPS.size, 3)) * [1, 1, 0]
XYZ = Units("um", "um")
#: Text, units, and whether two points are missing.
LAYOUTS = {
    "tabs": (joined(ROWS), UNITS, False),
    "blanks": (joined(ROWS, "  "), UNITS, False),
    "commas": (joined(ROWS, ","), UNITS, False),
    "semicolons, decimal commas": (joined(ROWS, ";").replace(".", ","), UNITS, False),
    "remarks": ("# made by an instrument\n% 2026\n" + joined(ROWS), UNITS, False),
    "preamble": ("Measurement data\nLens,50x\nDate,2026-01-01\nUnit,um\n\n" + joined(ROWS, ","), UNITS, False),
    "axes": (joined(np.vstack([np.r_[0, X], np.c_[Y, ROWS]])), UNITS, False),
    "pandas": ("," + joined([range(NX)], ",") + joined(np.c_[np.arange(NY), ROWS], ","), UNITS, False),
    **{f"missing as {word!r}": (damaged(word), UNITS, True) for word in ("BAD", "***", "-")},
    "missing as nothing": (damaged("", ";"), UNITS, True),
    "missing as 'BAD', decimal commas": (damaged("BAD", ";").replace(".", ","), UNITS, True),
    **{f"missing as {code:g}": (joined(holed(code)), UNITS, True) for code in (9999, -32767, 1.70141e38)},
    "missing as zero": (joined(np.where(holed(np.nan) > -1e9, ROWS + 500, 0) - 0), UNITS, True),
    "xyz": (joined(xyz()), XYZ, False),
    "xyz in any order": (joined(xyz(order=SHUFFLED)), XYZ, True),
    "positions last": (joined(np.c_[ROWS, Y]), UNITS, False),
    "positions with jitter": (joined(np.c_[JITTERED_Y, ROWS]), UNITS, False),
    "axes with jitter": (joined(np.vstack([np.r_[0, JITTERED_X], np.c_[JITTERED_Y, ROWS]])), Units("um", "um"), False),
    "positions beside a slope": (joined(np.vstack([np.r_[0, X], np.c_[JITTERED_Y, SLOPE]])), UNITS, False),
    "missing as 9999 once": (joined(holed(9999, again=False)), UNITS, True),
    "xyz with jitter": (joined(xyz(order=SHUFFLED) + JITTER), XYZ, True),
    "xyz in pixels": (joined(xyz() / [STEP * 1e6, STEP * 1e6, 1]), UNITS, False),
    "xyz with units": ("x [um] y [um] z [nm]\n" + joined(xyz() * [1, 1, 1e3], " "), Units(), False),
    "xyz with units in a remark": ("# X (mm), Y (um), Z (nm)\n" + joined(xyz() * [1e-3, 1, 1e3], ","), Units(), False),
    "xyz among others": (
        "quality,Z [um],Y [um],X [um]\n" + joined(np.c_[np.ones(NX * NY), xyz()[:, ::-1]], ","),
        Units(),
        False,
    ),
    "units in the heading": (f"Unit: um\n# x-spacing: {STEP * 1e6:g} um\n" + joined(ROWS), Units(), False),
    "units in the corner": (joined([["y [um]", *X]], ",", "{}") + joined(np.c_[Y, ROWS], ","), Units("um"), False),
    "surfer": (
        f"DSAA\n{NX} {NY}\n{X[0]} {X[-1]}\n{Y[0]} {Y[-1]}\n{ROWS.min()} {ROWS.max()}\n" + joined(ROWS, " "),
        XYZ,
        False,
    ),
    "esri": (
        f"ncols {NX}\nnrows {NY}\nxllcorner 0\nyllcorner 0\ncellsize {1e6 * STEP}\nNODATA_value -9999\n"
        + joined(holed(-9999)[::-1], " "),
        XYZ,
        True,
    ),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_text_map_is_read_as_it_stands(layout, tmp_path):
    text, units, missing = LAYOUTS[layout]
    path = tmp_path / "map.txt"
    path.write_bytes(text.encode())
    surface, remarks = read_map(DataFile.of(path), units)
    expected = (ROWS + 500 if "zero" in layout else SLOPE if "slope" in layout else ROWS).T * 1e-6
    assert surface.height.shape == expected.shape
    holes = ~np.isfinite(surface.height)
    assert np.count_nonzero(holes) == (2 if missing else 0)
    np.testing.assert_allclose(surface.height[~holes], expected[~holes], atol=1e-13)
    assert surface.size == pytest.approx((LENGTH, LENGTH * NY / NX), rel=1e-3)
    left_out = any(word in layout for word in ("axes", "pandas", "numbers", "position", "corner"))
    assert ("they hold positions or row numbers" in " ".join(remarks)) == (
        left_out and "xyz" not in layout and "preamble" not in layout
    )
    assert dimensions(DataFile.of(path)) == 2


@pytest.mark.parametrize(
    ("text", "units", "message"),
    [
        (joined(ROWS), Units("um"), "does not state its spacing: give `spacing`"),
        (joined(ROWS), Units("", "", STEP), "does not state the unit of its heights: give `unit`"),
        (joined(xyz()), Units("um"), "does not state the unit of its positions: give `x_unit`"),
        (joined(ROWS) + "1\t2\n", UNITS, "line 33 has 2, others 40"),
        (joined(np.c_[Y, ROWS]), Units("um"), "does not state the unit of its positions: give `x_unit`"),
        (joined(np.c_[Y**1.5, ROWS]), UNITS, "expected positions on a regular grid"),
        ("Unit: nm\n" + joined(ROWS), UNITS, "the file states the unit nm, got 'um': leave out `unit`"),
        ("pixel size,2 um\n" + joined(ROWS, ","), UNITS, "2 um in its heading and 2.5 um in `spacing`: leave out"),
        (
            "x [um] y [um] z [nm]\n" + joined(xyz(), " "),
            Units("um"),
            "the file states the unit nm, got 'um': leave out `unit`",
        ),
        (joined(np.c_[xyz(), xyz()]), XYZ, "expected a map, or columns x, y and z, got 6 columns: name the columns"),
        ("", UNITS, "expected the same number of heights in every row"),
    ],
)
def test_unreadable_maps_have_a_message_with_the_remedy(text, units, message, tmp_path):
    path = tmp_path / "map.txt"
    path.write_text(text)
    with pytest.raises(DataError, match=message) as caught:
        read_map(DataFile.of(path), units)
    assert str(caught.value).startswith("map.txt: ")


PLACE, HEIGHT = np.linspace(0, 9.4, 200), np.sin(3 * np.linspace(0, 9.4, 200))
SCANS = {
    "x, z": (joined(np.c_[PLACE, HEIGHT]), Units("um", "mm")),
    "z, x": (joined(np.c_[HEIGHT, PLACE]), Units("um", "mm")),
    "number, x, z": (joined(np.c_[np.arange(200), PLACE, HEIGHT]), Units("um", "mm")),
    "names": ("z [um],x [mm]\n" + joined(np.c_[HEIGHT, PLACE], ","), Units()),
    "names between blanks": ("x [mm] z [um]\n" + joined(np.c_[PLACE, HEIGHT], " "), Units()),
    "heights below results": (
        "//Header\nLc,0.8,mm\n//Result\nRa,0.354,um\nRz,3.005,um\n//Data,R-profile\n" + joined(HEIGHT[:, None]),
        Units("um", "", 9.4e-3 / 199),
    ),
    "names without units": ("x z\n" + joined(np.c_[PLACE, HEIGHT], " "), Units("um", "mm")),
}


@pytest.mark.parametrize("code", [None, -9999.0])
@pytest.mark.parametrize("layout", SCANS)
def test_a_scan_is_read_as_it_stands_and_codes_are_no_heights(layout, code, tmp_path):
    text, units = SCANS[layout]
    path = tmp_path / "line.txt"
    if code:
        text = text.replace(f"{HEIGHT[7]:.9g}", f"{code:g}").replace(f"{HEIGHT[120]:.9g}", f"{code:g}")
    path.write_text(text)
    assert dimensions(DataFile.of(path)) == 1
    x, z, remarks = read_scan(DataFile.of(path), units)
    np.testing.assert_allclose(x, 1e-3 * PLACE, atol=1e-11)
    np.testing.assert_allclose(z, 1e-6 * HEIGHT, atol=2e-8 if code else 1e-13)
    assert ("points counted as missing: 2 points" in " ".join(remarks)) == bool(code)


@pytest.mark.parametrize(
    ("layout", "units", "message"),
    [
        ("x, z", Units("um"), "unit of its positions: give `x_unit`"),
        ("names", Units("nm"), "the file states 'um', got the unit 'nm'"),
    ],
)
def test_a_scan_that_leaves_doubt_is_refused(layout, units, message, tmp_path):
    path = tmp_path / "line.txt"
    path.write_text(SCANS[layout][0])
    with pytest.raises(DataError, match=message):
        read_scan(DataFile.of(path), units)


@pytest.mark.parametrize(
    "columns",
    [(PLACE, PLACE**2 + 0.1 * PLACE), (HEIGHT, HEIGHT[::-1]), (np.arange(200), 2 + np.arange(200), HEIGHT)],
    ids=["two that rise", "two that do not", "three"],
)
def test_columns_that_may_be_positions_or_heights_need_names(columns, tmp_path):
    (tmp_path / "line.txt").write_text(joined(np.column_stack(columns)))
    message = f"one column of positions and one of heights, got {len(columns)} columns: name the columns"
    with pytest.raises(DataError, match=message):
        read_scan(DataFile.of(tmp_path / "line.txt"), Units("um", "mm"))


def test_units_in_a_file_are_used_and_must_not_contradict_options(tmp_path):
    path = tmp_path / "gwyddion.txt"
    height = LENGTH * NY / NX * 1e6
    head = f"# Channel: Height\n# Width: {1e6 * LENGTH:g} µm\n# Height: {height:g} µm\n# Value units: nm\n"
    path.write_text(head + joined(ROWS * 1e3))
    file = DataFile.of(path)
    surface, _ = read_map(file, Units())
    np.testing.assert_allclose(surface.height, ROWS.T * 1e-6, atol=1e-13)
    assert surface.size == pytest.approx((LENGTH, height * 1e-6))
    for units, message in ((Units("mm"), "leave out `unit`"), (Units("", "", 5e-6), "leave out `spacing`")):
        with pytest.raises(DataError, match=message):
            read_map(file, units)


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_sq_is_the_rms_height_of_surface_topography(tilt, tmp_path):
    topography = pytest.importorskip("SurfaceTopography")
    rows = holed(np.nan) + tilt * X + 0.1 * tilt * Y[:, None]
    path = tmp_path / "map.npy"
    np.save(path, rows)
    masked = np.ma.masked_invalid(rows.T)
    theirs = topography.Topography(masked, (LENGTH, LENGTH * NY / NX)).detrend("height")
    maps = MapFiles(files=(DataFile.of(path),), unit="um", spacing=STEP)
    ours = levelled_map(maps, maps.files[0])
    assert ours.height_rms == pytest.approx(1e-6 * float(np.sqrt(np.mean(theirs.heights() ** 2))), rel=1e-6)
