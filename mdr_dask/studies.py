"""Run and analyse studies from Python. Importing this module gives every Dataset of xarray the accessor ``mdr``."""

from __future__ import annotations

import atexit
import hashlib
import shutil
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from mdr_dask import aggregation, campaign, fits, models, plots, store
from mdr_dask.bars import reporter
from mdr_dask.campaign import Campaign
from mdr_dask.campaign.keys import of_keys
from mdr_dask.errors import CampaignError, DataError, did_you_mean
from mdr_dask.execute import Resources
from mdr_dask.execute import run as execute
from mdr_dask.models.base import Status
from mdr_dask.plots import page
from mdr_dask.questions import selection
from mdr_dask.questions.columns import Columns, numbers, states
from mdr_dask.questions.table import MEANS, Question, labelled
from mdr_dask.questions.table import table as rows_of
from mdr_dask.summary import Summary, summary
from mdr_dask.tables import is_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from mdr_dask.physics.superposition.master_curve import Vertical

#: A campaign: the keys of a campaign file, the path of such a file, or a `Campaign` that has been read.
Source = Mapping[str, Any] | str | Path | Campaign
#: A study: the return value of `run` or `open_study`, or the path or URL of a store.
Study = xr.Dataset | xr.DataTree | str | Path
#: One text (a name or a condition), or several.
Words = str | Sequence[str]


def read(source: Source) -> Campaign:
    """Read a campaign from the path of a campaign file, or from a mapping with the keys of such a file.

    Values of a mapping may be numbers in SI units, strings with units, pint quantities, lists and numpy arrays. Its key
    ``name`` is optional. CampaignError is raised if the campaign has problems.
    """
    if isinstance(source, Campaign):
        return source
    if isinstance(source, Mapping):
        return of_keys(source)
    if not isinstance(source, str | Path):
        raise CampaignError(f"expected the keys or the path of a campaign file, got {type(source).__name__}")
    return campaign.load(source)


def check(source: Source) -> Summary:
    """Check a campaign without running it, and return the number of its results and its costs.

    Returns
    -------
    Summary
        Number of cases and results, size and computing time. ``print`` shows the lines of ``mdr-dask check``.

    Raises
    ------
    CampaignError
        If the campaign has problems. The error message lists all problems.

    Examples
    --------
    >>> costs = check({"model": "ehl_line", "parameters": {"load_parameter": [1e-5, 1e-4], "speed_parameter": 1e-11,
    ...     "material_parameter": 4500}})
    >>> costs.cases
    2
    """
    return summary(read(source))


def run(
    source: Source,
    store: str | Path | None = None,
    progress: bool = True,
    resources: Resources | None = None,
    retry_failed: bool = False,
) -> xr.Dataset | xr.DataTree:
    """Compute the results of a campaign that are missing, and return the study.

    After an interruption, call `run` again. Finished results are kept.

    Parameters
    ----------
    source : mapping, str, Path or Campaign
        The campaign, in any form that `read` accepts.
    store : str or Path, optional
        Path or URL of the store. The default is the store that the campaign names, or ``results/<name>.zarr``. For a
        mapping without the key ``store``, the default is a store in a temporary folder, which is deleted when the
        process ends.
    progress : bool
        Whether to show the progress: as a bar in a notebook or on a terminal, otherwise as a line every few seconds.
    resources : Resources, optional
        Threads, processes, a scheduler or a cluster; the default is all cores of this machine.
    retry_failed : bool
        Whether to compute results again if they failed or did not converge.

    Returns
    -------
    Dataset or DataTree
        The study, as returned by `open_study`. Warnings are shown if results failed in this run, if numbers without a
        unit are perhaps not in SI, and if columns of a table of cases are not used.

    Raises
    ------
    MdrDaskError
        If the campaign cannot be run. ``mdr-dask run`` prints the same message.

    Examples
    --------
    >>> study = run({"model": "ehl_line", "parameters": {"load_parameter": [1e-5, 1e-4], "speed_parameter": 1e-11,
    ...     "material_parameter": 4500}, "outputs": ["central_film"]}, progress=False)
    >>> study.central_film.sizes["load_parameter"]
    2
    """
    found = read(source)
    for question in found.remarks:
        warnings.warn(question, stacklevel=2)
    url = str(store or _place(found, isinstance(source, Mapping) and "store" not in source))
    with reporter(not progress) as report:
        outcome = execute(found, url, resources or Resources(), report, retry_failed)
    if outcome.failed:
        what = f"{outcome.failed} of {outcome.total} results failed; mdr-dask status {url} --failures shows the reasons"
        warnings.warn(what, stacklevel=2)
    return open_study(url)


