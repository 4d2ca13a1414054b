"""Files of measured surfaces: layouts, noise, outliers, anisotropy and bad files."""

import numpy as np
import pytest
from pydantic import ValidationError
from references.areal import areal_surface

from mdr_dask.models.parts.height_file import Units, read_map
from mdr_dask.models.parts.surface import Surface, spectra_of
from mdr_dask.physics.surfaces.spectrum import self_affine

topography = pytest.importorskip("SurfaceTopography")

LENGTH, POINTS = 2e-3, 256
SPECTRUM = self_affine(0.7, LENGTH / 4, LENGTH / 64, 1e-6)
HEIGHT = areal_surface(SPECTRUM, (POINTS, POINTS), (LENGTH, LENGTH), 1, 0)
CONTEXT = {"to_si": lambda value, unit: float(value.split()[0]) * 1e-6}


def surface(directory, **kind):
    return Surface.model_validate(kind, context=CONTEXT | {"directory": directory})


def refused(directory, **kind):
    with pytest.raises(ValidationError) as caught:
        surface(directory, **kind)
    (error,) = caught.value.errors()
    return error["msg"]


def test_every_format_of_a_map_is_the_same_map(tmp_path):
    """Rows along x in npy, and a format of SurfaceTopography; layouts of text are tested with the reader."""
    np.save(tmp_path / "map.npy", HEIGHT.T * 1e6)
    spacing = {"spacing": LENGTH / POINTS, "unit": "um", "window": "none"}
    found = [surface(tmp_path, map={"files": ["map.npy"], **spacing})]
    size = LENGTH * 1e3, LENGTH * 1e3
    topography.Topography(HEIGHT * 1e3, size, unit="mm").to_netcdf(str(tmp_path / "map.nc"))
    found.append(surface(tmp_path, map={"files": ["map.nc"], "window": "none"}))
    topography.Topography(HEIGHT * 1e3, size).to_netcdf(str(tmp_path / "bare.nc"))
    found.append(surface(tmp_path, map={"files": ["bare.nc"], "unit": "mm", "window": "none"}))
    for one in found:
        maps = one.map
        heights, _ = read_map(maps.files[0], Units(maps.unit, maps.x_unit, maps.spacing, maps.spacing_y))
        np.testing.assert_allclose(heights.height, HEIGHT, atol=1e-14)
        assert heights.size == pytest.approx((LENGTH, LENGTH))
        (spectrum,) = spectra_of(one)
        assert spectrum.rms_gradient() == pytest.approx(SPECTRUM.rms_gradient(), rel=0.02)


def test_noise_begins_where_roughness_ends(tmp_path):
    """Roughness of a map ends at a 64th of its length, that of a scan at a 128th; white noise goes on."""
    generator = np.random.default_rng(1)
    np.save(tmp_path / "map.npy", HEIGHT + 1e-7 * generator.standard_normal(HEIGHT.shape))
    wide = self_affine(0.7, LENGTH / 8, LENGTH / 128, 1e-6)
    line = areal_surface(wide, (16, 4096), (LENGTH / 16, LENGTH), 1, 0)[0] + 5e-8 * generator.standard_normal(4096)
    place = np.arange(4096) * LENGTH / 4096
    rows = "\n".join(f"{x * 1e3:.9g},{1e6 * z:.9g}" for x, z in zip(place, line, strict=True))
    (tmp_path / "line.csv").write_text("x [mm],z [um]\n" + rows)
    of_map = surface(tmp_path, map={"files": ["map.npy"], "spacing": LENGTH / POINTS, "unit": "m"})
    of_scan = surface(tmp_path, scan={"files": ["line.csv"]})
    for one, (found,), ends in ((of_map, of_map.map.found(), 64), (of_scan, of_scan.scan.found(), 128)):
        (spectrum,) = spectra_of(one)
        assert spectrum.wavenumber[-1] * found.resolution == pytest.approx(2 * np.pi)
        assert 0.8 < LENGTH / found.resolution / ends < 1.2
        assert f"wavelengths below {1e6 * found.resolution:.4g} um contain only noise" in " ".join(one.notes())


