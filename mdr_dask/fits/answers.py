"""Stopping at the answer: whether a fitted constant is known well enough, and which cases it follows from."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from mdr_dask.campaign import Campaign, Tolerance
from mdr_dask.errors import CampaignError, FitError, did_you_mean
from mdr_dask.fits import available
from mdr_dask.fits.base import Fit

#: Part of its standard error that a mean is moved by, to see what follows: little, so that a fit keeps its cases.
STEP = 1e-3
#: Most groups of neighbours along a dimension that are moved one after the other.
GROUPS = 32


def require_known(campaign: Campaign) -> None:
    """Refuse realisations until constants are known that no fit of the model finds.

    Raises
    ------
    CampaignError
        With one sentence for each.
    """
    known = available(campaign.model) if campaign.replication.answers else {}
    problems = []
    for answer in campaign.replication.answers:
        name, _, constant = answer.partition(".")
        if name not in known:
            wrong = f"neither an output nor a fit of {campaign.model}{did_you_mean(name, list(known))}"
        elif constant not in known[name].constants:
            has = ", ".join(known[name].constants) or "none"
            wrong = f"expected a constant with an interval of the fit {name} ({has}), got {constant!r}"
        else:
            continue
        problems.append(f"{campaign.source}: realisations.until.{answer}: {wrong}")
    if campaign.replication.answers and any(axis.refinement for one in campaign.series for axis in one.axes):
        problems.append(
            f"{campaign.source}: realisations.until: expected outputs beside an adaptive axis, got constants"
        )
    if problems:
        raise CampaignError(*problems)


def half_widths(
    fit: Fit, constant: str, groups: Mapping[str, xr.Dataset]
) -> dict[str, tuple[xr.DataArray, xr.DataArray]]:
    """Return a constant and half of its 95 % interval, by series.

    Raises
    ------
    FitError
        If the fit cannot be made, or does not find this constant.
    """
    found = {}
    for name, result in fit.results(groups).items():
        if constant not in result:
            raise FitError(f"{fit.name}: no constant {constant!r}")
        found[name] = (result[constant], (result[f"{constant}_high"] - result[f"{constant}_low"]) / 2)
    return found


def is_wide(value: xr.DataArray, half: xr.DataArray, tolerance: Tolerance) -> xr.DataArray:
    """Return where an interval is too wide; not where it has no ends, as of a law that does not hold."""
    return half > np.maximum(tolerance.absolute, tolerance.relative * abs(value))


def cases_behind(
    fit: Fit, constant: str, groups: Mapping[str, xr.Dataset], name: str, wide: xr.DataArray
) -> xr.DataArray:
    """Return the cases of a series that a constant follows from, where it is not known well enough.

    The values of every dimension, apart from those that the constant has itself, are moved by a small part of their
    standard error. Cases take part if the constant follows each of their coordinates, so they are whole rows and
    columns: what a fit compares has the same lines.

    Parameters
    ----------
    fit, constant : Fit, str
        The law and one of its constants.
    groups : mapping of str to Dataset
        The series that are fitted.
    name : str
        The series of the cases.
    wide : bool array
        Where the interval of the constant is too wide, over the dimensions of the result.

    Returns
    -------
    bool array over the dimensions of the cases
    """
    data = groups[name]
    sizes = {str(dim): size for dim, size in data["status"].sizes.items() if dim != "realisation"}
    own = [dim for dim in sizes if dim in wide.dims]
    place = {dim: xr.DataArray(np.arange(size), dims=dim) for dim, size in sizes.items()}
    chosen = xr.ones_like(sum(place.values(), xr.DataArray(0)), dtype=bool) & _over(own, wide)
    step = _steps(data, [dim for dim in sizes if dim not in own])

    def constants(moved: xr.DataArray | None = None) -> xr.DataArray | None:
        changed = data
        if moved is not None:
            shifted = {key: data[key] + by.where(moved, 0.0) for key, by in step.items()}
            changed = data.assign({key: array.assign_attrs(data[key].attrs) for key, array in shifted.items()})
        try:
            return half_widths(fit, constant, {**groups, name: changed})[name if fit.apart else ""][0]
        except FitError:
            return None

    start = constants()
    for dim in sizes:
        if dim in own:
            continue
        follows = xr.zeros_like(chosen)
        for group in np.array_split(np.arange(sizes[dim]), min(GROUPS, sizes[dim])):
            here = place[dim].isin(group)
            after = constants(here)
            if after is None or start is None:
                follows = follows | here
                continue
            follows = follows | (here & _over(own, after != start))
        chosen = chosen & follows
    return chosen.transpose(*sizes)


def _over(dims: list[str], flags: xr.DataArray) -> xr.DataArray:
    """Return where any flag is set, over some of their dimensions."""
    bare = flags.drop_vars(flags.coords)
    return bare.any([dim for dim in bare.dims if dim not in dims])


def _steps(data: xr.Dataset, inner: list[str]) -> dict[str, xr.DataArray]:
    """Return by how much the results of every case are moved, all of its realisations alike: some up, some down."""
    beside = {"status", *(array.attrs.get("ancillary_variables") for array in data.data_vars.values())}
    signs = np.random.Generator(np.random.Philox(0)).choice([-1.0, 1.0], [data.sizes[dim] for dim in inner])
    found = {}
    for key, values in data.data_vars.items():
        if key not in beside and "realisation" in values.dims:
            error = values.std("realisation", ddof=1) / values.notnull().sum("realisation") ** 0.5
            found[str(key)] = (STEP * xr.DataArray(signs, dims=inner) * error).drop_vars(error.coords).fillna(0.0)
    return found