def open_study(url: str | Path) -> xr.Dataset | xr.DataTree:
    """Open a study, finished or not.

    Returns
    -------
    Dataset or DataTree
        The outputs with their units, their errors as ``<output>_error``, and ``status``. The dimensions of these arrays
        are the axes (or ``case``, if the cases form no grid), ``realisation``, and the coordinate of an output that is
        itself a curve, such as a profile. A campaign with series gives a DataTree with a node for each series. An array
        is read when it is first used. While results are missing, the attribute ``complete`` is False; functions such as
        `table` compute means over the available results.

    Raises
    ------
    StoreError
        If there is no study at `url`.
    """
    groups = {
        name: data.assign_attrs(complete=not bool((data["status"] == Status.MISSING).any()))
        for name, data in store.datasets(str(url)).items()
    }
    return (
        groups[""] if [*groups] == [""] else xr.DataTree.from_dict({f"/{name}": data for name, data in groups.items()})
    )


def aggregate(
    study: Study,
    outputs: Words = (),
    statistics: Words = aggregation.NAMES,
    *,
    series: str | None = None,
    select: Words = (),
    where: str = "",
    group_by: Words = (),
    columns: Words = (),
    units: Mapping[str, str] | None = None,
) -> xr.Dataset:
    """Compute statistics of outputs over realisations, like ``mdr-dask show --statistic``.

    Parameters
    ----------
    study : Dataset, DataTree, str or Path
        A study, or the path or URL of its store.
    outputs : sequence of str
        Names of outputs; by default, all outputs with one number for each result.
    statistics : sequence of str
        Names of statistics, from `mdr_dask.aggregation.NAMES`.
    series, select, where, group_by, columns, units
        The same as the options of the command (docs/questions.md).

    Returns
    -------
    Dataset
        A variable ``<output>_<statistic>`` for every output and statistic, the requested columns, and the number of
        results in each state as ``state_counts``. An output without errors has no ``grid_error``.
    """
    parts = (_several(select), where, _several(group_by), (), _several(columns), units or {})
    asked = Question(_several(outputs), *parts, _several(statistics))
    return store.with_plain_attributes(labelled(_group(study, series), asked))


def table(
    study: Study,
    outputs: Words = (),
    statistics: Words | None = MEANS,
    *,
    series: str | None = None,
    select: Words = (),
    where: str = "",
    group_by: Words = (),
    sort: Words = (),
    columns: Words = (),
    units: Mapping[str, str] | None = None,
    limit: int = 0,
) -> pd.DataFrame:
    """Return a study as a table, like ``mdr-dask show``.

    By default, each row contains a case (or, with `group_by`, a group of cases) and the means of its outputs with their
    errors. With ``statistics=None``, each row is a single result. `limit` is the largest number of rows, or 0 for all
    rows. The other arguments are the same as in `aggregate`, and `sort` is the same as the option of the command.

    Returns
    -------
    pandas.DataFrame
        The table; ``attrs["units"]`` contains the units of the columns.
    """
    import pandas as pd

    reduced = None if statistics is None else _several(statistics)
    parts = (_several(select), where, _several(group_by), _several(sort), _several(columns), units or {})
    asked = Question(_several(outputs), *parts, reduced)
    answer = rows_of(_group(study, series), asked, limit)
    frames = list(answer.frames)
    found = pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=list(answer.units))
    found = found[:limit] if limit else found
    found.attrs["units"] = answer.units
    return found


