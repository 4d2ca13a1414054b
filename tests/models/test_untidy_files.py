"""Files of surfaces and moduli with gaps, additional columns and missing units."""

import numpy as np
import pytest

from mdr_dask.cli import main
from mdr_dask.errors import DataError
from mdr_dask.models.data_file import DataFile
from mdr_dask.models.parts.height_file import Units, read_scan
from mdr_dask.models.parts.moduli_table import ModulusTable
from mdr_dask.units import to_si

NUMBER = 400
HEIGHT = np.random.default_rng(4).standard_normal(NUMBER).cumsum() / 10


def file_of(tmp_path, text, name="scan.txt"):
    (tmp_path / name).write_bytes(text.encode("cp1252"))
    return DataFile.of(tmp_path / name)


def scan(heading="Weg/mm;Höhe [µm];Intensität", missing="", end=""):
    rows = [f"{0.05 * k:.3f};{z:.4f};{200 + k % 7}" for k, z in enumerate(HEIGHT)]
    rows[5] = f"0.250;{missing};"
    return "\n".join(["Profil Nr. 1", heading, *rows, end]).replace(".", ",")


@pytest.mark.parametrize(
    ("heading", "missing"),
    [("Weg/mm;Höhe [µm];Intensität", ""), ("X (mm);Z (um);I", "NaN"), ("Distance [mm];Height [µm];n", "BAD")],
)
def test_scans_with_gaps_and_other_columns_are_read(heading, missing, tmp_path):
    found = read_scan(file_of(tmp_path, scan(heading, missing, "Ende der Messung")), Units())
    expected = np.append(HEIGHT[:5], [(HEIGHT[4] + HEIGHT[6]) / 2, *HEIGHT[6:]])
    np.testing.assert_allclose(found.height, 1e-6 * expected, atol=1e-10)
    assert "missing points interpolated: 1" in found.remarks


def test_heights_alone_need_a_spacing(tmp_path):
    text = "Höhe [µm]\n" + "\n".join(f"{z:.4f}".replace(".", ",") for z in HEIGHT)
    found = read_scan(file_of(tmp_path, text), Units(spacing=5e-5))
    np.testing.assert_allclose(found.position, 5e-5 * np.arange(NUMBER))
    np.testing.assert_allclose(found.height, 1e-6 * HEIGHT, atol=1e-10)
    with pytest.raises(DataError, match="give `spacing`"):
        read_scan(file_of(tmp_path, text), Units())
    with pytest.raises(DataError, match="leave out `spacing`"):
        read_scan(file_of(tmp_path, scan()), Units(spacing=5e-5))


@pytest.mark.parametrize(
    ("form", "micrometres", "sentence"),
    [(50.0, 1.0, "a parabola explains"), (0.0, 1.0, ""), (0.0, 1e3, "are the units of heights and positions right?")],
)
def test_forms_of_parts_and_wrong_units_are_questioned(form, micrometres, sentence, tmp_path, capsys):
    place = np.linspace(-1, 1, NUMBER)
    lines = [
        f"{50 * k},{micrometres * (z + form * x**2):.5f}" for k, (z, x) in enumerate(zip(HEIGHT, place, strict=True))
    ]
    (tmp_path / "line.csv").write_text("\n".join(["x [um],z [um]", *lines]))
    assert main(["surface", str(tmp_path / "line.csv")]) == 0
    printed = capsys.readouterr().err
    asked = [line for line in printed.splitlines() if "explains" in line or "right?" in line]
    assert len(asked) == bool(sentence)
    assert sentence in "".join(asked)


@pytest.mark.parametrize("heading", ["E'", "Tensile storage modulus"])
def test_moduli_in_tension_are_never_those_of_shear(heading, tmp_path):
    unit = "" if "[" in heading else " [MPa]"
    (tmp_path / "dma.csv").write_text(f"f [Hz],{heading}{unit},tan delta\n1,9,0.1\n10,12,0.1\n100,15,0.1\n")
    context = {"to_si": to_si, "directory": str(tmp_path)}
    with pytest.raises(ValueError, match=r"give poisson_ratio \(0.5 for rubber\), or name the columns G'"):
        ModulusTable.model_validate({"file": "dma.csv"}, context=context)
    ModulusTable.model_validate({"file": "dma.csv", "poisson_ratio": 0.5}, context=context)
