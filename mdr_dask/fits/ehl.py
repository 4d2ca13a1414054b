"""Fit film formulas: the film thickness is a product of powers of W (load), U (speed) and G (material)."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import WITHIN, Fit, law_holds, undetermined
from mdr_dask.fits.cases import Series, Variables, each, holds, measure, rms
from mdr_dask.models.ehl_line import groups as groups_of
from mdr_dask.physics.lubrication.film_formulas import PAN_HAMROCK_CENTRAL, PAN_HAMROCK_MINIMUM

_FILMS = {
    "central_film": ("central", PAN_HAMROCK_CENTRAL),
    "minimum_film": ("minimum", PAN_HAMROCK_MINIMUM),
}
_GROUPS = {"load": "W", "speed": "U", "material": "G"}


def _logarithms(dataset: xr.Dataset, output: str) -> FloatArray:
    """Return ln W, ln U, ln G and ln(h/R) of all cases with a computed film thickness h, shape (4, cases)."""
    film = dataset[output].isel(realisation=0)
    table = np.stack([np.ravel(array) for array in xr.broadcast(*groups_of(dataset.coords.get), film)]).astype(
        np.float64
    )
    return np.asarray(np.log(table[:, np.isfinite(table).all(axis=0) & (table > 0).all(axis=0)]))


def _regression(table: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit ln(h/R) linearly to ln W, ln U and ln G; return constants, half widths of 95 % intervals, and residuals.

    Constants that the data do not determine are NaN. Raise FitError if there are too few film thicknesses.
    """
    from scipy.stats import t

    design = np.vstack([np.ones(table.shape[1]), table[:3]]).T
    varied = np.concatenate([[True], np.ptp(table[:3], axis=1) > 0])
    freedom = design.shape[0] - int(varied.sum())
    if freedom < 1 or not varied[1:].any():
        raise FitError(
            "expected more film thicknesses than fitted constants, at different W, U or G, got "
            f"{design.shape[0]} film thicknesses"
        )
    constants, width = np.full(4, np.nan), np.full(4, np.nan)
    solution, *_ = np.linalg.lstsq(design[:, varied], table[3], rcond=None)
    residuals = table[3] - design[:, varied] @ solution
    inverse = np.linalg.pinv(design[:, varied])
    width[varied] = t.ppf(0.975, freedom) * np.sqrt(np.sum(inverse**2, axis=1) * np.sum(residuals**2) / freedom)
    if np.sqrt(np.mean(residuals**2)) > WITHIN:  # unlike scatter, a systematic misfit does not average out
        width[varied] += np.abs(inverse) @ np.abs(residuals)
    constants[varied] = np.where(undetermined(design[:, varied]), np.nan, solution)
    return constants, width, residuals


def _films(data: xr.Dataset) -> Variables:
    """Fit ``h/R = factor W^load U^speed G^material`` to the central and to the minimum film thickness.

    A film thickness that the study does not contain is left out. A constant is NaN if the data do not determine it, for
    example the exponent of a number (W, U or G) that does not vary or is a product of powers of the other two. The
    intervals follow from the misfit, because computed film thicknesses have no scatter. ``law_holds`` is about the
    formula of Pan and Hamrock.
    """
    found: Variables = {}
    departures, of_stated = [], []
    for output, (film, formula) in _FILMS.items():
        if output not in data:
            continue
        table = _logarithms(data, output)
        constants, width, residuals = _regression(table)
        ends = {"": constants, "_low": constants - width, "_high": constants + width}
        for k, name in enumerate(("factor", "load", "speed", "material")):
            for end, value in ends.items():
                about = f"exponent of {_GROUPS[name]} in h/R" if k else "factor of the power law for h/R"
                found |= measure(f"{film}_{name}{end}", float(value[k] if k else np.exp(value[k])), about)
        found |= measure(f"{film}_rms", rms(residuals), "rms relative deviation from the fitted formula")
        found |= measure(f"{film}_worst", float(np.abs(residuals).max()), "largest relative deviation from the fit")
        departures.append(residuals)
        of_stated.append(table[3] - np.log(formula(*np.exp(table[:3]))))
    sentences = (law_holds(np.concatenate(each), None, logarithmic=True) for each in (of_stated, departures))
    return found | holds(*sentences)


def _film_exponents(series: Series) -> xr.Dataset:
    (data,) = series.values()
    present = [output for output in _FILMS if output in data]
    return each(series, _axes_of_groups, _films, *(present or _FILMS))


def _axes_of_groups(data: xr.Dataset) -> list[str]:
    return [str(dim) for group in groups_of(data.coords.get) for dim in getattr(group, "dims", ())]


FITS: tuple[Fit, ...] = (
    Fit(
        "film_exponents",
        ("ehl_line",),
        "h/R = factor W^load U^speed G^material for film thicknesses; compared with Pan and Hamrock (eq. 5.3)",
        _film_exponents,
    ),
)