def fit(study: Study, law: str, measured: str | Path | pd.DataFrame | None = None) -> xr.Dataset | xr.DataTree:
    """Fit a law and return its constants with 95 % intervals, like ``mdr-dask fit``.

    Parameters
    ----------
    study : Dataset, DataTree, str or Path
        A study, or the path of its store.
    law : str
        Name of the law; ``calibration`` finds unknown parameters from measured points.
    measured : str, Path or DataFrame, optional
        Table of measured points, used instead of the table of the campaign. Units are in brackets after the column
        names.

    Returns
    -------
    Dataset or DataTree
        The constants, the limits of the intervals (with ``_low`` and ``_high`` after the name), and ``law_holds``. If
        series are fitted separately, the result is a DataTree with a node for each series.

    Raises
    ------
    DataError
        If the model has no law of this name, or if the table of measured points is wrong.
    FitError
        If the law cannot be fitted, for example because the study lacks a quantity that the law needs.
    """
    groups = _groups(study)
    if measured is not None:
        from mdr_dask.fits.calibration import with_table

        groups = with_table(groups, measured)
    model = _model(groups)
    found: dict[str, xr.Dataset] = _named(fits.available(model), law, f"law for {model}").results(groups)
    if len(found) == 1:
        return next(iter(found.values()))
    return xr.DataTree.from_dict({f"/{name}": data for name, data in found.items()})


def plot(
    study: Study,
    figure: str,
    select: Words = (),
    *,
    where: str = "",
    over: Words = (),
    by: str = "",
    panels: str = "",
    log: str | None = None,
    measured: str | Path | pd.DataFrame | None = None,
    units: Mapping[str, str] | None = None,
    size: str | None = None,
    title: str | None = None,
    style: str | None = None,
) -> Figure:
    """Draw a named figure or an output, like ``mdr-dask plot``.

    Parameters
    ----------
    study : Dataset, DataTree, str or Path
        A study, or the path of its store.
    figure : str
        Name of a figure or of an output.
    over : sequence of str, optional
        One axis for curves of an output, or two axes for a map. The default is the axis with the most values, or the
        coordinate of an output that is itself a curve, such as a profile.
    select, where, by, panels, log, measured, units, size, title, style
        The same as the options of the command. `measured` may also be a DataFrame, with units in brackets after the
        column names.

    Returns
    -------
    Figure
        A figure of matplotlib. Its method ``save`` writes the figure and its data, and ``table`` returns the data.

    Raises
    ------
    DataError, FitError
        If there is no such figure or output, or if the study lacks a quantity that the figure needs.
    """
    groups = _groups(study)
    model = _model(groups)
    known = plots.available(model)
    of_output = over or by or panels or log is not None
    if of_output or (figure not in known and any(figure in data.data_vars for data in groups.values())):
        from mdr_dask.plots.view import figure_of

        found = figure_of(groups, figure, over, by, panels, log)
    else:
        found = _named(known, figure, f"figure of {model}")
    groups = selection.select_all(groups, _several(select))
    groups = selection.where_all(groups, where) if where else groups
    if measured is not None:
        from mdr_dask.plots.measured import with_points

        groups, figures = with_points(groups, {figure: found}, measured)
        found = figures[figure]
    with page.drawing_for(page.requested(size, title, style, units)):
        drawn: Figure = found.figure(groups)
    return drawn


def master_curve(
    study: Study | pd.DataFrame,
    over: str | None = None,
    of: str | Sequence[str] | None = None,
    by: str | None = None,
    vertical: Vertical | None = None,
    reference: float | None = None,
) -> xr.Dataset:
    """Shift curves into one master curve, like ``mdr-dask master-curve``.

    Parameters
    ----------
    study : Dataset, DataTree, DataFrame, str or Path
        A study, a table of curves, or the path of a store or of a table.
    over, of, by, vertical, reference
        The same as the options of the command.

    Returns
    -------
    Dataset
        The shift factors, the merged curve with its error, and the constants of the laws fitted to the factors.
    """
    from pandas import DataFrame

    from mdr_dask.fits import curve_tables, master_curve

    if isinstance(study, str | Path) and is_table(study):
        study = curve_tables.read_table(study)
    if not isinstance(study, DataFrame):
        groups = _groups(study)
        study = master_curve.friction_of_roughness(groups) if len(groups) > 1 else _group(study, None)
    return master_curve.master_curve(study, over, of, by, vertical, reference)


