"""Find the cases of a stage in the store, and choose the values of adaptive axes for the next stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mdr_dask import models, store
from mdr_dask.arrays import BoolArray, IntArray
from mdr_dask.execute.events import Event
from mdr_dask.models.base import Status
from mdr_dask.plan import Template, templates
from mdr_dask.refinement import Means, Mesh, Stage, refined

#: For each group and each dimension, the positions that the values of a stage have in the store.
Places = tuple[Mapping[str, IntArray], ...]


def stored_layout(stage: Stage, url: str) -> tuple[tuple[Template, ...], Places]:
    """Return the layout that the store needs for a stage, and the positions of the stage's values in the layout."""
    campaign = stage.campaign
    if not store.exists(url):
        layout = templates(campaign, campaign.replication.at_least)
        return layout, tuple(_all_of(template) for template in layout)
    stored = store.reconcile(url, campaign)
    layout = templates(stored.campaign, max(campaign.replication.at_least, stored.realisations), stored.chunks)
    return layout, tuple(stored.places.get(t.series.name) or _all_of(t) for t in layout)


def _all_of(template: Template) -> Mapping[str, IntArray]:
    return {dim: np.arange(size) for dim, size in template.series.sizes.items()}


def cases_of(stage: Stage, layout: Sequence[Template], places: Places, cases: Sequence[BoolArray]) -> list[BoolArray]:
    """Convert masks of the cases of a stage to masks of all cases in the store."""
    found = []
    for mesh, template, place, wanted in zip(stage.meshes, layout, places, cases, strict=True):
        dims = template.dims[:-1]
        own = list(mesh.series.sizes)
        asked = np.zeros(template.shape[:-1], dtype=bool)
        asked[np.ix_(*(place[dim] for dim in dims))] = wanted.transpose([own.index(dim) for dim in dims])
        found.append(asked)
    return found


def following(
    url: str, stage: Stage, layout: Sequence[Template], places: Places, realisations: int
) -> tuple[Stage | None, Event]:
    """Return the stage that follows a finished stage (None after the last stage), and an event.

    The event contains the number of values on each adaptive axis. After the last stage, its message names the axes
    along which interpolation misses a tolerance. Only the first `realisations` realisations are used.
    """
    meshes, short = [], []
    facts: dict[str, int] = {}
    for mesh, template, place in zip(stage.meshes, layout, places, strict=True):
        more, left = refined(mesh, _means(url, mesh, template, place, realisations)) if mesh.shares else (mesh, {})
        meshes.append(more)
        for number in more.shares:
            axis = more.series.axes[number]
            facts[f"{template.series.name or '-'}.{axis.name}"] = len(axis.values)
            if left[axis.name]:
                short.append(_short(template.series.name, mesh, number, left[axis.name]))
    after = stage.after(tuple(meshes))
    return after, Event("refined", facts, "; ".join(short) if after is None else "")


def _short(series: str, mesh: Mesh, number: int, count: int) -> str:
    """Return a sentence that says why interpolation along an adaptive axis misses the tolerance in some cases."""
    axis, values = mesh.series.axes[number], mesh.used(number).sum(axis=-1)
    others, most = values.size, mesh.refinement(number).at_most
    why = (
        f"at_most is {most} values" if (values >= most).any() else "the output jumps or bends within 1/1000 of the axis"
    )
    where = f"{series}: " if series else ""
    return f"{where}interpolation along {axis.name} misses its tolerance in {count} of {others} cases: {why}"


def _means(
    url: str, mesh: Mesh, template: Template, place: Mapping[str, IntArray], realisations: int
) -> dict[str, Means]:
    """Return the means over realisations of every output that has a tolerance for interpolation."""
    dims, own, name = template.dims[:-1], list(mesh.series.sizes), template.series.name
    cases = np.ix_(*(place[dim] for dim in dims), np.arange(realisations))
    order = [*(dims.index(dim) for dim in own), len(dims)]
    companions = models.load(template.campaign.model).companions
    done = (store.ledger(url, name, template.shape)[cases] == Status.DONE).transpose(order)
    found = {}
    for output in sorted({output for number in mesh.shares for output in mesh.refinement(number).until}):
        values = store.values(url, name, output)[cases].transpose(order)
        known = output in companions and companions[output].name in template.campaign.outputs
        error = store.values(url, name, companions[output].name)[cases].transpose(order) if known else None
        found[output] = Means.of(values, done, error)
    return found
