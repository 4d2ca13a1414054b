"""The command `surface`: height parameters, spectrum and figure of measured maps, scans and tables."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.cli.options import csv_option, figure_options, json_option
from mdr_dask.cli.printing import print_rows, with_intervals
from mdr_dask.cli.writing import require_suffix, writing
from mdr_dask.version import __version__

if TYPE_CHECKING:
    from mdr_dask.models.parts.surface import Surface

KINDS = ("map", "scan", "spectrum")


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(exists=True, dir_okay=False))
@click.option("--as", "kind", type=click.Choice(KINDS), help="Kind of the files.  [found from their content]")
@click.option("--spacing", help="Distance between points, such as 2um, if the file contains only heights.")
@click.option("--spacing-y", help="Distance between rows, if different from --spacing.")
@click.option("--unit", help="Unit of the heights, if the file has none.")
@click.option("--x-unit", help="Unit of positions in the file, if the file has none.")
@click.option("--detrend", help="Shape to subtract: none, mean, plane (of a map), line (of a scan) or parabola.")
@click.option(
    "--window",
    type=click.Choice(("hann", "none")),
    help="Window function of the heights; use none only for a periodic surface.  [hann]",
)
@click.option(
    "--outliers",
    type=click.Choice(("keep", "fill")),
    help="Keep or replace heights far from the heights of the neighbouring points.  [keep]",
)
@click.option("--direction", type=click.Choice(("x", "y")), help="Sliding direction on an anisotropic surface.")
@click.option("--longest-wavelength", help="Leave out longer wavelengths.")
@click.option("--shortest-wavelength", help="Leave out shorter wavelengths.  [those that contain only noise]")
@click.option("--spectrum", "-o", type=click.Path(path_type=Path), help="Write C2D to FILE.csv, for a campaign.")
@figure_options("--plot")
@json_option
@csv_option
def surface(
    files: tuple[str, ...],
    kind: str | None,
    spectrum: Path | None,
    figure: Path | None,
    look: dict[str, Any],
    form: str | None,
    **options: Any,
) -> None:
    """Print height parameters, slopes, Hurst exponent and resolution of a measured surface.

    FILES are maps, scans, or tables of a spectrum, all of the same surface. Sq and Sa (maps) and Pq (scans) are
    computed from the levelled heights. Gradient, slopes and Hurst exponent are computed from the windowed spectrum. All
    intervals are 95 % confidence intervals. Rolloff is the longest and cutoff is the shortest wavelength of the fitted
    power law. Rolloff or cutoff is empty if the power law continues to the end of the data.

    \b
    mdr-dask surface road.npy --spacing 2um --unit um --plot road.png -o c2d.csv
    mdr-dask surface scan1.csv scan2.csv scan3.csv
    """
    require_suffix(spectrum, (".csv", ".txt"))
    if figure is not None and spectrum is not None and figure.with_suffix(".csv") == spectrum:
        raise click.UsageError(f"{spectrum} is the table of the figure {figure}: give the spectrum another name")
    from mdr_dask.errors import DataError
    from mdr_dask.models.parts.surface import spectra_of
    from mdr_dask.models.parts.surface_report import UNITS, reports

    read = _read(files, kind, options)
    found = reports(read)
    anisotropic = read.without_spectrum()
    if anisotropic and spectrum is not None:
        raise DataError(_as_options("\n".join(anisotropic)))
    if spectrum is not None:
        with writing(spectrum):
            _write(read, spectrum)
    if figure is not None:
        from mdr_dask.cli.figures import save
        from mdr_dask.plots.surface import draw_surface

        sources = ", ".join(Path(file.name).name for file in read.measured.files)
        origin = {"mdr_dask": f"{__version__}, surface", "files": sources, "method": _method(read)}
        save(lambda: draw_surface(found, spectra_of(read)), figure, origin, look)
    rows, units = [report.row for report in found], dict(UNITS)
    if form is None:
        known = [name for name in units if any(row[name] == row[name] for row in rows)]
        rows, units = with_intervals(
            [{name: row[name] for name in known} for row in rows], {n: units[n] for n in known}
        )
    print_rows(rows, units, form or "table")
    for note in read.notes():
        click.echo(_as_options(note), err=True)
    click.echo(_method(read), err=True)


def _read(files: tuple[str, ...], kind: str | None, options: dict[str, Any]) -> Surface:
    from pydantic import ValidationError

    from mdr_dask.errors import DataError
    from mdr_dask.models.parts.surface import Surface
    from mdr_dask.units import to_si

    given = {name: value for name, value in options.items() if value is not None}
    ends = {name: given.pop(name) for name in ("longest_wavelength", "shortest_wavelength") if name in given}
    kind = kind or _kind(files[0], given)
    try:
        return Surface.model_validate(
            {kind: {"files": list(files), **given}, **ends},
            context={"to_si": to_si, "directory": ".", "describe": True},
        )
    except ValidationError as error:
        problems = [problem["msg"].removeprefix("Value error, ") for problem in error.errors()]
        raise DataError(_as_options("\n".join(dict.fromkeys(problems)))) from None


def _as_options(message: str) -> str:
    """Replace the names of parameters in a message by the options of this command."""
    message = re.sub(r"`(map|scan|spectrum)` instead of `\w+`", r"--as \1", message)
    names = "|".join(option.name or "" for option in surface.params)
    return re.sub(rf"`({names})(?:: (\w+))?`", lambda m: " ".join(filter(None, (_option(m[1]), m[2]))), message)


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _kind(file: str, options: dict[str, Any]) -> str:
    """Return the kind of a file: a spectrum (by its columns), a map (by its shape or the options), or a scan."""
    from mdr_dask.models.data_file import DataFile
    from mdr_dask.models.parts.height_file import TEXT, dimensions
    from mdr_dask.models.parts.surface_files import is_spectrum
    from mdr_dask.tables import decoded

    if "spacing_y" in options or "direction" in options:
        return "map"
    if file.lower().endswith(TEXT) and is_spectrum(decoded(Path(file).read_bytes(), file)):
        return "spectrum"
    return "map" if dimensions(DataFile.of(Path(file))) == 2 else "scan"


def _write(read: Surface, path: Path) -> None:
    """Write the mean spectrum as a table that `surface: {spectrum: ...}` reads."""
    from mdr_dask.models.parts.surface import spectra_of
    from mdr_dask.models.parts.surface_report import mean_spectrum

    files = ", ".join(Path(file.name).name for file in read.measured.files)
    lines = [f"# {files}: {_method(read)}", "wavenumber [rad/m],C2D [m^4],relative error"]
    rows = zip(*mean_spectrum(spectra_of(read)), strict=True)
    lines += [f"{q:.12g},{density:.12g},{error:.4g}".replace("nan", "") for q, density, error in rows]
    path.write_text("\n".join(lines) + "\n")


def _method(read: Surface) -> str:
    if read.map is not None:
        window = "Hann's window of the distance from the centre" if read.map.window == "hann" else "no window"
        return f"{read.map.detrend} subtracted, {window}, C2D averaged over rings of constant wavenumber"
    if read.scan is not None:
        window = "Hann's window" if read.scan.window == "hann" else "no window"
        return f"{read.scan.detrend} subtracted, {window}, C2D from the scan by the inverse Abel transform"
    return "C2D of the table"
