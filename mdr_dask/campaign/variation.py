"""Find the parameters that vary, and turn their lists and ranges into values in SI units."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, NoReturn

import numpy as np
from pydantic import BaseModel

from mdr_dask.arrays import is_geometric
from mdr_dask.campaign import fields
from mdr_dask.campaign.definition import Spread, tidy
from mdr_dask.campaign.document import LARGEST, Document
from mdr_dask.campaign.problems import Path, Place, dotted, shown
from mdr_dask.units import expected, to_si

RANGES = ("linear", "geometric", "values", "adaptive")
#: Number of values with which an adaptive axis begins: its ends, its middle and its quarter points.
FIRST = 5


@dataclass(frozen=True)
class Origin:
    """The origin of a value: its key, its position in the file, and its path. Values in a table have the path None."""

    name: str
    place: Place
    path: Path | None = None


class Item(NamedTuple):
    """One value of a varied parameter: as written in the file, or in SI if the value was computed from a range.

    `inner` is true for all values of a range except the smallest and the largest value.
    """

    value: Any
    origin: Origin
    written: str = ""
    inner: bool = False

    @property
    def label(self) -> str:
        """The text of the value in the file, or the number as text if the value was computed from a range."""
        return self.written or f"{self.value:g}"


@dataclass(frozen=True)
class Variation:
    """A varied parameter: its path in the parameters, and its values or the interval from which values are drawn.

    An adaptive axis, and a parameter whose values have been drawn, have both values and an interval. `written` is the
    path of an adaptive axis in the document.
    """

    path: tuple[str, ...]
    origin: Origin
    items: tuple[Item, ...] = ()
    spread: Spread | None = None
    written: Path = ()

    def drawn(self, shares: Any) -> Variation:
        """Return this variation with values at the given fractions (0 to 1) of its interval."""
        assert self.spread is not None
        values = self.spread.at(shares)
        ends = values.index(min(values)), values.index(max(values))
        items = (Item(value, self.origin, inner=place not in ends) for place, value in enumerate(values))
        return replace(self, items=tuple(items))


def find(
    document: Document,
    parameters: type[BaseModel],
    data: Mapping[str, Any],
    paths: Mapping[str, Path],
    drawn: bool,
) -> tuple[Variation, ...]:
    """Return the varied parameters, in the order of the data, and report wrong ranges and empty lists.

    `paths` contains the path of each parameter in the document. If `drawn` is true, a range does not state a number of
    values. A parameter whose list or range is wrong is returned without values.
    """
    search = _Search(document, parameters, data, drawn)
    return tuple(found for name, value in data.items() for found in search.below((name,), value, paths[name]))


class _MalformedError(Exception):
    """The signal to stop reading a list or a range that is wrong. The problem is already reported."""


@dataclass(frozen=True)
class _Search:
    document: Document
    parameters: type[BaseModel]
    data: Mapping[str, Any]
    drawn: bool

    def below(self, path: tuple[str, ...], value: Any, at: Path) -> Iterator[Variation]:
        """Yield the variations of one parameter and of the parameters nested in it."""
        info = fields.field_at(self.parameters, path, self.data)
        if info is None:
            return
        if isinstance(value, list) and (not fields.holds_list(info) or any(isinstance(one, list) for one in value)):
            yield self._variation(path, at, lambda: self._listed(value, at, at))
        if not isinstance(value, dict):
            return
        structures = fields.structures(info)
        kinds = [key for key in value if key in RANGES and not any(key in kind.model_fields for kind in structures)]
        if "adaptive" in kinds:
            yield self._adaptive(path, value["adaptive"], at)
        elif kinds and (len(value) == 1 or not structures):
            yield self._variation(path, at, lambda: self._range(path, value, at))
        else:
            for key, inner in value.items():
                yield from self.below((*path, key), inner, (*at, key))

    def _variation(self, path: tuple[str, ...], at: Path, read: Callable[[], Spread | list[Item]]) -> Variation:
        origin = self._origin(at, at)
        try:
            content = read()
        except _MalformedError:
            return Variation(path, origin)
        if isinstance(content, Spread):
            return Variation(path, origin, spread=content)
        return Variation(path, origin, tuple(content))

    def _adaptive(self, path: tuple[str, ...], ends: Any, name: Path) -> Variation:
        """Return an adaptive axis with its first values."""
        origin, at = self._origin(name, name), (*name, "adaptive")
        try:
            if self.drawn:
                self._complain(name, "expected 'sampling: grid', because this axis is adaptive", name)
            if not isinstance(ends, list) or len(ends) != 2:
                self._complain(at, f"expected [first, last], got {shown(ends)}", name)
            linear = self._spread(path, "linear", [*ends, FIRST], at)
            low, high = sorted((linear.low, linear.high))
            spread = replace(linear, geometric=is_geometric((low, high)))
            return Variation(path, origin, tuple(self._items(spread, [*ends, FIRST], at)), spread, name)
        except _MalformedError:
            return Variation(path, origin)

    def _listed(self, values: Any, at: Path, name: Path) -> list[Item]:
        if not isinstance(values, list):
            self._complain(at, f"expected a list of values, got {shown(values)}", name)
        if self.drawn:
            self._complain(
                at,
                "expected one value, {linear: [a, b]} or {geometric: [a, b]}, because this sampling draws "
                "the values, got a list",
                name,
            )
        if not values:
            self._complain(at, "expected at least one value, got []", name)
        places = [(*at, index) for index in range(len(values))]
        return [
            Item(value, self._origin(place, name), self.document.flow(place))
            for value, place in zip(values, places, strict=True)
        ]

    def _range(self, path: tuple[str, ...], value: dict[str, Any], name: Path) -> Spread | list[Item]:
        if len(value) != 1:
            got = ", ".join(map(repr, value)) or "none"
            self._complain(
                name, f"expected exactly one of the keys 'linear', 'geometric' and 'values', got {got}", name
            )
        [(kind, content)] = value.items()
        at = (*name, kind)
        if kind == "values":
            return self._listed(content, at, name)
        spread = self._spread(path, kind, content, at)
        return spread if self.drawn else self._items(spread, content, at)

    def _spread(self, path: tuple[str, ...], kind: str, content: Any, at: Path) -> Spread:
        size, wanted = (2, "[first, last]") if self.drawn else (3, "[first, last, count]")
        if not isinstance(content, list) or len(content) != size:
            hint = " (sampling gives the number of values)" if self.drawn else ""
            self._complain(at, f"expected {wanted}, got {shown(content)}{hint}", at[:-1])
        low, high = (self._end(path, kind, content[index], (*at, index)) for index in range(2))
        if low == high:
            self._complain(at, f"expected two different ends, got {shown(content[0])} and {shown(content[1])}", at[:-1])
        info = fields.field_at(self.parameters, path, self.data)
        kinds = fields.members(info.annotation) if info else ()
        return Spread(low, high, kind == "geometric", whole=int in kinds and float not in kinds)

    def _items(self, spread: Spread, content: list[Any], at: Path) -> list[Item]:
        name, count = at[:-1], content[2]
        if isinstance(count, str) and count.isascii() and count.isdigit():
            count = int(count)  # the file may contain "5" instead of 5
        if isinstance(count, bool) or not isinstance(count, int) or not 2 <= count <= LARGEST:
            self._complain(
                (*at, 2),
                f"expected a whole number from 2 to {LARGEST} as the number of values, got {shown(count)}",
                name,
            )
        numbers = spaced(spread, count)
        if len(numbers) < (2 if spread.whole else count):
            got = f"{shown(content[0])} and {shown(content[1])}"
            self._complain(at, f"expected ends that are far enough apart for {count} different values, got {got}", name)
        first, last = (numbers[0], numbers[-1]) if spread.whole else content[:2]
        origin = self._origin(at, name)
        inner = [Item(number, origin, inner=True) for number in numbers[1:-1]]
        ends = [
            Item(end, self._origin((*at, index), name), self.document.flow((*at, index)))
            for index, end in enumerate((first, last))
        ]
        return [ends[0], *inner, ends[1]]

    def _end(self, path: tuple[str, ...], kind: str, value: Any, at: Path) -> float:
        unit, name, number = fields.unit_at(self.parameters, path, self.data) or "1", at[:-2], np.nan
        if isinstance(value, str):
            try:
                number = to_si(value, unit)
            except ValueError as error:
                self._complain(at, str(error), name)
        elif isinstance(value, bool) or not isinstance(value, int | float):
            self._complain(at, f"expected {expected(unit)}, got {shown(value)}", name)
        else:
            number = float(value)
        if not np.isfinite(number):
            self._complain(at, f"expected a finite number, got {shown(value)}", name)
        if kind == "geometric" and number <= 0:
            self._complain(at, f"expected an end above 0 for a geometric range, got {shown(value)}", name)
        return number

    def _origin(self, path: Path, name: Path) -> Origin:
        return Origin(dotted(name), self.document.place(path), path)

    def _complain(self, at: Path, what: str, name: Path) -> NoReturn:
        self.document.problems.add(self.document.place(at), dotted(name), what)
        raise _MalformedError


def spaced(spread: Spread, count: int) -> list[float]:
    """Return at most `count` distinct values of an interval, including its exact ends."""
    inner = spread.at(np.arange(1, count - 1) / (count - 1))
    ends = [tidy(end, spread.whole, exact=True) for end in (spread.low, spread.high)]
    return list(dict.fromkeys([ends[0], *inner, ends[1]]))
