"""Which values an axis needs that a study refines itself: whole rounds, until interpolation meets every tolerance.

Interpolation is by monotone cubics on the natural scale of the axis. Its error in a space between two values is seen in
two ways: by how much it differs from a cubic spline, and by how much it misses the values at the ends of the space when
it is made without them. Where that is more than the tolerance, the space is halved. All values lie on one lattice, each
halfway between two others, so that the cases beside each other need the same ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.campaign import Campaign, Refinement, Series, Tolerance

#: Groups of realisations that are left out one after the other, to know the scatter of what is interpolated.
GROUPS = 20
#: Probability that scatter alone is chased in a space, if it hides all else.
CHASED = 0.05
#: Places within each space between two values where interpolations are compared.
INSIDE = np.array([0.25, 0.5, 0.75])
#: Order at which a value that is left out is missed less in a smaller space; benchmarks in docs/adaptive.md.
ORDER = 2.5
#: Spaces wait for those of the same case, as wide or wider, that are so many times as bad.
WORSE = 3.0
#: Least part of an interval that a space is halved to: what jumps or bends there stays as it is.
FINEST = 2.0**-10
#: Fewest values that are interpolated.
FEWEST = 3
#: Spaces beside the top on each side that are no wider than the narrowest of them, or than this part of the interval.
BESIDE, NARROW = 2, 2.0**-4


@dataclass(frozen=True)
class Mean:
    """Means of an output over realisations, and what is known of their errors.

    Parameters
    ----------
    groups : array, shape (1 + groups, cases...)
        The mean, and behind it the means without one group of realisations each; NaN where a case has no value.
    error : array, shape (cases...)
        Discretisation error; 0 where none is known.
    """

    groups: FloatArray
    error: FloatArray

    @classmethod
    def of(cls, values: FloatArray, done: BoolArray, error: FloatArray | None) -> Mean:
        """Take means of results along the last axis, realisations, of which some are done."""
        number = np.arange(values.shape[-1]) % min(GROUPS, values.shape[-1])
        kept = [done, *(done & (number != group) for group in range(number.max() + 1))]
        mean = _mean(values, done)
        groups = [_mean(values, some) for some in kept]
        known = np.stack([np.where(np.isfinite(group), group, mean) for group in groups])
        size = np.zeros(mean.shape) if error is None else _mean(np.abs(error), done & np.isfinite(error))
        return cls(known, np.nan_to_num(size, nan=0.0))

    def at(self, place: tuple[NDArray[np.intp], ...]) -> Mean:
        """Return a part of the cases, as `numpy.ix_` chooses it."""
        return Mean(np.stack([group[place] for group in self.groups]), self.error[place])


def _mean(values: FloatArray, some: BoolArray) -> FloatArray:
    count = some.sum(axis=-1)
    total: FloatArray = np.where(some, values, 0.0).sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


@dataclass(frozen=True)
class Mesh:
    """The cases of a series: every axis with the values that it has so far, and which of them are needed.

    Parameters
    ----------
    series : Series
        With the values of adaptive axes in the order in which they arrived.
    shares : mapping of int to array, shape (values,)
        For each adaptive axis, by its number, where its values lie in its interval.
    used : mapping of int to bool array, shape (values of the other axes that are not adaptive..., values)
        Which of them each other case needs.
    """

    series: Series
    shares: Mapping[int, FloatArray]
    used: Mapping[int, BoolArray]

    @classmethod
    def first(cls, series: Series) -> Mesh:
        """Return a series as it begins: all values of all axes."""
        adaptive = [k for k, axis in enumerate(series.axes) if axis.refinement]
        others = [len(axis.values) for axis in series.axes if not axis.refinement]
        sizes = {k: len(series.axes[k].values) for k in adaptive}
        shares = {k: np.linspace(0.0, 1.0, size) for k, size in sizes.items()}
        return cls(series, shares, {k: np.ones((*others, size), dtype=bool) for k, size in sizes.items()})

    def refinement(self, number: int) -> Refinement:
        """Return how an adaptive axis is refined, by its number."""
        found = self.series.axes[number].refinement
        assert found
        return found

    @property
    def cases(self) -> BoolArray:
        """Which cases are needed, shape of the series."""
        dims = len(self.series.sizes)
        others = [k for k in range(dims) if k not in self.used]
        each = (
            np.moveaxis(used.reshape(*used.shape, *(1,) * (dims - used.ndim)), range(used.ndim), [*others, k])
            for k, used in self.used.items()
        )
        return reduce(np.logical_and, each, np.ones(tuple(self.series.sizes.values()), dtype=bool))


@dataclass(frozen=True)
class Stage:
    """A campaign with the values that its adaptive axes have so far.

    Parameters
    ----------
    campaign : Campaign
        With these values.
    meshes : tuple of Mesh
        The cases of each series.
    new : tuple of bool array
        Those of them that no stage before had.
    """

    campaign: Campaign
    meshes: tuple[Mesh, ...]
    new: tuple[BoolArray, ...]

    @classmethod
    def first(cls, campaign: Campaign) -> Stage:
        """Return a campaign as it begins."""
        meshes = tuple(Mesh.first(series) for series in campaign.series)
        return cls(campaign, meshes, tuple(mesh.cases for mesh in meshes))

    @property
    def is_adaptive(self) -> bool:
        """Whether the study may choose more values."""
        return any(mesh.used for mesh in self.meshes)

    def after(self, meshes: tuple[Mesh, ...]) -> Stage | None:
        """Return the next stage, None where there is nothing new."""
        new = tuple(_beyond(mesh.cases, before.cases) for mesh, before in zip(meshes, self.meshes, strict=True))
        if not any(cases.any() for cases in new):
            return None
        campaign = replace(self.campaign, series=tuple(mesh.series for mesh in meshes))
        return Stage(campaign, meshes, new)


def _beyond(cases: BoolArray, before: BoolArray) -> BoolArray:
    new = cases.copy()
    new[tuple(map(slice, before.shape))] &= ~before
    return new


@dataclass(frozen=True)
class _Space:
    """A space between two values that misses its tolerance, of one of the cases of the other axes."""

    case: tuple[int, ...]
    share: float
    width: float
    excess: float


def refined(mesh: Mesh, means: Mapping[str, Mean]) -> tuple[Mesh, dict[str, int]]:
    """Add values where interpolation is worst.

    Parameters
    ----------
    mesh : Mesh
        A series, all of whose cases are computed.
    means : mapping of str to Mean, over the cases of the series
        Each output that an adaptive axis has a tolerance for.

    Returns
    -------
    Mesh
        With more values; the same where none is wanted, or allowed.
    dict of str to int
        For each adaptive axis, the number of cases of the other axes that miss a tolerance and cannot be refined.
    """
    found, short = mesh, {}
    for number in mesh.used:
        axis = mesh.series.axes[number]
        spaces = list(_spaces(mesh, number, means))
        wide = [space for space in spaces if space.width > FINEST and _is_new(mesh, number, space)]
        chosen = _chosen(mesh.shares[number], wide, mesh.refinement(number).at_most)
        found = _halved(found, number, [space for space in wide if space.share in chosen])
        left = {space.case for space in spaces} - {space.case for space in wide if space.share in chosen}
        short[axis.name] = len(left)
    return found, short


def _is_new(mesh: Mesh, number: int, space: _Space) -> bool:
    """Say whether there is a value within a space: not between two whole numbers that follow each other."""
    spread = mesh.refinement(number).spread
    if not spread.whole:
        return True
    used = mesh.used[number][space.case]
    values = mesh.series.axes[number].values
    return spread.at(np.array([space.share]))[0] not in {values[k] for k in np.flatnonzero(used)}


def _chosen(shares: FloatArray, spaces: list[_Space], at_most: int) -> set[float]:
    """Return the places that an axis may have: new ones in the widest spaces first: no jump starves the rest."""
    known = set(shares.tolist())
    ordered = sorted(spaces, key=lambda space: (-space.width, -space.excess, space.share))
    new = dict.fromkeys(space.share for space in ordered if space.share not in known)
    room = max(at_most - len(known), 0)
    return known | set(list(new)[:room])


def _halved(mesh: Mesh, number: int, spaces: list[_Space]) -> Mesh:
    """Return a mesh with a value in the middle of some spaces."""
    axis, shares, used = mesh.series.axes[number], mesh.shares[number], mesh.used[number]
    new = sorted({space.share for space in spaces} - set(shares.tolist()))
    shares = np.array([*shares, *new])
    used = np.concatenate([used, np.zeros((*used.shape[:-1], len(new)), dtype=bool)], axis=-1)
    position = {share: k for k, share in enumerate(shares.tolist())}
    for space in spaces:
        used[(*space.case, position[space.share])] = True
    values = (*axis.values, *mesh.refinement(number).spread.at(np.array(new)))
    axes = tuple(replace(axis, values=values) if k == number else one for k, one in enumerate(mesh.series.axes))
    return Mesh(replace(mesh.series, axes=axes), {**mesh.shares, number: shares}, {**mesh.used, number: used})


def _spaces(mesh: Mesh, number: int, means: Mapping[str, Mean]) -> Iterator[_Space]:
    """Yield the spaces of an adaptive axis that miss a tolerance."""
    refinement = mesh.refinement(number)
    for case in np.ndindex(mesh.used[number].shape[:-1]):
        used = {k: np.flatnonzero(mask[case]) for k, mask in mesh.used.items()}
        order = used[number][np.argsort(mesh.shares[number][used[number]])]
        used[number] = order
        left = iter(case)
        place = np.ix_(*(used[k] if k in used else [next(left)] for k in range(len(mesh.series.axes))))
        shares = mesh.shares[number][order]
        excess = np.zeros(shares.size - 1)
        for name, tolerance in refinement.until.items():
            lines = means[name].at(place)
            missed = _missed(_places(refinement, shares), _lines(lines, number), tolerance)
            excess = np.maximum(excess, missed)
        if excess.max(initial=0.0) <= 1.0:
            tops = (_beside_tops(shares, _lines(means[name].at(place), number)) for name in refinement.until)
            excess = 2.0 * np.logical_or.reduce(list(tops))
        width = np.diff(shares)
        for k in np.flatnonzero(excess > 1.0):
            if not np.any((width >= width[k]) & (width > FINEST) & (excess > WORSE * excess[k])):
                yield _Space(case, float(shares[k] + shares[k + 1]) / 2, float(width[k]), float(excess[k]))


def _beside_tops(shares: FloatArray, lines: Mean) -> BoolArray:
    """Return which spaces are halved for the sake of where the largest value lies, once interpolation is good enough.

    It is known as well as the widest space beside it allows. A top at an end of the axis lies beyond it.
    """
    width = np.diff(shares)
    wide = np.zeros(width.size, dtype=bool)
    for line in np.nan_to_num(lines.groups[0], nan=-np.inf):
        top = int(np.argmax(line))
        if 0 < top < line.size - 1:
            near = np.arange(max(top - BESIDE, 0), min(top + BESIDE, width.size))
            wide[near] |= width[near] > max(width[near].min(), NARROW)
    return wide


def _places(refinement: Refinement, shares: FloatArray) -> FloatArray:
    """Return where values lie on the scale on which they are interpolated: whole numbers beside their shares."""
    spread = refinement.spread
    return spread.shares(spread.at(shares)) if spread.whole else shares


def _lines(mean: Mean, number: int) -> Mean:
    """Return the lines along an axis, one behind the other."""
    groups = np.moveaxis(mean.groups, number + 1, -1)
    error = np.moveaxis(mean.error, number, -1)
    rows = math.prod(error.shape[:-1])
    return Mean(groups.reshape(len(groups), rows, -1), error.reshape(rows, -1))


def _missed(places: FloatArray, lines: Mean, tolerance: Tolerance) -> FloatArray:
    """Return the error of interpolation in each space over the tolerance, scatter and grid taken out: the worst line.

    Values that are not known are left out of their line, and the spaces beside them are known to miss nothing.
    """
    worst = np.zeros(places.size - 1)
    known = np.isfinite(lines.groups[0])
    for pattern in np.unique(known, axis=0):
        if pattern.sum() < FEWEST:
            continue
        rows = np.flatnonzero((known == pattern).all(axis=1))
        columns = np.flatnonzero(pattern)
        whole = np.flatnonzero(np.diff(columns) == 1)
        found = departure(places[columns], lines.groups[:, rows][..., columns], lines.error[rows][:, columns])
        size = np.abs(lines.groups[0, rows][:, columns]).max(axis=-1, keepdims=True)
        allowed = np.maximum(tolerance.absolute, tolerance.relative * size)
        ratio = np.divide(found, allowed, out=np.zeros_like(found), where=allowed > 0).max(axis=0)
        worst[columns[whole]] = np.maximum(worst[columns[whole]], ratio[whole])
    return worst


def departure(places: FloatArray, groups: FloatArray, error: FloatArray) -> FloatArray:
    """Return by how much interpolation may err in each space, less what scatter and grid explain.

    Parameters
    ----------
    places : array, shape (values,)
        Ascending.
    groups : array, shape (1 + groups, lines, values)
        As `Mean` has them.
    error : array, shape (lines, values)
        Discretisation errors.

    Returns
    -------
    array, shape (lines, values - 1)
        The largest of both ways to see it.
    """
    from scipy.special import ndtri

    seen = np.concatenate([_beside_spline(places, groups), _left_out(places, groups)], axis=-2)
    count = max(len(groups) - 1, 1)
    around = seen[1:] - seen[0]
    scatter = np.sqrt((count - 1) / count * (around**2).sum(axis=0))  # jackknife; none for one realisation
    widely = ndtri(1 - CHASED / (2 * groups.shape[1]))
    found: FloatArray = (np.abs(seen[0]) - widely * scatter).max(axis=-2)
    return found - np.maximum(error[:, 1:], error[:, :-1])


def _beside_spline(places: FloatArray, groups: FloatArray) -> FloatArray:
    """Return how a monotone cubic differs from a cubic spline in each space, shape (..., places inside, spaces)."""
    from scipy.interpolate import CubicSpline, PchipInterpolator

    inside = (places[:-1] + INSIDE[:, None] * np.diff(places)).ravel()
    spline = CubicSpline(places, groups, axis=-1, bc_type="natural")
    apart = np.asarray(spline(inside) - PchipInterpolator(places, groups, axis=-1)(inside))
    return apart.reshape(*groups.shape[:-1], INSIDE.size, -1)


def _left_out(places: FloatArray, groups: FloatArray) -> FloatArray:
    """Return how values are missed that are left out, scaled to the spaces on both sides, shape (..., 2, spaces)."""
    from scipy.interpolate import PchipInterpolator

    width = np.diff(places)
    found = np.zeros((*groups.shape[:-1], 2, width.size))
    for k in range(1, places.size - 1):
        kept = np.delete(np.arange(places.size), k)
        missed = PchipInterpolator(places[kept], groups[..., kept], axis=-1)(places[k]) - groups[..., k]
        both = width[k - 1] + width[k]
        found[..., 0, k - 1] = missed * (width[k - 1] / both) ** ORDER
        found[..., 1, k] = missed * (width[k] / both) ** ORDER
    return found
