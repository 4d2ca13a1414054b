"""Stopping at the answer: which cases narrow the interval of a fitted constant that is still too wide."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import xarray as xr

from mdr_dask import fits, store
from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.campaign import Campaign, Tolerance
from mdr_dask.errors import CampaignError, FitError, did_you_mean
from mdr_dask.fits.base import Fit
from mdr_dask.models.base import Status
from mdr_dask.plan import Template
from mdr_dask.replication import FEWEST

#: Cases take part in a round whose part of the variance of a constant is at least this part of the largest one.
SHARE = 0.1
#: Part of its standard error that a mean is moved by, to see what follows: little, so that a fit keeps its cases.
STEP = 1e-3


def require_known(campaign: Campaign) -> None:
    """Refuse tolerances of what is neither an output nor fitted to results of the model.

    Raises
    ------
    CampaignError
        If there are such.
    """
    if not campaign.replication.answers:
        return
    known = fits.available(campaign.model)
    for name in campaign.replication.answers:
        fit = name.partition(".")[0]
        if fit not in known:
            what = f"neither an output nor a fit of {campaign.model}{did_you_mean(fit, list(known))}"
            raise CampaignError(f"{campaign.source}: realisations.until.{fit}: {what}")
    if any(axis.refinement for one in campaign.series for axis in one.axes):
        raise CampaignError(
            f"{campaign.source}: realisations.until: expected outputs with an adaptive axis, got fitted constants"
        )


def cases_that_narrow(
    url: str, campaign: Campaign, layout: Sequence[Template], asked: Sequence[BoolArray], count: int
) -> list[BoolArray]:
    """Return the cases that take part in a further round, by so many realisations, for the sake of fitted constants.

    Raises
    ------
    FitError
        If a fit cannot be made of what is there.
    """
    if not campaign.replication.answers or count < FEWEST:
        return [mask & bool(campaign.replication.answers) for mask in asked]
    opened = store.datasets(url)
    groups: dict[str, xr.Dataset] = {}
    for template, mask in zip(layout, asked, strict=True):
        name = template.series.name if template.series.name in opened else next(iter(opened))
        groups[name] = _part(opened[name], template, mask, count)
    found = {name: np.zeros(groups[name]["status"].shape[:-1], dtype=bool) for name in groups}
    known = fits.available(campaign.model)
    for answer, tolerance in campaign.replication.answers.items():
        fit, _, constant = answer.partition(".")
        for name, cases in _wanted(known[fit], constant, groups, tolerance):
            found[name] |= cases
    return [
        _in_store(found[name], groups[name], template) & mask
        for (name, template, mask) in zip(groups, layout, asked, strict=True)
    ]


def _part(data: xr.Dataset, template: Template, asked: BoolArray, count: int) -> xr.Dataset:
    """Return the results of the cases asked for, those that are done, of the first realisations."""
    wanted = xr.DataArray(asked, dims=template.dims[:-1], coords=_coordinates(template))
    wanted = wanted.sel({dim: data[dim] for dim in wanted.indexes})
    first = data.isel(realisation=slice(0, count)).load()
    done = (first["status"] == Status.DONE) & wanted
    return first.map(lambda array: array.where(done) if array.name != "status" else array, keep_attrs=True)


def _coordinates(template: Template) -> dict[str, object]:
    return {axis.dim: list(axis.labels or axis.values) for axis in template.series.axes if axis.dim == axis.name}


def _in_store(cases: BoolArray, data: xr.Dataset, template: Template) -> BoolArray:
    """Return cases in the order of the store."""
    dims = [str(dim) for dim in data["status"].dims[:-1]]
    own = _coordinates(template)
    found = xr.DataArray(cases, dims=dims, coords={dim: data[dim] for dim in dims if dim in data.indexes})
    return np.asarray(found.sel({dim: own[dim] for dim in found.indexes}).transpose(*template.dims[:-1]).to_numpy())


def _wanted(
    fit: Fit, constant: str, groups: Mapping[str, xr.Dataset], tolerance: Tolerance
) -> Iterator[tuple[str, BoolArray]]:
    """Yield the cases of each series that narrow a constant, where its interval is too wide."""
    for name, result in fit.results(groups).items():
        if constant not in result:
            names = [str(key) for key in result if f"{key}_low" in result]
            raise FitError(f"{fit.name}: no constant {constant!r}{did_you_mean(constant, names)}")
        half = (result[f"{constant}_high"] - result[f"{constant}_low"]) / 2
        allowed = np.maximum(tolerance.absolute, tolerance.relative * abs(result[constant]))
        wide = half > allowed  # an interval without ends belongs to a law that does not hold, or is not reached
        for series in [name] if fit.apart else groups:
            if bool(wide.any()):
                yield series, _narrowing(fit, constant, groups, series, wide)


def _narrowing(fit: Fit, constant: str, groups: Mapping[str, xr.Dataset], series: str, wide: xr.DataArray) -> BoolArray:
    """Return the cases of a series whose scatter moves a constant most."""
    data = groups[series]
    dims = [str(dim) for dim in data["status"].dims[:-1]]
    own = [dim for dim in dims if dim in wide.dims]  # a constant for each of their values: all are moved at once
    inner = [dim for dim in dims if dim not in own]
    aside = {"status", *(array.attrs.get("ancillary_variables") for array in data.data_vars.values())}
    outputs = [str(name) for name in data.data_vars if name not in aside and "realisation" in data[name].dims]
    means = data[outputs].mean("realisation", keep_attrs=True).expand_dims(realisation=[0], axis=-1)
    number = data[outputs].notnull().sum("realisation")
    errors = (data[outputs].std("realisation", ddof=1) / number**0.5).fillna(0.0)
    shape = [data.sizes[dim] for dim in inner]
    sign = np.where(np.random.Generator(np.random.Philox(0)).random(shape) < 0.5, -1.0, 1.0)

    def moved(cells: FloatArray) -> xr.DataArray:
        step = xr.DataArray((STEP * sign.ravel() * cells).reshape(shape), dims=inner)
        changed = means.map(lambda array: array + step * errors[array.name], keep_attrs=True)
        changed = changed.map(lambda array: array.transpose(*means[array.name].dims), keep_attrs=True)
        kept = {key: value for key, value in changed.items() if key in outputs}
        found = fit.results(
            {**groups, series: data.drop_vars(list(data.data_vars)).drop_vars("realisation").assign(kept)}
        )
        return found[series if fit.apart else ""][constant]

    size = int(np.prod(shape, dtype=int))
    start = moved(np.zeros(size))
    effect = xr.DataArray(np.zeros((*(data.sizes[dim] for dim in own), size)), dims=[*own, "cell"])
    parts = [np.arange(size)]
    while parts:
        part = parts.pop()
        cells = np.zeros(size)
        cells[part] = 1.0
        change = abs(moved(cells) - start).where(wide, 0.0).fillna(0.0)
        if not bool((change > 0).any()):
            continue
        if part.size == 1:
            rest = [dim for dim in change.dims if dim not in own]
            effect[..., int(part[0])] = change.max(rest).transpose(*own)
        else:
            parts += np.array_split(part, 2)
    largest = effect.max("cell")
    chosen = (effect**2 >= SHARE * largest**2) & (effect > 0)
    whole = chosen.to_numpy().reshape([*(data.sizes[dim] for dim in own), *shape])
    return np.asarray(xr.DataArray(whole, dims=[*own, *inner]).transpose(*dims).to_numpy())
