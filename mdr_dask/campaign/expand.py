"""Expand the parameters of a campaign into series with axes, and check every value with the model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Any

import numpy as np
from pydantic import ValidationError

from mdr_dask.campaign import fields, sampling, variation
from mdr_dask.campaign.definition import SAME_DIGITS, Axis, Series
from mdr_dask.campaign.document import Document
from mdr_dask.campaign.messages import report_errors, value_at
from mdr_dask.campaign.problems import Path, Place, dotted
from mdr_dask.campaign.spec import CampaignSpec, Drawn, TableSpec
from mdr_dask.campaign.tolerances import refinement
from mdr_dask.campaign.variation import Origin, Variation
from mdr_dask.campaign.written import questions
from mdr_dask.models.base import Model, Parameters, with_value
from mdr_dask.units import to_si

#: Largest number of adaptive axes. With three adaptive axes, a study would need about as many cases as a full grid.
MOST_ADAPTIVE = 2


def expand(
    document: Document,
    model: Model[Any],
    spec: CampaignSpec,
    directory: str,
    outputs: Sequence[str],
) -> tuple[tuple[Series, ...], tuple[str, ...]]:
    """Return all series that have no problem, and remarks for the user. Add the problems of the others to `document`.

    Names of files are relative to `directory`.
    """
    found = []
    asked: dict[str, None] = {}
    for name in spec.series or {"": {}}:
        paths: dict[str, Path] = {key: ("parameters", key) for key in spec.parameters}
        if spec.series:
            paths |= {key: ("series", name, key) for key in spec.series[name]}
        data = {key: value_at(document.data, path) for key, path in paths.items()}
        expansion = _Expansion(document, model.parameters, spec, directory, paths, data)
        series = expansion.series(name, model, outputs)
        if series is not None:
            found.append(series)
        units = model.units(series.parameters) if series else {}
        asked |= dict.fromkeys(expansion.remarks)
        asked |= dict.fromkeys(questions(document, model.parameters, data, paths, units))
    return tuple(found), tuple(asked)


@dataclass(frozen=True)
class _Expansion:
    document: Document
    parameters: type[Parameters]
    spec: CampaignSpec
    directory: str
    paths: Mapping[str, Path]
    data: dict[str, Any]
    remarks: list[str] = field(default_factory=list)

    def series(self, name: str, model: Model[Any], outputs: Sequence[str]) -> Series | None:
        """Return one series, or None if it has a problem."""
        variations = self._variations()
        if variations is None:
            return None
        broken: set[Path] = {found.path for found in variations if not found.items}
        variations = tuple(found for found in variations if found.items)
        base = self._validate(self.data, variations, 0, broken)
        if self.spec.sampling == "grid":
            columns = [self._grid_values(base, variations, index, broken) for index in range(len(variations))]
        else:
            columns = self._case_values(base, variations, broken)
        if base is None or broken or None in columns:
            return None
        pairs = zip(variations, columns, strict=True)
        axes = [self._axis(one, column) for one, column in pairs if column is not None]
        for axis, one in zip(axes, variations, strict=True):
            self._require_places(base, axis, one.origin, model, outputs)
        return Series(name, base, tuple(self._refined(axes, variations, model, outputs)))

    def _require_places(
        self, base: Parameters, axis: Axis, origin: Origin, model: Model[Any], outputs: Sequence[str]
    ) -> None:
        """Report a problem if the coordinates of an output are not the same for all values of an axis."""
        wanted = [model.output(name) for name in outputs]
        if not any(output.dims for output in wanted):
            return
        first, *others = (model.coordinates(with_value(base, axis.path, value)) for value in axis.some)
        for output in wanted:
            for dim in first.keys() & set(output.dims):
                if any(not np.array_equal(first[dim].values, other[dim].values) for other in others):
                    what = (
                        f"expected one value, because the values of the axis {dim!r} of the output {output.name!r} "
                        "depend on this parameter"
                    )
                    self._complain(origin, f"{what} (write a series for each value)")
                    return

    def _variations(self) -> tuple[Variation, ...] | None:
        design = self.spec.sampling
        drawn = isinstance(design, Drawn)
        found = variation.find(self.document, self.parameters, self.data, self.paths, drawn)
        origin = Origin("sampling", self.document.place(("sampling",)))
        if isinstance(design, TableSpec):
            for one in found:
                self._complain(
                    one.origin,
                    f"expected one value, because only the columns of the table vary (add a column to {design.table})",
                )
            return found or sampling.tabled(
                design.table, self.directory, origin, self.parameters, self.data, self.document.problems, self.remarks
            )
        if drawn and not found:
            self._complain(origin, "expected at least one parameter with a range to draw from, got none")
        if isinstance(design, Drawn) and found and all(one.spread for one in found):
            return sampling.drawn(design, self.spec.seed, found)
        if design == "zip":
            self._check_lengths(found)
        self._check_adaptive(found)
        return found

    def _check_adaptive(self, found: Sequence[Variation]) -> None:
        adaptive = [one for one in found if one.written]
        for one in adaptive:
            if self.spec.sampling != "grid":
                self._complain(one.origin, "expected 'sampling: grid', because this axis is adaptive")
        for one in adaptive[MOST_ADAPTIVE:]:
            self._complain(one.origin, f"expected at most {MOST_ADAPTIVE} adaptive axes, got {len(adaptive)}")

    def _check_lengths(self, found: Sequence[Variation]) -> None:
        sized = [one for one in found if one.items]
        for one in sized[1:]:
            if len(one.items) != len(sized[0].items):
                what = (
                    f"expected {len(sized[0].items)} values, as many as {'.'.join(sized[0].path)!r} has, got "
                    f"{len(one.items)}"
                )
                self._complain(
                    one.origin,
                    f"{what} ('sampling: grid' combines all values of one parameter with all values of the others)",
                )

    def _grid_values(
        self, base: Parameters | None, variations: Sequence[Variation], index: int, broken: set[Path]
    ) -> list[Any] | None:
        """Return the values of one axis, or None if a value is wrong.

        Values are checked together with the first values of the other axes.
        """
        one = variations[index]
        known = _checked(base, self._substituted(self.data, variations, 0), {one.path[0]})
        # the problems of another axis are reported when the values of that axis are checked
        elsewhere = broken | {other.path for other in variations if other is not one}
        last = self._validate(known, [one], len(one.items) - 1, elsewhere)
        independent = fields.is_independent(self.parameters, one.path, self.data)
        values: list[Any] = []
        seen, are_valid = set(), None not in (base, last)
        for position, item in enumerate(one.items):
            # if the field is checked by its bounds alone, every value between the valid ends of a range is valid
            if item.inner and (not are_valid or independent):
                values.append(item.value)
                continue
            checked = base if position == 0 else self._validate(known, [one], position, elsewhere)
            if checked is None:
                are_valid = False
                continue
            value = _get(checked, one.path)
            values.append(value)
            key: Any = value if isinstance(value, int | tuple) else item.label
            if isinstance(value, float):
                key = float(f"{value:.{SAME_DIGITS}g}")
            if key in seen:
                self._complain(item.origin, f"this value is given twice: {item.label}")
            seen.add(key)
        return values if are_valid else None

    def _case_values(
        self, base: Parameters | None, variations: Sequence[Variation], broken: set[Path]
    ) -> list[list[Any] | None]:
        """Return, for each varied parameter, its checked values in all cases, or ``[None]`` if a value is wrong."""
        known = _checked(base, self.data, {one.path[0] for one in variations})
        are_independent = all(fields.is_independent(self.parameters, one.path, self.data) for one in variations)
        cases = list(zip(*(one.items for one in variations), strict=False))
        rows: list[list[Any]] = []
        for position, items in enumerate(cases):
            if are_independent and all(item.inner for item in items):
                rows.append([item.value for item in items])
            elif checked := self._validate(known, variations, position, broken):
                rows.append([_get(checked, one.path) for one in variations])
        return [list(column) for column in zip(*rows, strict=True)] if len(rows) == len(cases) else [None]

    def _validate(
        self, data: Mapping[str, Any], variations: Sequence[Variation], position: int, broken: set[Path]
    ) -> Parameters | None:
        tree = self._substituted(data, variations, position)
        try:
            return self.parameters.model_validate(tree, context={"to_si": to_si, "directory": self.directory})
        except ValidationError as error:
            origins: dict[Path, Origin] = {one.path: one.items[position].origin for one in variations}

            def report(path: Path, what: str, key: bool) -> None:
                if not any(path[: len(start)] == start for start in broken):
                    place, name = self._locate(path, key, origins)
                    self.document.problems.add(place, name, what)

            report_errors(error, self.parameters, tree, report)
        return None

    def _substituted(self, data: Mapping[str, Any], variations: Sequence[Variation], position: int) -> dict[str, Any]:
        tree = dict(data)
        for one in variations:
            tree = _replaced(tree, one.path, one.items[position].value)
        return tree

    def _locate(self, path: Path, key: bool, origins: Mapping[Path, Origin]) -> tuple[Place, str]:
        for size in range(len(path), 0, -1):
            start, rest = path[:size], path[size:]
            if start in origins:
                origin = origins[start]
                if origin.path is None:
                    return origin.place, origin.name
                return self._at((*origin.path, *rest), key), dotted((origin.name, *rest))
        if path and path[0] in self.paths:
            full = (*self.paths[str(path[0])], *path[1:])
            return self._at(full, key), dotted(full)
        return self.document.key_place(("parameters",)), dotted(("parameters", *path))

    def _at(self, path: Path, key: bool) -> Place:
        return self.document.key_place(path) if key else self.document.place(path)

    def _axis(self, one: Variation, column: list[Any]) -> Axis:
        info = fields.field_at(self.parameters, one.path, self.data)
        name = "_".join(one.path)
        numeric = all(isinstance(value, int | float) and not isinstance(value, bool) for value in column)
        return Axis(
            path=".".join(one.path),
            name=name,
            dim=name if self.spec.sampling == "grid" else "case",
            values=tuple(column),
            labels=None if numeric else tuple(item.label for item in one.items),
            unit=(fields.unit_at(self.parameters, one.path, self.data) or "1") if numeric else None,
            long_name=(info and info.description) or name,
        )

    def _refined(
        self, axes: Sequence[Axis], variations: Sequence[Variation], model: Model[Any], outputs: Sequence[str]
    ) -> Iterator[Axis]:
        for axis, one in zip(axes, variations, strict=True):
            if one.written and one.spread:
                found = refinement(self.document, one.written, one.spread, model, outputs)
                yield replace(axis, refinement=found)
            else:
                yield axis

    def _complain(self, origin: Origin, what: str) -> None:
        self.document.problems.add(origin.place, origin.name, what)


def _checked(base: Parameters | None, data: Mapping[str, Any], varied: set[str | int]) -> dict[str, Any]:
    """Return `data`, with the checked values from `base` for all parameters that are not in `varied`.

    If `base` is None, no value is replaced.
    """
    if base is None:
        return dict(data)
    return {name: value if name in varied else getattr(base, name) for name, value in data.items()}


def _replaced(tree: Any, path: Sequence[str], value: Any) -> Any:
    if not path:
        return value
    inner = dict(tree) if isinstance(tree, Mapping) else {}
    return {**inner, path[0]: _replaced(inner.get(path[0]), path[1:], value)}


def _get(parameters: Any, path: Sequence[str]) -> Any:
    return reduce(getattr, path, parameters)
