"""Spectra in place of generated lines: the same friction, and one message for each mistake."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from test_extremes import ROLLERS

from mdr_dask.campaign import load
from mdr_dask.errors import CampaignError, DataError
from mdr_dask.models import load as model_named
from mdr_dask.models.base import Block, Status
from mdr_dask.models.parts.surface import Surface, lines_of, spectra_of
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction
from mdr_dask.physics.surfaces.spectrum import self_affine

LENGTH, POINTS = 0.02, 400
LONGEST, SHORTEST = LENGTH / 4, 2 * LENGTH / POINTS
BODY = {"shear_modulus": 1e7, "relaxation_time": 1e-3, "normal_force": 0.2, "velocity": 0.1, "points": POINTS}
HURST = (0.0, 0.5, 0.8)


def table(path, hurst=0.7, rms=1e-6, kind="C2D", points=2, name="wavenumber", shuffled=False):
    """Write the spectrum of a self-affine surface, of rms height `rms` on the line; return the name of the file."""
    spectrum = self_affine(hurst, LONGEST, SHORTEST)
    line = spectrum.line(LENGTH, POINTS // 2)
    q = np.geomspace(*spectrum.wavenumber, points)
    density = spectrum.at(q) * rms**2 / (np.sum(line**2) / 2)
    values = {"C2D": density, "C1D": np.pi * q * density}[kind]
    order = np.random.default_rng(1).permutation(points) if shuffled else np.arange(points)
    place, unit = (q, "rad/m") if name == "wavenumber" else (2e6 * np.pi / q, "um")
    head = f"{name} [{unit}],{kind} [{'m^4' if kind == 'C2D' else 'm^3'}]\n"
    path.write_text(head + "".join(f"{place[k]:.17g},{values[k]:.17g}\n" for k in order))
    return str(path)


def solved(model, kind, seed=7, realisations=(0, 1), **parameters):
    outputs = model.with_companions([output.name for output in model.outputs if output.has_error] + ["rms_slope"])
    return model.compute(Block(kind(**BODY | parameters), {}, 1, realisations, seed, outputs))


@pytest.mark.parametrize("hurst", HURST)
def test_a_table_of_the_power_law_is_the_generated_line(tmp_path, hurst):
    """Rms height and slope to 1e-12, with one seed friction to 1e-9; for any column that says the same."""
    generated = {"length": LENGTH, "rms_roughness": 1e-6, "hurst": hurst, "longest_wavelength": LONGEST}
    wanted = solved(MODEL, SlidingFriction, **generated).values
    variants = [{}, {"kind": "C1D", "points": 40}, {"name": "wavelength", "points": 7, "shuffled": True}]
    for variant in variants:
        surface = Surface.model_validate({"spectrum": table(tmp_path / "road.csv", hurst, **variant)})
        (line,) = lines_of(surface, LENGTH, POINTS // 2)
        assert np.sqrt(np.sum(line**2) / 2) == pytest.approx(1e-6, rel=1e-12)
        found = solved(MODEL, SlidingFriction, length=LENGTH, surface=surface)
        assert np.all(found.status == Status.DONE), found.messages
        np.testing.assert_allclose(found.values["rms_slope"], wanted["rms_slope"], rtol=1e-12)
        for name in ("friction_coefficient", "indentation_depth", "contact_fraction"):
            np.testing.assert_allclose(found.values[name], wanted[name], rtol=1e-9)


def test_each_realisation_takes_one_of_several_files(tmp_path):
    """Their scatter is part of that between realisations; the rms height is that over all files."""
    files = [table(tmp_path / f"{k}.csv", rms=rms) for k, rms in enumerate((1e-6, 2e-6))]
    surface = Surface.model_validate({"spectrum": {"files": files}})
    found = solved(MODEL, SlidingFriction, realisations=(0, 1, 2), length=LENGTH, surface=surface).values["rms_slope"]
    np.testing.assert_allclose(found[0] / found[0, 0], [1, 2, 1], rtol=1e-12)
    alone = [
        solved(MODEL, SlidingFriction, realisations=(k,), length=LENGTH, surface={"spectrum": file}).values
        for k, file in enumerate(files)
    ]
    both = solved(MODEL, SlidingFriction, length=LENGTH, surface=surface).values["friction_coefficient"]
    for k in range(2):
        np.testing.assert_allclose(both[0, k], alone[k]["friction_coefficient"][0, 0], rtol=1e-3)


CAMPAIGN = """\
name: road
model: sliding_friction
parameters:
  length: 20 mm
  points: 400
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  normal_force: 1 N
  velocity: 1 m/s
  surface: {spectrum: road.csv}
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("  points: 400\n", "  hurst: 0.8\n  rms_roughness: 1 um\n", "`surface` replaces `hurst` and `rms_roughness`"),
        ("  length: 20 mm\n", "", "expected `length`, the length of the rough line that represents the surface"),
        ("  surface: {spectrum: road.csv}\n", "", "expected length with rms_roughness, or length with surface"),
        ("surface: {spectrum: road.csv}", "profile: road.csv", "write surface: {profile: ...}"),
        ("spectrum: road.csv", "longest_wavelength: 1 mm", "expected spectrum, or "),
        (
            "road.csv}",
            "road.csv, shortest_wavelength: 1 um}",
            "`extrapolate: true` continues the spectrum by a power law",
        ),
        ("spectrum: road.csv", "spectrum: low.csv", "low.csv:3: column C2D: expected a value above 0, got '-1 m^4'"),
    ],
)
def test_a_mistake_is_one_message_with_its_place(tmp_path, old, new, message):
    table(tmp_path / "road.csv")
    (tmp_path / "low.csv").write_text("q [rad/m],C2D [m^4]\n1,2\n2,-1\n")
    assert old in CAMPAIGN
    (tmp_path / "road.yaml").write_text(CAMPAIGN.replace(old, new))
    with pytest.raises(CampaignError) as caught:
        load(tmp_path / "road.yaml")
    (problem,) = str(caught.value).splitlines()
    assert message in problem


