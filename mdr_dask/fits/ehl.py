"""Film formulas of one's own: powers of load, speed and material parameter through the films of a map."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import Fit, law_holds
from mdr_dask.models.ehl_line import groups as groups_of

_FILMS = {"central_film": "central", "minimum_film": "minimum"}
_GROUPS = {"load": "W", "speed": "U", "material": "G"}


def _logarithms(dataset: xr.Dataset, output: str) -> FloatArray:
    """Return ln W, ln U, ln G and ln h/R of the cases that have a film, shape (4, n)."""
    film = dataset[output].isel(realisation=0)
    table = np.stack([np.ravel(array) for array in xr.broadcast(*groups_of(dataset.coords.get), film)]).astype(
        np.float64
    )
    return np.asarray(np.log(table[:, np.isfinite(table).all(axis=0) & (table > 0).all(axis=0)]))


def _maps(groups: Mapping[str, xr.Dataset]) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield a map of films for each series and each value of what else varies there (the law, the inlet)."""
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
    """Return constants, half widths of their 95 % intervals, and residuals of ln h over ln W, ln U, ln G."""
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
    covariance = np.linalg.inv(design[:, varied].T @ design[:, varied]) * np.sum(residuals**2) / freedom
    constants[varied] = solution
    width[varied] = t.ppf(0.975, freedom) * np.sqrt(np.diag(covariance))
    if _sentence([residuals]).startswith("no"):
        # films have no scatter: what a law misses may point one way everywhere
        width[varied] += np.abs(np.linalg.pinv(design[:, varied])) @ np.abs(residuals)
    return constants, width, residuals


def _sentence(residuals: list[FloatArray]) -> str:
    """Say whether the law holds: films have no scatter that could explain a departure."""
    return law_holds(np.concatenate(residuals), 0.0)


def film_exponents(groups: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Fit ``h/R = factor W^load U^speed G^material`` to the films of every series that varies W, U or G.

    Whatever else varies in a series (the law of the viscosity, the inlet) makes a map of its own for each value.

    Parameters
    ----------
    groups : mapping of str to Dataset
        Groups of a store of ``ehl_line``.

    Returns
    -------
    Dataset, dims (series,)
        ``<film>_factor``, ``<film>_load``, ``<film>_speed``, ``<film>_material`` for the central and the minimum film,
        with ``_low`` and ``_high``; NaN for an exponent whose number is not varied. ``<film>_rms`` and ``<film>_worst``
        are the deviations of ``ln h``: the law is an approximation, and the intervals measure its misfit, not noise;
        in full where ``law_holds`` says *no*.

    Raises
    ------
    FitError
        If no series has enough points.
    """
    results: dict[str, dict[str, float]] = {}
    sentences: list[str] = []
    problem = "expected a series with central_film or minimum_film over W, U or G, got none"
    for name, dataset in _maps(groups):
        constants: dict[str, float] = {}
        departures = []
        try:
            for output in sorted(_FILMS.keys() & set(dataset.data_vars)):
                found = _regression(_logarithms(dataset, str(output)))
                constants |= _named(_FILMS[str(output)], *found)
                departures.append(found[-1])
        except FitError as error:
            problem = str(error)
            continue
        results[name] = constants
        sentences.append(_sentence(departures))
    if not results:
        raise FitError(problem)
    variables = sorted({key for constants in results.values() for key in constants})
    return xr.Dataset(
        {
            key: ("series", [constants.get(key, np.nan) for constants in results.values()], {"units": "1"})
            for key in variables
        }
        | {"law_holds": ("series", sentences)},
        coords={"series": list(results)},
    )


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
    Fit("film_exponents", ("ehl_line",), "h/R = factor W^load U^speed G^material over a map of films", film_exponents),
)
