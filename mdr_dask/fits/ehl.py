"""Fit film formulas to computed films: powers of the load parameter W, speed parameter U and material parameter G."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import FITTED_LAW_HOLDS, WITHIN, Fit, law_holds, undetermined
from mdr_dask.models.ehl_line import groups as groups_of
from mdr_dask.physics.lubrication.film_formulas import PAN_HAMROCK_CENTRAL, PAN_HAMROCK_MINIMUM

_FILMS = {
    "central_film": ("central", PAN_HAMROCK_CENTRAL),
    "minimum_film": ("minimum", PAN_HAMROCK_MINIMUM),
}
_GROUPS = {"load": "W", "speed": "U", "material": "G"}


def _logarithms(dataset: xr.Dataset, output: str) -> FloatArray:
    """Return ln W, ln U, ln G and ln (h/R) of the cases with a film, shape (4, cases)."""
    film = dataset[output].isel(realisation=0)
    table = np.stack([np.ravel(array) for array in xr.broadcast(*groups_of(dataset.coords.get), film)]).astype(
        np.float64
    )
    return np.asarray(np.log(table[:, np.isfinite(table).all(axis=0) & (table > 0).all(axis=0)]))


def _maps(groups: Mapping[str, xr.Dataset]) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield the films of each series, separately for each value of other varied parameters (viscosity law, inlet)."""
    for name, dataset in groups.items():
        outputs = [output for output in _FILMS if output in dataset]
        if not outputs:
            continue
        varied = {str(dim) for group in groups_of(dataset.coords.get) for dim in getattr(group, "dims", ())}
        others = [str(dim) for dim in dataset[outputs[0]].dims if dim not in varied | {"realisation"}]
        for index in np.ndindex(*(dataset.sizes[other] for other in others)):
            part = dataset[outputs].isel(dict(zip(others, index, strict=True)))
            values = [
                f"{other}={part[other].item() if other in part.coords else i}"
                for other, i in zip(others, index, strict=True)
            ]
            yield " ".join([name, *values]).strip(), part


def _regression(table: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return constants, half widths of their 95 % intervals, and residuals of ln h against ln W, ln U, ln G."""
    from scipy.stats import t

    design = np.vstack([np.ones(table.shape[1]), table[:3]]).T
    varied = np.concatenate([[True], np.ptp(table[:3], axis=1) > 0])
    freedom = design.shape[0] - int(varied.sum())
    if freedom < 1 or not varied[1:].any():
        raise FitError(
            f"expected films at more points than constants with W, U or G varied, got {design.shape[0]} points"
        )
    constants, width = np.full(4, np.nan), np.full(4, np.nan)
    solution, *_ = np.linalg.lstsq(design[:, varied], table[3], rcond=None)
    residuals = table[3] - design[:, varied] @ solution
    inverse = np.linalg.pinv(design[:, varied])
    width[varied] = t.ppf(0.975, freedom) * np.sqrt(np.sum(inverse**2, axis=1) * np.sum(residuals**2) / freedom)
    if np.sqrt(np.mean(residuals**2)) > WITHIN:  # a misfit is systematic and does not average out like scatter
        width[varied] += np.abs(inverse) @ np.abs(residuals)
    constants[varied] = np.where(undetermined(design[:, varied]), np.nan, solution)
    return constants, width, residuals


def film_exponents(groups: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Fit ``h/R = factor W^load U^speed G^material`` to the films of every series that varies W, U or G.

    If another parameter varies in a series, such as the viscosity law, each of its values gets its own fit.

    Parameters
    ----------
    groups : mapping of str to Dataset
        Groups of a store of ``ehl_line``.

    Returns
    -------
    Dataset, dims (series,)
        ``<film>_factor``, ``<film>_load``, ``<film>_speed``, ``<film>_material`` for the central and the minimum film,
        and the ends of their intervals, ``_low`` and ``_high``. An exponent is NaN if its parameter (W, U or G) does
        not vary, or varies only together with the other two. ``<film>_rms`` and ``<film>_worst`` are the rms and the
        largest residual of ``ln h``.
        Films have no scatter, so the intervals measure the misfit of the formula. ``law_holds`` refers to the formula
        of Pan and Hamrock with its published constants, ``fitted_law_holds`` to the formula with the fitted constants.

    Raises
    ------
    FitError
        If no series has enough points.
    """
    results: dict[str, dict[str, float]] = {}
    stated_sentences, sentences = [], []
    problem = "expected a series with central_film or minimum_film at several W, U or G, got none"
    for name, dataset in _maps(groups):
        constants: dict[str, float] = {}
        departures, of_stated = [], []
        try:
            for output in sorted(_FILMS.keys() & set(dataset.data_vars)):
                film, formula = _FILMS[str(output)]
                table = _logarithms(dataset, str(output))
                found = _regression(table)
                constants |= _named(film, *found)
                departures.append(found[-1])
                of_stated.append(table[3] - np.log(formula(*np.exp(table[:3]))))
        except FitError as error:
            problem = str(error)
            continue
        results[name] = constants
        stated_sentences.append(law_holds(np.concatenate(of_stated), None))
        sentences.append(law_holds(np.concatenate(departures), None))
    if not results:
        raise FitError(problem)
    variables = sorted({key for constants in results.values() for key in constants})
    found_constants = {
        key: ("series", [constants.get(key, np.nan) for constants in results.values()], {"units": "1"})
        for key in variables
    }
    verdicts = {"fitted_law_holds": ("series", sentences, FITTED_LAW_HOLDS), "law_holds": ("series", stated_sentences)}
    return xr.Dataset(found_constants | verdicts, coords={"series": list(results)})


def _named(film: str, constants: FloatArray, width: FloatArray, residuals: FloatArray) -> dict[str, float]:
    named = {
        f"{film}_factor": np.exp(constants[0]),
        f"{film}_factor_low": np.exp(constants[0] - width[0]),
        f"{film}_factor_high": np.exp(constants[0] + width[0]),
        f"{film}_rms": np.sqrt(np.mean(residuals**2)),
        f"{film}_worst": np.max(np.abs(residuals)),
    }
    for index, name in enumerate(_GROUPS, start=1):
        named[f"{film}_{name}"] = constants[index]
        named[f"{film}_{name}_low"] = constants[index] - width[index]
        named[f"{film}_{name}_high"] = constants[index] + width[index]
    return {key: float(value) for key, value in named.items()}


FITS: tuple[Fit, ...] = (
    Fit(
        "film_exponents",
        ("ehl_line",),
        "h/R = factor W^load U^speed G^material through a map of films, beside Pan and Hamrock (eq. 5.3)",
        film_exponents,
    ),
)
