"""The class `Plot`: a named figure, with a function that makes the figure from the series of a store."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import xarray as xr

from mdr_dask import store
from mdr_dask.aggregation import BIASED, has_biased_means
from mdr_dask.fits.base import faults_named
from mdr_dask.models.base import Status
from mdr_dask.plots import curves, labels, page
from mdr_dask.plots.figure import Figure
from mdr_dask.version import __version__

if TYPE_CHECKING:
    from mdr_dask.plots.render import Drawn


@dataclass(frozen=True)
class Plot:
    """A figure that has a name. The function `draw` receives the series of a store, indexed by name.

    `models` are the names of the models that have this figure. If `models` is empty, all models have the figure.
    `summary` names the quantities on both axes. `fitted` is true if the figure shows a fit. A fit takes a long time in
    a large study.
    """

    name: str
    models: tuple[str, ...]
    summary: str
    draw: Callable[[Mapping[str, xr.Dataset]], Figure]
    fitted: bool = False

    def describe(self, groups: Mapping[str, xr.Dataset]) -> Figure:
        """Return the figure as data; it states how many results failed, did not converge or are missing."""
        with self.faults_named(), page.with_labels(labels.chosen_units(groups), labels.symbols(groups)):
            figure = self.draw({name: _squeezed(data) for name, data in groups.items()})
            fixed = [{str(name) for name in data.coords if data[name].ndim == 0} for data in groups.values()]
            idle = [names.difference(curves.scalars(data)) for names, data in zip(fixed, groups.values(), strict=True)]
            figure.unnamed = set.intersection(*idle)
            every = [data["status"] for data in groups.values() if "status" in data]
            figure.leave_out(_without_value(every if figure.states is None else figure.states))
        return figure

    def faults_named(self) -> AbstractContextManager[None]:
        """Return a context that turns an unexpected exception of this figure into a CodeError."""
        return faults_named(f"the figure {self.name!r}", self.draw)

    def figure(self, groups: Mapping[str, xr.Dataset]) -> Drawn:
        """Draw the figure with matplotlib; raise the same errors as `describe`."""
        from mdr_dask.plots.render import render

        description = self.describe(groups)
        with self.faults_named():
            drawn = render(description)
        drawn.origin = origin_of(self.name, groups)
        return drawn


def _squeezed(data: xr.Dataset) -> xr.Dataset:
    if "status" not in data:
        return data
    return data.squeeze([dim for dim in data["status"].dims if dim != "realisation" and data.sizes[dim] == 1])


def _without_value(states: Sequence[xr.DataArray]) -> list[str]:
    """Return up to three texts: how many results failed, how many did not converge, and how many are missing.

    If some realisations of a case succeeded and others failed or did not converge, the first text warns that the mean
    may be biased.
    """
    total = sum(state.size for state in states)
    reasons = {Status.FAILED: "failed", Status.NOT_CONVERGED: "did not converge", Status.MISSING: "are missing"}
    counts = {words: sum(int((state == status.value).sum()) for state in states) for status, words in reasons.items()}
    found = [f"{count} of {total} results, because they {words}" for words, count in counts.items() if count]
    if any(map(has_biased_means, states)):
        found[0] += f"; {BIASED}"
    return found


def provenance(name: str, urls: Sequence[str], command: str) -> dict[str, str]:
    """Return the origin of a figure: the program version, a command that draws it, and the campaign of each store."""
    origin = {"mdr_dask": f"{__version__}, figure {name}", "command": command}
    return origin | {f"store {url}": _campaign_of(store.attributes(url)) for url in urls}


def origin_of(name: str, groups: Mapping[str, xr.Dataset]) -> dict[str, str]:
    """Return the origin of a figure that was drawn from Python: the program version and the campaigns."""
    campaigns = dict.fromkeys(_campaign_of(data.attrs) for data in groups.values())
    return {"mdr_dask": f"{__version__}, figure {name}", "study": "; ".join(campaigns)}


def _campaign_of(held: Mapping[Any, Any]) -> str:
    title, text, model, version = (str(held.get(key)) for key in ("title", "campaign", "model", "model_version"))
    digest, computed = hashlib.sha256(text.encode()).hexdigest(), held.get("versions", {}).get("mdr_dask")
    return f"campaign {title}, sha256 {digest}, model {model} version {version}, computed by mdr_dask {computed}"
