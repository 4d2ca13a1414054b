"""Choose the values of an adaptive axis, stage after stage, until interpolation meets every tolerance.

Every new value lies halfway between two neighbouring values on the scale of the axis. Cases that differ in other
parameters therefore share values of the axis. The ends of the axis have level 0, the middle has level 1, the quarters
have level 2, and so on. An interval is tested as follows. Let n be the higher level of its two ends. The output in the
interval is predicted from the results at all values with a level below n. The interval is halved if this prediction
differs from the interpolation of all results by more than the tolerance.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import BoolArray, FloatArray, IntArray
from mdr_dask.bootstrap import CONFIDENCE, GROUPS
from mdr_dask.campaign import Campaign, Refinement, Series, Tolerance

#: Least width of an interval, as a fraction of the axis. This width limits the number of values at a discontinuity.
FINEST = 2.0**-10
#: Intervals with results at both ends are always halved until one end has at least this level. Level 1 is the middle of
#: the axis, level 2 the quarters, and level 3 the eighths. The quarters are predicted from only three values, perhaps
#: correctly by chance.
TESTED = 3
#: Positions in an interval at which predictions are compared with the interpolation through all values: distances from
#: the end with the higher level, as fractions of the length of the interval. Chosen by trial.
COMPARED = (0.0, 0.25, 0.5, 0.75)


class Means(NamedTuple):
    """Means of an output over realisations, and the data from which the errors of the means are estimated."""

    # Along the first axis: the means over all realisations, then, for each group of realisations, the means without
    # this group. The other axes are the cases. A case without a successful realisation is NaN. If all successful
    # realisations of a case are in one group, the mean over all realisations replaces the mean without this group.
    groups: FloatArray
    # Shape (cases...): discretisation error of the mean of each case, 0 for an unknown error.
    error: FloatArray

    @classmethod
    def of(cls, values: FloatArray, done: BoolArray, error: FloatArray | None) -> Means:
        """Return the means over the realisations (last axis) of the results that the mask `done` selects."""
        number = np.arange(values.shape[-1]) % min(GROUPS, values.shape[-1])
        kept = [done, *(done & (number != group) for group in range(number.max() + 1))]
        mean = _mean(values, done)
        groups = [_mean(values, some) for some in kept]
        known = np.stack([np.where(np.isfinite(group), group, mean) for group in groups])
        size = np.zeros(mean.shape) if error is None else _mean(np.abs(error), done & np.isfinite(error))
        return cls(known, np.nan_to_num(size, nan=0.0))

    def lines(self, cases: tuple[NDArray[np.intp], ...], number: int) -> Means:
        """Return the means of some cases as a table, in which each row is a line along the axis with index `number`.

        `cases` is an index of the cases, made by `numpy.ix_`.
        """
        groups = np.moveaxis(np.stack([group[cases] for group in self.groups]), number + 1, -1)
        error = np.moveaxis(self.error[cases], number, -1)
        length = error.shape[-1]
        return Means(groups.reshape(len(groups), -1, length), error.reshape(-1, length))


def _mean(values: FloatArray, some: BoolArray) -> FloatArray:
    count = some.sum(axis=-1)
    total: FloatArray = np.where(some, values, 0.0).sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


@dataclass(frozen=True)
class Mesh:
    """The cases of a series in one stage: the values of every axis, and which combinations of values are needed."""

    # The series, with the values of adaptive axes in the order in which they were added.
    series: Series
    # For each adaptive axis (key: its index in the series), the positions of its values, from 0 to 1.
    shares: Mapping[int, FloatArray]
    # Mask of the needed cases. The dimensions are the axes of the series. For each combination of values of the
    # non-adaptive axes, some values of every adaptive axis are needed, and all combinations of these values.
    cases: BoolArray

    @classmethod
    def first(cls, series: Series) -> Mesh:
        """Return the mesh of the first stage: all initial values of all axes are needed."""
        shares = {k: np.linspace(0, 1, len(axis.values)) for k, axis in enumerate(series.axes) if axis.refinement}
        return cls(series, shares, np.ones(tuple(series.sizes.values()), dtype=bool))

    def refinement(self, number: int) -> Refinement:
        """Return the refinement of the adaptive axis with index `number`."""
        found = self.series.axes[number].refinement
        assert found
        return found

    def along(self, number: int, cases: BoolArray) -> BoolArray:
        """Return a view of `cases` with the dimensions (non-adaptive axes..., axis `number`, other adaptive axes)."""
        others = [k for k in range(cases.ndim) if k not in self.shares]
        return np.moveaxis(cases, [*others, number], range(len(others) + 1))

    def used(self, number: int) -> BoolArray:
        """Return a mask of the needed values of an adaptive axis, shape (non-adaptive axes..., values)."""
        lines = self.along(number, self.cases)
        return np.asarray(lines.any(axis=-1) if len(self.shares) > 1 else lines)


@dataclass(frozen=True)
class Stage:
    """One step of an adaptive campaign: the campaign with the values that its adaptive axes have in this step."""

    campaign: Campaign
    meshes: tuple[Mesh, ...]
    # For each series, a mask of the cases that no earlier stage had.
    new: tuple[BoolArray, ...]

    @classmethod
    def first(cls, campaign: Campaign) -> Stage:
        """Return the first stage of a campaign."""
        meshes = tuple(Mesh.first(series) for series in campaign.series)
        return cls(campaign, meshes, tuple(mesh.cases for mesh in meshes))

    @property
    def is_adaptive(self) -> bool:
        """Whether a series has an adaptive axis."""
        return any(mesh.shares for mesh in self.meshes)

    def after(self, meshes: tuple[Mesh, ...]) -> Stage | None:
        """Return the next stage, which has the given meshes, or None if these meshes contain no new case."""
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
class _Interval:
    """An interval of an adaptive axis whose interpolation error exceeds the tolerance or was not tested.

    `case` is the index of the combination of non-adaptive values. The middle (`share`) and the width are fractions of
    the axis. `excess` is the interpolation error divided by the tolerance, or 1 if this ratio is below 1.
    """

    case: tuple[int, ...]
    share: float
    width: float
    excess: float


def refined(mesh: Mesh, means: Mapping[str, Means]) -> tuple[Mesh, dict[str, int]]:
    """Halve the intervals in which no test has yet shown that interpolation meets the tolerances; return the new mesh.

    These are the intervals from `_intervals`. An interval is not halved if its width is `FINEST`, or if its combination
    of non-adaptive values already needs the largest allowed number of values. `means` contains the means of each output
    that has a tolerance. Also return, for each adaptive axis, for how many combinations of non-adaptive values there
    are intervals from `_intervals`, but none is halved.
    """
    found, short = mesh, {}
    for number in mesh.shares:
        axis = mesh.series.axes[number]
        intervals = list(_intervals(mesh, number, means))
        wide = [interval for interval in intervals if interval.width > FINEST]
        chosen = _chosen(mesh.used(number), wide, mesh.refinement(number).at_most)
        found = _halved(found, number, chosen)
        left = {interval.case for interval in intervals} - {interval.case for interval in chosen}
        short[axis.name] = len(left)
    return found, short


def _chosen(used: BoolArray, intervals: list[_Interval], at_most: int) -> list[_Interval]:
    """Return the intervals to halve.

    For each combination of non-adaptive values, the adaptive axis then has at most `at_most` values, unless it already
    had more.
    The widest intervals are chosen first, so that one discontinuity does not use up all values.
    """
    ordered = sorted(intervals, key=lambda interval: (-interval.width, -interval.excess, interval.share))
    count = np.array(used.sum(axis=-1))
    chosen = []
    for interval in ordered:
        if count[interval.case] < at_most:
            count[interval.case] += 1
            chosen.append(interval)
    return chosen


def _halved(mesh: Mesh, number: int, intervals: list[_Interval]) -> Mesh:
    """Return the mesh with a new value in the middle of each of the given intervals."""
    axis, shares = mesh.series.axes[number], mesh.shares[number]
    new = sorted({interval.share for interval in intervals} - set(shares.tolist()))
    shares = np.array([*shares, *new])
    cases = np.pad(mesh.cases, [(0, len(new) if k == number else 0) for k in range(mesh.cases.ndim)])
    lines = mesh.along(number, cases)
    position = {share: k for k, share in enumerate(shares.tolist())}
    for interval in intervals:
        line = lines[interval.case]
        line[position[interval.share]] = line.any(axis=0)
    values = (*axis.values, *mesh.refinement(number).spread.at(np.array(new)))
    axes = tuple(replace(axis, values=values) if k == number else one for k, one in enumerate(mesh.series.axes))
    return Mesh(replace(mesh.series, axes=axes), {**mesh.shares, number: shares}, cases)


def _intervals(mesh: Mesh, number: int, means: Mapping[str, Means]) -> Iterator[_Interval]:
    """Yield the untested intervals of an adaptive axis, and those in which interpolation misses a tolerance.

    An interval is left out if every row has a failed case at an end (see `_excess`), or if the axis has whole numbers
    and none lies between the ends.
    """
    refinement = mesh.refinement(number)
    masks = {k: mesh.used(k) for k in mesh.shares}
    for case in np.ndindex(masks[number].shape[:-1]):
        used = {k: np.flatnonzero(mask[case]) for k, mask in masks.items()}
        order = used[number][np.argsort(mesh.shares[number][used[number]])]
        used[number] = order
        left = iter(case)
        cases = np.ix_(*(used[k] if k in used else [next(left)] for k in range(len(mesh.series.axes))))
        shares = mesh.shares[number][order]
        levels = np.array([Fraction(share).denominator.bit_length() - 1 for share in shares.tolist()])
        places = refinement.spread.shares(refinement.spread.at(shares)) if refinement.spread.whole else shares
        excess = np.full(shares.size - 1, -np.inf)
        for name, tolerance in refinement.until.items():
            excess = np.maximum(excess, _excess(places, levels, means[name].lines(cases, number), tolerance))
        middles = (shares[:-1] + shares[1:]) / 2
        ends = refinement.spread.at(shares)
        for k, middle in enumerate(middles.tolist()):
            if refinement.spread.whole and refinement.spread.at(np.array([middle]))[0] in (ends[k], ends[k + 1]):
                continue  # no whole number lies between the ends
            is_untested = max(levels[k], levels[k + 1]) < TESTED and not np.isneginf(excess[k])
            if is_untested or excess[k] > 1.0:
                yield _Interval(case, middle, float(shares[k + 1] - shares[k]), float(max(excess[k], 1.0)))


def _excess(places: FloatArray, levels: IntArray, lines: Means, tolerance: Tolerance) -> FloatArray:
    """Return, for each interval, the largest ratio of interpolation error to tolerance over all rows of `lines`.

    If every row has a failed case at one or both ends of the interval, the result is minus infinity.
    """
    worst = np.full(places.size - 1, -np.inf)
    known = np.isfinite(lines.groups[0])
    for pattern in np.unique(known, axis=0):
        rows, columns = np.flatnonzero((known == pattern).all(axis=1)), np.flatnonzero(pattern)
        if columns.size < 2:
            continue
        groups, error = lines.groups[:, rows][..., columns], lines.error[rows][:, columns]
        missed = interpolation_error(places[columns], levels[columns], groups, error)
        allowed = np.maximum(tolerance.absolute, tolerance.relative * np.abs(groups[0]).max(axis=-1, keepdims=True))
        ratio = np.divide(missed, allowed, out=np.zeros_like(missed), where=allowed > 0).max(axis=0)
        whole = np.flatnonzero(np.diff(columns) == 1)
        worst[columns[whole]] = np.maximum(worst[columns[whole]], ratio[whole])
    return worst


def interpolation_error(places: FloatArray, levels: IntArray, groups: FloatArray, error: FloatArray) -> FloatArray:
    """Return the interpolation error of each interval, shape (lines, values - 1).

    Let n be the higher of the levels at the two ends of an interval. The output in the interval is predicted from all
    values at levels below n, once by a monotone cubic and once by a cubic spline. The error is the largest difference
    between the predictions and the monotone cubic through all values, minus an allowance for the scatter of the
    realisations and the discretisation errors. The result may be negative.

    `places` are the ascending positions along the axis. The level of a position is 0 at the ends of the axis, 1 in the
    middle, 2 at the quarters, ... `groups` contains the means described in `Means.groups`, in an array with three axes:
    group, line and value. `error`, shape (lines, values), contains the discretisation errors of the means.
    """
    from scipy.interpolate import CubicSpline, PchipInterpolator
    from scipy.special import ndtri

    last = np.arange(places.size - 1) + (np.diff(levels) > 0)
    ends = places[last], places[:-1] + places[1:] - places[last]
    at = np.stack([(1 - t) * ends[0] + t * ends[1] for t in COMPARED])
    now = PchipInterpolator(places, groups, axis=-1)(at)
    missed = np.zeros((2, *now.shape))
    for level in range(1, int(levels.max()) + 1):
        here, before = levels[last] == level, levels < level
        if here.any() and before.sum() >= 2:
            for kind, interpolate in enumerate((PchipInterpolator, CubicSpline)):
                predicted = interpolate(places[before], groups[..., before], axis=-1)(at[:, here])
                missed[kind][..., here] = predicted - now[..., here]
    count = max(len(groups) - 1, 1)
    around = missed[:, 1:] - missed[:, :1]
    scatter = np.sqrt((count - 1) / count * (around**2).sum(axis=1))  # jackknife; zero for one realisation
    # at one position, the probability that scatter alone exceeds the allowance for any output is at most 1 - CONFIDENCE
    widely = ndtri(1 - (1 - CONFIDENCE) / (2 * groups.shape[1]))
    largest = (np.abs(missed[:, 0]) - widely * scatter).max(axis=(0, 2))
    return np.asarray(largest - error[:, last])
