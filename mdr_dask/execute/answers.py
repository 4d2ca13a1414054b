"""Choose the cases that need more realisations, so that a fitted constant meets its tolerance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from mdr_dask import fits, store
from mdr_dask.arrays import BoolArray, IntArray
from mdr_dask.campaign import Series
from mdr_dask.errors import FitError
from mdr_dask.execute.stages import Places, cases_of
from mdr_dask.fits.answers import cases_behind, half_widths, is_wide, still_wide, without_scatter
from mdr_dask.models.base import Status
from mdr_dask.plan import Template
from mdr_dask.refinement import Mesh, Stage

#: Least number of realisations for the interval of a fitted constant. With fewer realisations, the bootstrap
#: underestimates the scatter.
FEWEST = 10


def cases_that_narrow(
    url: str, stage: Stage, layout: Sequence[Template], places: Places, taken: Sequence[IntArray]
) -> list[BoolArray]:
    """Return the cases that need more realisations: all cases that affect a constant with too wide an interval.

    `places` are the positions that the values of the stage have in the store. `taken` is, for each case, the number of
    realisations from which the constants are computed.
    """
    answers = stage.campaign.replication.answers
    if max(int(each.max()) for each in taken) < FEWEST:  # no interval can be computed yet
        return cases_of(stage, layout, places, stage.new)
    groups = _groups(url, stage, layout, taken)
    known = fits.available(stage.campaign.model)
    found = {name: xr.zeros_like(data["status"][..., 0], dtype=bool) for name, data in groups.items()}
    for answer, tolerance in answers.items():
        fit = known[answer.partition(".")[0]]
        constant = answer.partition(".")[2]
        try:
            wide = still_wide(fit, constant, groups, tolerance, stage.campaign.replication.at_most)
        except FitError:
            continue  # `unanswered` reports this error at the end of the run
        for result, flags in wide.items():
            for name in [result] if fit.apart else groups:
                if bool(flags.any()):
                    found[name] = found[name] | cases_behind(fit, constant, groups, name, flags)
    cases = [_of_mesh(found[name], mesh) & mesh.cases for name, mesh in zip(groups, stage.meshes, strict=True)]
    return cases_of(stage, layout, places, cases)


def unanswered(url: str, stage: Stage, layout: Sequence[Template], taken: Sequence[IntArray]) -> Iterator[str]:
    """Yield a sentence about each fitted constant that does not meet its tolerance."""
    answers = stage.campaign.replication.answers
    groups = _groups(url, stage, layout, taken)
    known = fits.available(stage.campaign.model)
    for answer, tolerance in answers.items():
        name, _, constant = answer.partition(".")
        try:
            results = half_widths(known[name], constant, groups)
        except FitError as error:
            yield f"{answer}: {error}"
            continue
        for series, (value, half) in results.items():
            where = f"{series}: " if series else ""
            wide = half.where(is_wide(value, half, tolerance))
            if bool(wide.notnull().any()):
                most = max(int(each.max()) for each in taken)
                rest = float(without_scatter(known[name], constant, groups)[series].where(wide.notnull()).max())
                text = f"half of the interval is {float(wide.max()):.2g} after {most} realisations"
                fixed = f"; {rest:.2g} of it comes from the law and the grid, and more realisations do not reduce it"
                yield f"{where}{answer}: {text}{fixed if rest > 0 else ''}"
            if not bool(np.isfinite(half).all()):
                yield f"{where}{answer}: no finite interval: the law does not hold, or the data do not give both ends"


def _groups(url: str, stage: Stage, layout: Sequence[Template], taken: Sequence[IntArray]) -> dict[str, xr.Dataset]:
    """Return the results of every series, with NaN for realisations beyond `taken` and for results not done."""
    opened, groups = store.datasets(url), {}
    for mesh, template, count in zip(stage.meshes, layout, taken, strict=True):
        name = template.series.name
        data = opened[name if name in opened else next(iter(opened))]  # the store may name this series otherwise
        counts = xr.DataArray(count, dims=template.dims[:-1], coords=_coordinates(template.series))
        counts = counts.sel({dim: data[dim] for dim in counts.indexes})
        here = {dim: data[dim].isin(list(own)).to_numpy() for dim, own in _coordinates(mesh.series).items()}
        first = data.isel({**here, "realisation": slice(0, int(count.max()))}).load()
        number = xr.DataArray(np.arange(first.sizes["realisation"]), dims="realisation")
        valid = (first["status"] == Status.DONE) & (number < counts.isel(here).drop_vars(counts.coords))
        kept = {key: array.where(valid) for key, array in first.data_vars.items() if key != "status"}
        groups[name] = first.assign(kept)
    return groups


def _coordinates(series: Series) -> dict[str, list[object]]:
    return {axis.dim: list(axis.labels or axis.values) for axis in series.axes if axis.dim == axis.name}


def _of_mesh(cases: xr.DataArray, mesh: Mesh) -> BoolArray:
    """Return a mask of cases as an array, with dimensions and values in the order of the series."""
    ordered = cases.sel({dim: own for dim, own in _coordinates(mesh.series).items() if dim in cases.indexes})
    return np.asarray(ordered.transpose(*mesh.series.sizes).to_numpy())