def test_noise_outliers_and_missing_points_are_reported(tmp_path):
    generator = np.random.default_rng(1)
    noisy = HEIGHT + 1e-7 * generator.standard_normal(HEIGHT.shape)
    noisy[40, 50], noisy[90, 70] = 1e-4, 1.1e-4
    noisy[100:104, 100:104] = np.nan
    np.save(tmp_path / "map.npy", noisy)
    options = {"files": ["map.npy"], "spacing": LENGTH / POINTS, "unit": "m"}
    filled = surface(tmp_path, map=options | {"outliers": "fill"})
    notes = " ".join(filled.notes())
    assert "contain only noise" in notes
    assert "outliers replaced: 2" in notes
    (spectrum,) = spectra_of(filled)
    assert spectrum.rms_gradient() == pytest.approx(SPECTRUM.rms_gradient(), rel=0.1)
    (everything,) = spectra_of(
        surface(tmp_path, map=options | {"outliers": "fill"}, shortest_wavelength=2 * LENGTH / 250)
    )
    assert everything.rms_gradient() > 1.2 * spectrum.rms_gradient()
    assert "outliers (far from their neighbours): 2 (`outliers: fill`" in " ".join(
        surface(tmp_path, map=options).notes()
    )


def test_an_anisotropic_map_needs_a_direction(tmp_path):
    grooves = areal_surface(SPECTRUM, (POINTS, POINTS), (LENGTH, 3 * LENGTH), 1, 0)
    np.save(tmp_path / "map.npy", grooves.T)
    options = {"files": ["map.npy"], "spacing": LENGTH / POINTS, "unit": "m", "window": "none"}
    assert "expected an isotropic surface, got an anisotropy of 0." in refused(tmp_path, map=options)
    slopes = [spectra_of(surface(tmp_path, map=options | {"direction": axis}))[0].rms_gradient() for axis in "xy"]
    assert slopes[1] / slopes[0] == pytest.approx(3, rel=0.1)
    stepped = HEIGHT.copy()
    stepped[:, 100:] += 2e-5
    np.save(tmp_path / "map.npy", stepped.T)
    assert "expected an isotropic surface" in refused(tmp_path, map=options | {"window": "hann"})


def test_noise_hides_no_grooves_and_few_waves_are_no_grooves(tmp_path):
    """Only the wavelengths above the noise count, and few waves of an isotropic map have much scatter."""
    noise = 2e-7 * np.random.default_rng(1).standard_normal(HEIGHT.shape)
    options = {"files": ["map.npy"], "spacing": LENGTH / POINTS, "unit": "m"}
    np.save(tmp_path / "map.npy", HEIGHT[:, :1] + noise)
    assert "expected an isotropic surface" in refused(tmp_path, map=options)
    few = self_affine(0.7, LENGTH / 4, LENGTH / 8, 1e-6)
    for realisation in range(10):
        np.save(tmp_path / "map.npy", areal_surface(few, (POINTS, POINTS), (LENGTH, LENGTH), 1, realisation) + noise)
        assert surface(tmp_path, map=options).map.found()[0].resolution > 0


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("map.npy", HEIGHT[:8], "expected a map of 16 x 16 points or more"),
        ("map.npy", 0 * HEIGHT, "expected a rough map, got a flat one"),
        ("map.npy", np.where(HEIGHT > 0, HEIGHT, np.nan), "at most 5 % of the points are missing"),
        ("map.npy", b"nothing", "expected a numpy array"),
        ("map.opd", b"nothing", "SurfaceTopography cannot read it"),
    ],
)
def test_a_bad_map_is_one_message(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_bytes(content) if isinstance(content, bytes) else np.save(path, content)
    assert message in refused(tmp_path, map={"files": [name], "spacing": 1e-6, "unit": "m"})


def test_a_spectrum_goes_on_by_its_power_law_where_that_is_asked_for(tmp_path):
    """Rows of a self-affine surface to twice its shortest wave: beyond them it has the gradient of the whole one."""
    whole = self_affine(0.7, LENGTH / 4, LENGTH / 256, 1e-6)
    shorter = whole.between(LENGTH / 4, LENGTH / 64)
    q, density = shorter.wavenumber, shorter.density
    rows = "\n".join(f"{one:.12g},{other:.12g}" for one, other in zip(q, density, strict=True))
    (tmp_path / "road.csv").write_text(f"q [rad/m],C2D [m^4]\n{rows}\n")
    ends = {"longest_wavelength": LENGTH / 4, "shortest_wavelength": LENGTH / 256}
    given = {"spectrum": {"files": ["road.csv"]}, **ends}
    (found,) = spectra_of(surface(tmp_path, **given, extrapolate=True))
    assert found.rms_gradient() == pytest.approx(whole.rms_gradient(), rel=1e-3)
    assert shorter.rms_gradient() < 0.8 * found.rms_gradient()
    assert "expected shortest_wavelength of at least 31.25 um, where the spectrum ends" in refused(tmp_path, **given)
