"""Decide whether a fitted constant needs more realisations, and find the cases on which the constant depends."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from mdr_dask import bootstrap
from mdr_dask.campaign import Campaign, Tolerance
from mdr_dask.errors import CampaignError, FitError, did_you_mean
from mdr_dask.fits import available
from mdr_dask.fits.base import Fit

#: Change of the data by which derivatives are computed: a shift of the results of a case, in standard errors, or a
#: fraction of the scatter. The change is so small that the fit still selects the same cases.
STEP = 1e-3
#: A group of cases needs no more realisations if a shift of the results of the group by one standard error changes the
#: constant by less than this fraction of the half width of the interval of the constant.
NEGLIGIBLE = 0.01


def require_known(campaign: Campaign) -> None:
    """Raise CampaignError if a campaign names a constant in ``until`` that no fit gives."""
    known = available(campaign.model) if campaign.replication.answers else {}
    is_adaptive = any(axis.refinement for one in campaign.series for axis in one.axes)
    problems = []
    for answer, tolerance in campaign.replication.answers.items():
        name, _, constant = answer.partition(".")
        if name not in known:
            wrong = f"neither an output nor a fit of {campaign.model}{did_you_mean(name, list(known))}"
        elif constant not in known[name].constants_of(campaign):
            has = ", ".join(known[name].constants_of(campaign)) or "none"
            wrong = f"expected a constant with an interval of the fit {name} ({has}), got {constant!r}"
        elif campaign.replication.until and is_adaptive:
            wrong = "with an adaptive axis, expected either outputs or constants, got both"
        else:
            continue
        problems.append(f"{tolerance.place or campaign.source}: realisations.until.{answer}: {wrong}")
    if problems:
        raise CampaignError(*problems)


def half_widths(
    fit: Fit, constant: str, groups: Mapping[str, xr.Dataset]
) -> dict[str, tuple[xr.DataArray, xr.DataArray]]:
    """Return, for each series, the value of a constant and the half width of its 95 % interval."""
    found = {}
    for name, result in fit.results(groups).items():
        if constant not in result:
            raise FitError(f"{fit.name}: no constant {constant!r}")
        found[name] = (result[constant], (result[f"{constant}_high"] - result[f"{constant}_low"]) / 2)
    return found


def is_wide(value: xr.DataArray, half: xr.DataArray, tolerance: Tolerance) -> xr.DataArray:
    """Return which half widths of intervals exceed the tolerance; an infinite or NaN half width counts as narrow."""
    return (half > _allowed(value, tolerance)) & np.isfinite(half)


def _allowed(value: xr.DataArray, tolerance: Tolerance) -> xr.DataArray:
    relative = tolerance.relative * abs(value)
    return relative.where(relative > tolerance.absolute, tolerance.absolute)


def without_scatter(fit: Fit, constant: str, groups: Mapping[str, xr.Dataset]) -> dict[str, xr.DataArray]:
    """Return, for each series, the half width that the interval of a constant would have without scatter.

    The fit is repeated with slightly less and with slightly more scatter. Each of the two half widths is extrapolated
    linearly to zero scatter. The smaller of the two results is returned.
    """
    now = half_widths(fit, constant, groups)

    def left(scale: float) -> dict[str, xr.DataArray]:
        found = half_widths(fit, constant, {name: _scattered(data, scale) for name, data in groups.items()})
        return {name: (half - scale * now[name][1]) / (1 - scale) for name, (_, half) in found.items()}

    more = left(1 + STEP)
    return {name: less.where(less < more[name], more[name]) for name, less in left(1 - STEP).items()}


def _scattered(data: xr.Dataset, scale: float) -> xr.Dataset:
    """Return a study in which the scatter of the realisations about their mean is multiplied by `scale`."""
    found = {}
    for name in _results(data):
        mean = data[name].mean("realisation")
        found[name] = (mean + scale * (data[name] - mean)).transpose(*data[name].dims).assign_attrs(data[name].attrs)
    return data.assign(found)


def still_wide(
    fit: Fit, constant: str, groups: Mapping[str, xr.Dataset], tolerance: Tolerance, at_most: int
) -> dict[str, xr.DataArray]:
    """Return, for each series, whether the interval of a constant is too wide and more realisations would help.

    More realisations do not help if the part of the half width that is due to scatter is within the tolerance, and the
    total half width would exceed the tolerance even with `at_most` realisations.
    """
    found = half_widths(fit, constant, groups)
    wide = {name: is_wide(*both, tolerance) for name, both in found.items()}
    if not any(bool(flags.any()) for flags in wide.values()):
        return wide
    left = without_scatter(fit, constant, groups)
    count = max(data.sizes["realisation"] for data in groups.values())
    for name, (value, half) in found.items():
        allowed = _allowed(value, tolerance)
        scatter, rest = half - left[name], left[name]
        wide[name] = wide[name] & ~((scatter <= allowed) & (rest + (count / at_most) ** 0.5 * scatter > allowed))
    return wide


def cases_behind(
    fit: Fit, constant: str, groups: Mapping[str, xr.Dataset], name: str, wide: xr.DataArray
) -> xr.DataArray:
    """Return the cases of the series `name` that influence constants whose interval is too wide.

    `wide` marks the constants whose interval is too wide. Along each dimension of the series that `wide` lacks,
    neighbouring cases form groups. The results of one group are shifted, and the fit is repeated. A case is chosen if,
    along every dimension with groups, the shift of the group with this case changes a marked constant.
    """
    data = groups[name]
    sizes = {str(dim): size for dim, size in data["status"].sizes.items() if dim != "realisation"}
    own = [dim for dim in sizes if dim in wide.dims]
    place = {dim: xr.DataArray(np.arange(size), dims=dim) for dim, size in sizes.items()}
    chosen = xr.ones_like(sum(place.values(), xr.DataArray(0)), dtype=bool) & _over(own, wide)
    step = _steps(data, [dim for dim in sizes if dim not in own])

    result = name if fit.apart else ""
    start, half = half_widths(fit, constant, groups)[result]

    def after(moved: xr.DataArray) -> xr.DataArray | None:
        shifted = {key: data[key] + by.where(moved, 0.0) for key, by in step.items()}
        changed = data.assign({key: array.assign_attrs(data[key].attrs) for key, array in shifted.items()})
        try:
            return half_widths(fit, constant, {**groups, name: changed})[result][0]
        except FitError:
            return None

    for dim in sizes:
        if dim in own:
            continue
        follows = xr.zeros_like(chosen)
        for group in np.array_split(np.arange(sizes[dim]), min(bootstrap.GROUPS, sizes[dim])):
            here = place[dim].isin(group)
            there = after(here)
            if there is not None:
                here = here & _over(own, wide & (abs(there - start) > NEGLIGIBLE * STEP * half))
            follows = follows | here
        chosen = chosen & follows
    return chosen.transpose(*sizes)


def _over(dims: list[str], flags: xr.DataArray) -> xr.DataArray:
    """Return, for each position along the dimensions `dims`, whether any flag at this position is set."""
    bare = flags.drop_vars(flags.coords)
    return bare.any([dim for dim in bare.dims if dim not in dims])


def _steps(data: xr.Dataset, inner: list[str]) -> dict[str, xr.DataArray]:
    """Return small random shifts for the outputs of all cases, because equal shifts would cancel in differences."""
    generator, shape = np.random.Generator(np.random.Philox(0)), [data.sizes[dim] for dim in inner]
    found = {}
    for key in _results(data):
        size = generator.choice([-1.0, 1.0], shape) * generator.uniform(0.5, 1.5, shape)
        error = data[key].std("realisation", ddof=1) / data[key].notnull().sum("realisation") ** 0.5
        found[key] = (STEP * xr.DataArray(size, dims=inner) * error).drop_vars(error.coords).fillna(0.0)
    return found


def _results(data: xr.Dataset) -> list[str]:
    """Return the names of the outputs that have a value for each realisation; errors of outputs are left out."""
    beside = {"status", *(array.attrs.get("ancillary_variables") for array in data.data_vars.values())}
    return [str(key) for key, array in data.data_vars.items() if key not in beside and "realisation" in array.dims]
