"""The figure of a measured surface: its spectrum with the power law, the line of the method beside straight cuts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mdr_dask.plots import drawing, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mdr_dask.models.parts.surface_report import FileReport
    from mdr_dask.physics.surfaces.spectrum import Spectrum


def draw_surface(reports: tuple[FileReport, ...], spectra: tuple[Spectrum, ...]) -> Figure:
    """Draw C2D of every file with its law, and C1D of the line that a campaign takes with the cuts.

    Parameters
    ----------
    reports : tuple of FileReport
        What each file says.
    spectra : tuple of Spectrum
        What a campaign takes of each: between the cut-offs, without noise.
    """
    figure, (areal, line) = drawing.panels(2, columns=2, size=(5.2, 4.2))
    colours = style.scale(len(reports))
    for report, taken, colour in zip(reports, spectra, colours, strict=True):
        name = Path(report.file.name).name
        _areal(areal, report, taken, colour, name if len(reports) > 1 else "")
        for (direction, (q, cut)), dash in zip(report.cuts.items(), ("-", ":"), strict=False):
            there = cut > 1e-20 * cut.max()
            label = f"straight cut along {direction}" if report is reports[0] else None
            line.loglog(q[there], cut[there], dash, color="0.6", lw=0.8, label=label)
    for taken, colour in zip(spectra, colours, strict=True):
        q = np.geomspace(taken.wavenumber[0], taken.wavenumber[-1], 400)
        label = r"line of the method, $\pi q\,C^{2D}$" if taken is spectra[0] else None
        line.loglog(q, np.pi * q * taken.at(q), color=colour, lw=1.5, label=label)
    areal.set(xlabel="wave number (rad/m)", ylabel=r"$C^{2D}$ (m$^4$)")
    line.set(xlabel="wave number (rad/m)", ylabel=r"spectrum of a line (m$^3$)")
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


def _areal(axes: Axes, report: FileReport, taken: Spectrum, colour: str, name: str) -> None:
    spectrum, bins = report.found.spectrum, report.bins
    axes.loglog(spectrum.wavenumber, spectrum.density, color=colour, lw=0.5, alpha=0.4)
    there = bins.density > 0
    axes.errorbar(
        bins.wavenumber[there], bins.density[there], (bins.density * bins.error)[there], fmt="o", ms=3, color=colour
    )
    low, high = taken.wavenumber[[0, -1]]
    axes.axvspan(low, high, color=colour, alpha=0.06, label=f"{name} taken".strip())
    if report.law is not None:
        ends = [2 * np.pi / end.value if end else None for end in (report.law.longest, report.law.shortest)]
        q = np.array([ends[0] or bins.wavenumber[0], ends[1] or high])
        middle = (bins.wavenumber >= q[0] * 0.999) & (bins.wavenumber <= q[1] * 1.001) & there
        level = np.median(
            np.log(bins.density[middle]) + (2 + 2 * report.law.hurst.value) * np.log(bins.wavenumber[middle])
        )
        law = np.exp(level) * q ** (-2 - 2 * report.law.hurst.value)
        hurst = report.law.hurst
        axes.loglog(q, law, "k--", lw=1, label=f"H = {hurst.value:.2f} ({hurst.low:.2f}, {hurst.high:.2f})")


def _other(number: Any) -> Any:
    """Return wavelengths of wave numbers, and the other way round."""
    with np.errstate(divide="ignore"):
        return 2 * np.pi / np.asarray(number, dtype=np.float64)
