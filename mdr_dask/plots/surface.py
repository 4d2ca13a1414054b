"""The figure of a measured surface: its spectrum with the power law, the line of the method beside straight cuts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mdr_dask.plots import drawing, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mdr_dask.arrays import FloatArray
    from mdr_dask.models.parts.surface_report import FileReport
    from mdr_dask.physics.surfaces.spectrum import Spectrum
    from mdr_dask.plots.table import Drawn


#: How a legend names the line that replaces a surface.
METHOD = r"line of the method, $\pi q\,C^{2D}$"


def draw_surface(reports: tuple[FileReport, ...], spectra: tuple[Spectrum, ...]) -> Drawn:
    """Draw C2D of every file with its law, and C1D of the line that a campaign takes with the cuts.

    Parameters
    ----------
    reports : tuple of FileReport
        What each file says.
    spectra : tuple of Spectrum
        What a campaign takes of each: between the cut-offs, without noise.
    """
    figure, (areal, line) = drawing.panels(2, columns=2, size=(5.2, 4.2))
    for axes in (areal, line):
        axes.set(xscale="log", yscale="log", xlabel="wave number (rad/m)")
    for report, taken, colour in zip(reports, spectra, style.scale(len(reports)), strict=True):
        first = report is reports[0]
        file = xr.Dataset(coords={"file": Path(report.file.name).name})
        _areal(areal, report, taken, colour, file, "taken" if len(reports) == 1 else f"{file['file'].item()} taken")
        for (direction, (q, cut)), dash in zip(report.cuts.items(), ("-", ":"), strict=False):
            there = cut > 1e-20 * cut.max()
            look: dict[str, Any] = {
                "color": "0.6",
                "lw": 0.8,
                "label": f"straight cut along {direction}" if first else None,
            }
            drawing.law(line, q[there], cut[there], dash, name=f"straight cut along {direction}", of=file, **look)
        q = np.geomspace(taken.wavenumber[0], taken.wavenumber[-1], 400)
        look = {"color": colour, "lw": 1.5, "zorder": 3, "label": METHOD if first else None}
        drawing.law(line, q, np.pi * q * taken.at(q), name=METHOD, of=file, **look)
    areal.set_ylabel(r"$C^{2D}$ (m$^4$)")
    line.set_ylabel("spectrum of a line (m$^3$)")
    for axes in (areal, line):
        axes.legend(fontsize="x-small")
        axes.grid(alpha=0.3)
        top = axes.secondary_xaxis("top", functions=(_other, _other))
        top.set_xlabel("wavelength (m)", fontsize="small")
    rms, gradient = (
        np.sqrt(np.mean([value**2 for value in values]))
        for values in zip(*((taken.rms_height(), taken.rms_gradient()) for taken in spectra), strict=True)
    )
    style.title(figure, "measured surface", f"taken: rms height {rms:.4g} m, rms gradient {gradient:.4g}")
    return figure


def _areal(axes: Axes, report: FileReport, taken: Spectrum, colour: Any, file: xr.Dataset, label: str) -> None:
    """Draw C2D of a file: all of it, in bins with their errors, what of it is taken, and its power law."""
    spectrum, bins = report.found.spectrum, report.bins
    raw = {"color": colour, "lw": 0.5, "alpha": 0.4}
    drawing.law(axes, spectrum.wavenumber, spectrum.density, name="spectrum as measured", of=file, **raw)
    there = bins.density > 0
    q, density, error = (each[there] for each in (bins.wavenumber, bins.density, bins.density * bins.error))
    mean = drawing.Mean(*(_of(file, each) for each in (density, density - error, density + error)))
    drawing.points(axes, q, mean, colour, "o", None)
    low, high = taken.wavenumber[[0, -1]]
    axes.axvspan(low, high, color=colour, alpha=0.06, label=label)
    if report.law is None:
        return
    hurst = report.law.hurst
    ends = [2 * np.pi / end.value if end else None for end in (report.law.longest, report.law.shortest)]
    along = np.array([ends[0] or bins.wavenumber[0], ends[1] or high])
    middle = (q >= along[0] * 0.999) & (q <= along[1] * 1.001)
    power = -2 - 2 * hurst.value
    level = np.exp(np.median(np.log(density[middle]) - power * np.log(q[middle])))
    told = f"H = {hurst.value:.2f} ({hurst.low:.2f}, {hurst.high:.2f})"
    drawing.law(axes, along, level * along**power, "k--", lw=1, label=told, name="power law", of=file)


def _of(file: xr.Dataset, values: FloatArray) -> xr.DataArray:
    return xr.DataArray(values, dims="wavenumber", coords=file.coords)


def _other(number: Any) -> Any:
    """Return wavelengths of wave numbers, and the other way round."""
    with np.errstate(divide="ignore"):
        return 2 * np.pi / np.asarray(number, dtype=np.float64)