def test_a_band_ends_at_any_waves_of_the_spectrum_up_to_its_ends(tmp_path):
    name = table(tmp_path / "road.csv")
    for least in (SHORTEST, 1.3 * SHORTEST, 0.7 * LONGEST):
        (spectrum,) = spectra_of(Surface.model_validate({"spectrum": name, "shortest_wavelength": least}))
        assert spectrum.wavelengths == pytest.approx((LONGEST, least))
    for most in (LONGEST, 0.7 * LONGEST, 1.3 * SHORTEST):
        (spectrum,) = spectra_of(Surface.model_validate({"spectrum": name, "longest_wavelength": most}))
        assert spectrum.wavelengths == pytest.approx((most, SHORTEST))
    for wrong in ({"shortest_wavelength": 0.99 * SHORTEST}, {"longest_wavelength": 1.01 * LONGEST}):
        with pytest.raises((DataError, ValueError), match="extrapolate"):
            spectra_of(Surface.model_validate({"spectrum": name} | wrong))


def test_a_line_too_short_for_the_spectrum_is_a_status(tmp_path):
    surface = {"spectrum": table(tmp_path / "road.csv")}
    found = solved(MODEL, SlidingFriction, length=LENGTH / 1000, surface=surface)
    assert np.all(found.status == Status.FAILED)
    assert "expected wavelengths of the line in the range 100 um to 5 mm" in found.messages[0, 0]


def test_two_rollers_have_spectra_of_their_own(tmp_path):
    """Spectra equal to the generated lines give their film ratio and contact; a rougher one lowers the film ratio."""
    model = model_named("mixed_lubrication")
    roller = ROLLERS | {"points": 40_000, "roller_width": 0.01, "film_thickness": 4e-7}
    del roller["rms_roughness"]
    names = ("film_ratio", "contact_length", "asperity_load_share")

    def values(**more):
        parameters = model.parameters(**roller | more)
        return model.compute(Block(parameters, {}, 1, (0, 1), 3, names)), parameters

    wanted, case = values(rms_roughness=2e-7)
    source, perimeter = case.source(), case.perimeter
    spectrum = self_affine(0.7, case.longest(), 10 * perimeter / 40_000)
    line = spectrum.line(perimeter, source.modes)
    files = []
    for k, rms in enumerate((2e-7, 6e-7)):
        path = Path(tmp_path / f"{k}.csv")
        density = spectrum.density * rms**2 / (np.sum(line**2) / 2)
        rows = "".join(f"{q:.17g},{c:.17g}\n" for q, c in zip(spectrum.wavenumber, density, strict=True))
        path.write_text("q [rad/m],C2D [m^4]\n" + rows)
        files.append({"spectrum": str(path)})
    same, _ = values(surface_1=files[0], surface_2=files[0])
    for name in names:
        np.testing.assert_allclose(same.values[name], wanted.values[name], rtol=1e-9)
    rougher, _ = values(surface_1=files[0], surface_2=files[1])
    np.testing.assert_allclose(rougher.values["film_ratio"], wanted.values["film_ratio"] / np.sqrt(5), rtol=1e-9)
    with pytest.raises(ValidationError, match="surface_1 and surface_2 replace rms_roughness"):
        values(surface_1=files[0], surface_2=files[0], rms_roughness=2e-7)
