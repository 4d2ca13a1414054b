"""The command surface: maps, scans and tables of a measured surface to statistics, a figure and a spectrum."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.cli.options import csv_option, json_option
from mdr_dask.cli.printing import print_rows, with_intervals
from mdr_dask.cli.writing import FIGURES, require_suffix, writing
from mdr_dask.version import __version__

if TYPE_CHECKING:
    from mdr_dask.models.parts.surface import Surface

KINDS = ("map", "scan", "spectrum")


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(exists=True, dir_okay=False))
@click.option("--as", "kind", type=click.Choice(KINDS), help="What the files are; else told by their content.")
@click.option("--spacing", help="Distance of points of a map in text or npy, such as 2um.")
@click.option("--spacing-y", help="Distance of its lines, where it is another.")
@click.option("--unit", help="Unit of the heights, where a file does not say.")
@click.option("--detrend", help="none, mean, plane (of a map), line (of a scan) or parabola.")
@click.option("--window", type=click.Choice(("hann", "none")), help="none only of a periodic surface.  [hann]")
@click.option("--outliers", type=click.Choice(("keep", "fill")), help="Points that stick out of a map.  [keep]")
@click.option("--direction", type=click.Choice(("x", "y")), help="Direction of sliding over an anisotropic map.")
@click.option("--longest-wavelength", help="Leave out longer waves.")
@click.option("--shortest-wavelength", help="Leave out shorter waves; else those that are noise.")
@click.option("--spectrum", "-o", type=click.Path(path_type=Path), help="Write C2D into FILE.csv, for a campaign.")
@click.option(
    "--plot",
    "figure",
    type=click.Path(path_type=Path),
    help="Draw the spectra into FILE.png, .pdf or .svg, their table beside it.",
)
@json_option
@csv_option
def surface(
    files: tuple[str, ...],
    kind: str | None,
    spectrum: Path | None,
    figure: Path | None,
    form: str | None,
    **options: Any,
) -> None:
    """Tell rms height, slopes, spectrum, Hurst exponent and resolution of a measured surface.

    FILES are maps, scans, or tables of a spectrum, of one surface. Intervals are 95 %. Rolloff and cutoff are the
    wavelengths at which the power law ends, empty if it does not within the data.

    \b
    mdr-dask surface road.npy --spacing 2um --unit um --plot road.png -o c2d.csv
    mdr-dask surface scan1.csv scan2.csv scan3.csv
    """
    require_suffix(spectrum, (".csv", ".txt"))
    require_suffix(figure, FIGURES)
    if figure is not None and spectrum is not None and figure.with_suffix(".csv") == spectrum:
        raise click.UsageError(f"{spectrum} is the table of the figure {figure}: give the spectrum another name")
    from mdr_dask.models.parts.surface import spectra_of
    from mdr_dask.models.parts.surface_report import UNITS, reports

    read = _read(files, kind, options)
    told = reports(read)
    if spectrum is not None:
        with writing(spectrum):
            _write(read, spectrum)
    if figure is not None:
        from mdr_dask.cli.figures import save
        from mdr_dask.plots.surface import draw_surface

        sources = ", ".join(Path(file.name).name for file in read.measured.files)
        origin = {"mdr_dask": f"{__version__}, surface", "files": sources, "method": _method(read)}
        save(draw_surface(told, spectra_of(read)), figure, origin)
    rows, units = [report.row for report in told], dict(UNITS)
    if form is None:
        known = [name for name in units if any(row[name] == row[name] for row in rows)]
        rows, units = with_intervals(
            [{name: row[name] for name in known} for row in rows], {n: units[n] for n in known}
        )
    print_rows(rows, units, form or "table")
    for note in read.notes():
        click.echo(note, err=True)
    click.echo(_method(read), err=True)


def _read(files: tuple[str, ...], kind: str | None, options: dict[str, Any]) -> Surface:
    """Return the surface that files and options name."""
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
            context={"to_si": to_si, "directory": "."},
        )
    except ValidationError as error:
        problems = [problem["msg"].removeprefix("Value error, ") for problem in error.errors()]
        raise DataError("\n".join(dict.fromkeys(problems))) from None


def _kind(file: str, options: dict[str, Any]) -> str:
    """Return what a file is: a map by its spacing or format, else a table by its columns."""
    from mdr_dask.errors import DataError
    from mdr_dask.models.parts.topography import TEXT
    from mdr_dask.tables import read_sheet

    if "spacing" in options or "direction" in options or not file.lower().endswith(TEXT):
        return "map"
    try:
        sheet = read_sheet(Path(file).read_text(errors="replace"), file)
    except DataError:
        return "map"
    names = {cell.text.strip().lower() for cell in sheet.names}
    if names & {"c2d", "c1d", "c cut", "c_cut", "c_iso"}:
        return "spectrum"
    return "scan" if len(sheet.rows[0]) == 2 else "map"


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
    """Say how the spectrum was made."""
    if read.map is not None:
        window = "Hann's window of the distance from the middle" if read.map.window == "hann" else "no window"
        return f"{read.map.detrend} subtracted, {window}, C2D in rings of the wave vector"
    if read.scan is not None:
        window = "Hann's window" if read.scan.window == "hann" else "no window"
        return f"{read.scan.detrend} subtracted, {window}, C2D from the cut by the inverse of Abel's transform"
    return "C2D of the table"
