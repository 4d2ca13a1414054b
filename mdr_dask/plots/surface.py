"""The figure of a measured surface: the spectrum of the surface, and spectra of lines."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mdr_dask.arrays import SAME
from mdr_dask.physics.refine import EPS
from mdr_dask.plots import colours
from mdr_dask.plots.figure import SMOOTH, Axis, Figure, Key, Mean, Panel, Trace, columns
from mdr_dask.plots.measured import HALF

if TYPE_CHECKING:
    from mdr_dask.models.parts.surface_report import FileReport
    from mdr_dask.physics.surfaces.spectrum import Spectrum

#: `CUTS`: colour and line style of the straight cuts in each direction. `METHOD`: label of the line that represents the
#: surface in the method of dimensionality reduction.
CUTS = ("#a0a0a0", "-"), ("#505050", ":")
METHOD = r"line of the method, $\pi q\,C^{2D}$"


def draw_surface(reports: tuple[FileReport, ...], spectra: tuple[Spectrum, ...]) -> Figure:
    """Draw the power spectrum C2D of every file, its power law if one fits, and the spectra of lines.

    There are two kinds of lines: straight cuts through the surface, and the lines that represent the surface in a
    campaign. `spectra` are the spectra that a campaign uses. These spectra contain only wave numbers between the
    cut-offs; if no shortest wavelength is given, they end where the noise begins.
    """
    q = Axis("wave number $q$ [rad/m]", log=True)
    densities = np.concatenate([report.bins.density[report.bins.density > 0] for report in reports])
    areal = Panel(q, Axis("$C^{2D}$ [m$^4$]", log=True, low=densities.min() / 10, high=densities.max() * 10))
    line = Panel(q, Axis("spectrum of a line [m$^3$]", log=True))
    for k, (report, used) in enumerate(zip(reports, spectra, strict=True)):
        file, colour = xr.Dataset(coords={"file": Path(report.file.name).name}), colours.colour(k)
        areal.traces += _areal(report, used, colour, file)
        for (direction, (wave, cut)), (grey, dash) in zip(report.cuts.items(), CUTS, strict=False):
            there, name = cut > EPS * cut.max(), f"straight cut along {direction}"
            line.traces.append(Trace("law", columns(file, x=wave[there], y=cut[there]), name, name, grey, dash))
        wave = np.geomspace(used.wavenumber[0], used.wavenumber[-1], SMOOTH)
        method = columns(file, x=wave, y=np.pi * wave * used.at(wave))
        line.traces.append(Trace("law", method, METHOD, METHOD, colour, "-"))
        name = f"{file['file'].item()}: measured (points) and used by a campaign (line)"
        areal.keys.append(Key(name, colour, "-", "o"))
    for report in reports:
        if report.law is not None:
            hurst = report.law.hurst
            law = f"power law, H = {hurst.value:.2f} ({hurst.low:.2f}, {hurst.high:.2f})"
            areal.keys.append(Key(law, "#000000", "--"))
    line.keys = [key for key in line.entries() if key.label != METHOD or key.colour == colours.colour(0)]
    if len(reports) > 1:
        line.keys = [Key(METHOD, "#000000", "-") if key.label == METHOD else key for key in line.keys]
    rms, gradient = (
        np.sqrt(np.mean([value**2 for value in values]))
        for values in zip(*((used.rms_height(), used.rms_gradient()) for used in spectra), strict=True)
    )
    fixed = f"used by a campaign: rms height {rms:.4g} m, rms gradient {gradient:.4g}"
    unfitted = [f"{Path(each.file.name).name}: no power law fits the spectrum" for each in reports if each.law is None]
    return Figure([areal, line], "spectrum of a measured surface", fixed, warnings=unfitted, ratio=0.85)


def _areal(report: FileReport, used: Spectrum, colour: str, file: xr.Dataset) -> list[Trace]:
    """Return the traces of C2D of a file: all values, means in bins, the part used by a campaign, and any power law."""
    spectrum, bins = report.found.spectrum, report.bins
    raw = columns(file, x=spectrum.wavenumber, y=spectrum.density)
    there = bins.density > 0
    q, density = bins.wavenumber[there], bins.density[there]
    factor = np.exp(HALF * bins.error[there])
    ends = columns(file, x=q, y=Mean(density, density / factor, density * factor))
    inside = columns(file, x=used.wavenumber, y=used.density)
    found = [
        Trace("law", raw, "spectrum as measured", "", "#c0c0c0", "-"),
        Trace("curve", ends, "spectrum in bins", "", colour, "", "o"),
        Trace("law", inside, "used by a campaign", "", colour, "-"),
    ]
    if report.law is None:
        return found
    along = np.array(
        [
            2 * np.pi / end.value if end else default
            for end, default in ((report.law.longest, bins.wavenumber[0]), (report.law.shortest, used.wavenumber[-1]))
        ]
    )
    middle = (q >= along[0] * (1 - SAME)) & (q <= along[1] * (1 + SAME))
    power = -2 - 2 * report.law.hurst.value
    level = np.exp(np.median(np.log(density[middle]) - power * np.log(q[middle])))
    law = columns(file, x=along, y=level * along**power)
    return [*found, Trace("law", law, "power law", "", "#000000", "--")]
