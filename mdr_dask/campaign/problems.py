"""The problems of a campaign file, each with its position and a message."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from mdr_dask.errors import CampaignError

Path = tuple[str | int, ...]


@dataclass(frozen=True, order=True)
class Place:
    """A position in a file. Lines and columns count from 1. In a CSV file, the column is 0."""

    source: str
    line: int
    column: int = 0

    def __str__(self) -> str:
        return f"{self.source}:{self.line}{f':{self.column}' if self.column else ''}"


@dataclass(frozen=True, order=True)
class Problem:
    """A problem: its position in the file, its key, and the message."""

    place: Place
    where: str
    what: str

    def __str__(self) -> str:
        where = f"{self.where}: " if self.where else ""
        return f"{self.place}: {where}{self.what}"


class Problems:
    """A collection of problems, with at most one for each position and key."""

    def __init__(self) -> None:
        self._found: dict[tuple[Place, str], Problem] = {}

    def __bool__(self) -> bool:
        return bool(self._found)

    def __contains__(self, place: Place) -> bool:
        return any(place == each for each, _ in self._found)

    def add(self, place: Place, where: str, what: str) -> None:
        """Add a problem, unless there is already one for the same key at the same position."""
        self._found.setdefault((place, where), Problem(place, where, what))

    def raise_if_any(self, questions: Iterable[str] = ()) -> None:
        """If there are problems, raise a `CampaignError` with the problems, sorted by line, and the questions."""
        if self._found:
            sources = list(dict.fromkeys(place.source for place, _ in self._found))
            ordered = sorted(self._found.values(), key=lambda problem: (sources.index(problem.place.source), problem))
            raise CampaignError(*map(str, ordered), *questions)


def dotted(path: Iterable[str | int]) -> str:
    """Return a path as text, such as ``outputs[1]`` for ``("outputs", 1)``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def shown(value: Any) -> str:
    """Return a value as text for a message. Long texts are shortened."""
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return "a mapping" if value else "an empty mapping"
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