@xr.register_dataset_accessor("mdr")  # type: ignore[no-untyped-call]
class StudyAccessor:
    """The accessor ``study.mdr``: numbers, states and queries of a study."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    @property
    def numbers(self) -> xr.Dataset:
        """The dimensionless numbers of all cases, except numbers with a quantity that the study lacks."""
        columns = Columns(self._dataset)
        known = [name for name in numbers(self._dataset) if columns.find(name) is not None]
        return xr.Dataset({name: columns.column(name) for name in known if name not in self._dataset})

    @property
    def states(self) -> xr.DataArray:
        """The state of every case: ``done``, or how many realisations are missing, failed or not converged."""
        return states(self._dataset)

    def select(self, *selections: str) -> xr.Dataset:
        """Keep a part of the study: ``study.mdr.select("velocity=1 mm/s..1 m/s", "hurst=0.3,0.7")``."""
        return selection.select(self._dataset, selections)

    def where(self, condition: str) -> xr.Dataset:
        """Keep the cases that meet a condition, such as ``"load_number > 0.1 and velocity < 3 km/h"``."""
        return selection.where(self._dataset, condition)

    def table(self, *outputs: str, **asked: Any) -> pd.DataFrame:
        """Return means with their errors as a table: `mdr_dask.table` of this study."""
        return table(self._dataset, outputs, **asked)

    def aggregate(self, *outputs: str, **asked: Any) -> xr.Dataset:
        """Compute statistics over realisations: `mdr_dask.aggregate` of this study."""
        return aggregate(self._dataset, outputs, **asked)

    def fit(self, law: str, **asked: Any) -> xr.Dataset | xr.DataTree:
        """Fit a law: `mdr_dask.fit` of this study."""
        return fit(self._dataset, law, **asked)

    def plot(self, figure: str, select: Words = (), **asked: Any) -> Figure:
        """Draw a figure: `mdr_dask.plot` of this study."""
        return plot(self._dataset, figure, select, **asked)


def _place(found: Campaign, is_temporary: bool) -> str:
    """Return the path of a campaign's store. The name of a temporary store contains a digest of campaign and model."""
    if not is_temporary:
        return found.store
    made_by = f"{models.load(found.model).version} {models.source_digest(found.model)}"
    digest = hashlib.sha256(f"{found.text} {made_by}".encode()).hexdigest()[:16]
    return str(_temporary_folder() / f"{found.name}-{digest}.zarr")


@lru_cache(maxsize=1)
def _temporary_folder() -> Path:
    folder = tempfile.mkdtemp(prefix="mdr-dask-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def _groups(study: Study) -> dict[str, xr.Dataset]:
    """Return the groups of a study by the names of their series."""
    if isinstance(study, xr.Dataset):
        found = {"": study}
    elif isinstance(study, xr.DataTree):
        found = {name: node.to_dataset() for name, node in study.children.items()} or {"": study.to_dataset()}
    elif isinstance(study, str | Path):
        return store.datasets(str(study))
    else:
        raise DataError(f"expected a study as returned by run or open, or its path, got {type(study).__name__}")
    for data in found.values():
        if "status" not in data or "realisation" not in data["status"].dims:
            kept = "with 'status' and the dimension 'realisation' (which isel(realisation=[0]) keeps)"
            raise DataError(f"expected a study as returned by run or open, {kept}, got a Dataset without them")
    return found


def _several(words: Words) -> tuple[str, ...]:
    return (words,) if isinstance(words, str) else tuple(words)


def _group(study: Study, series: str | None) -> xr.Dataset:
    return selection.group(_groups(study), series)


def _model(groups: Mapping[str, xr.Dataset]) -> str:
    model = next(iter(groups.values())).attrs.get("model")
    if model is None:
        raise DataError("expected a study, got a Dataset without the attribute 'model'")
    return str(model)


def _named(known: Mapping[str, Any], name: str, what: str) -> Any:
    if name not in known:
        hint = did_you_mean(name, list(known)) or f"; known: {', '.join(known) or 'none'}"
        raise DataError(f"no {what} is called {name!r}{hint}")
    return known[name]
