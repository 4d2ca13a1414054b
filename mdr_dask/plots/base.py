"""What a figure is: data about it and one function from the series of a store to a matplotlib Figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import xarray as xr

from mdr_dask.campaign.written import written_units
from mdr_dask.errors import DataError, MdrDaskError
from mdr_dask.models.base import Status
from mdr_dask.store import is_damage

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Plot:
    """A figure that can be drawn from a store.

    Parameters
    ----------
    name : str
        As in ``mdr-dask plot STORE NAME``.
    models : tuple of str
        Models whose stores it understands; none stands for all models.
    summary : str
        One line: what against what, and the figure of the thesis it redraws.
    draw : callable, mapping of str to Dataset -> Figure
        Takes the groups of a store as :class:`mdr_dask.fits.base.Fit` does. Axes carry units, the title what bars mean
        and what is held fixed; `mdr_dask.plots.style.leave_out` says what is not drawn.
    """

    name: str
    models: tuple[str, ...]
    summary: str
    draw: Callable[[Mapping[str, xr.Dataset]], Figure]

    def figure(self, groups: Mapping[str, xr.Dataset]) -> Figure:
        """Draw it from the groups of a store; results that failed or are missing are counted under it.

        Axes of one value are parameters at a fixed value. Parameters have the units in which their campaigns are
        written, where these agree.

        Raises
        ------
        DataError, FitError
            If the store has not the data for it.
        """
        from mdr_dask.plots import page, table
        from mdr_dask.plots.style import leave_out

        try:
            with page.with_units(_written_units(groups)):
                figure = self.draw({name: _prepared(data) for name, data in groups.items()})
        except MdrDaskError:
            raise
        except Exception as error:
            if is_damage(error):
                raise
            # a fault of the figure must neither end the others nor the program
            problem = f"{type(error).__name__}: {error}"
            raise DataError(f"a fault of this figure, please report it with the campaign: {problem}") from error
        leave_out(figure, _without_value(groups))
        if isinstance(figure, table.Drawn):
            figure.origin = table.of_groups(self.name, groups)
        return figure


def _written_units(groups: Mapping[str, xr.Dataset]) -> dict[str, str]:
    """Return the units of parameters on which the campaigns of all groups agree."""
    first, *others = [written_units(str(data.attrs.get("campaign", ""))) for data in groups.values()]
    return {name: unit for name, unit in first.items() if all(other.get(name, unit) == unit for other in others)}


def _prepared(data: xr.Dataset) -> xr.Dataset:
    """Return a series with parameters of one value fixed."""
    if "status" not in data:
        return data
    return data.squeeze([dim for dim in data["status"].dims if dim != "realisation" and data.sizes[dim] == 1])


def _without_value(groups: Mapping[str, xr.Dataset]) -> list[str]:
    """Return how many results of a store have no value, and why."""
    states = [data["status"].to_numpy() for data in groups.values() if "status" in data]
    total = sum(state.size for state in states)
    told = {Status.FAILED: "failed", Status.NOT_CONVERGED: "did not converge", Status.MISSING: "are missing"}
    counts = {words: sum(int((state == status.value).sum()) for state in states) for status, words in told.items()}
    return [f"{count} of {total} results of the store, which {words}" for words, count in counts.items() if count]
