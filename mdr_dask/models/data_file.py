"""Data files that are named in a campaign."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationInfo, model_validator

from mdr_dask.errors import DataError, similar
from mdr_dask.models.base import Parameters
from mdr_dask.tables import decoded, described, read_head


class DataFile(BaseModel):
    """A file that is named in a campaign, with the digest that its content had when the campaign was read."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    name: str
    path: str
    sha256: str

    @classmethod
    def of(cls, path: Path) -> DataFile:
        """Return the file at a path, with the digest of its current content."""
        return cls(name=path.name, path=str(path), sha256=hashlib.sha256(path.read_bytes()).hexdigest())

    def read_bytes(self) -> bytes:
        """Return the content of the file. Raise DataError if the file has changed since the campaign was read."""
        content = Path(self.path).read_bytes()
        if hashlib.sha256(content).hexdigest() != self.sha256:
            raise DataError(f"{self.path}: changed since the campaign was read")
        return content

    def read_text(self) -> str:
        """Return the text of a text file or workbook. Raise DataError if the file has changed or is of another kind."""
        return decoded(self.read_bytes(), self.path)

    @contextmanager
    def in_errors(self) -> Iterator[None]:
        """Put the name of the file before the message of any DataError that is raised inside the ``with`` statement."""
        try:
            yield
        except DataError as problem:
            raise DataError(f"{self.name}: {problem}") from None

    def notes(self) -> tuple[str, ...]:
        """Return a note that states the columns of a table and their ranges.

        Return () if the columns have no names, or if the file cannot be read as a table.
        """
        return _notes_of_file(self)


def check_in_campaign(info: ValidationInfo, check: Callable[[], object]) -> None:
    """If a campaign is being read, call `check` and convert a DataError to the ValueError that pydantic expects."""
    if info.context is not None:
        try:
            check()
        except DataError as problem:
            raise ValueError(str(problem)) from None


@lru_cache(maxsize=64)
def _notes_of_file(file: DataFile) -> tuple[str, ...]:
    try:
        text = file.read_text()
        return (f"table {file.name}: {described(text, file.name)}",) if read_head(text).names else ()
    except DataError:
        return ()


def _find_file(value: Any, info: ValidationInfo) -> Any:
    if not isinstance(value, str):
        return value
    directory = info.context["directory"] if info.context else "."
    path = Path(directory, value).resolve()
    if not path.is_file():
        near = similar(path.name, [each.name for each in Path(directory).iterdir() if each.is_file()])
        near = near or " (the path is relative to the folder of the campaign file)"
        raise ValueError(f"no such file: {path}{near}")
    return DataFile.of(path).model_copy(update={"name": value})


#: A parameter that is the path of a file, relative to the folder of the campaign file.
NamedFile = Annotated[DataFile, BeforeValidator(_find_file, json_schema_input_type=str)]


class NamedByFile(Parameters):
    """A parameter set with a field `file` or `files`.

    In place of the whole parameter set, a user may write only the name of the file. All other fields then have their
    default values.
    """

    model_config = ConfigDict(json_schema_extra={"bare_name": True})

    @model_validator(mode="before")
    @classmethod
    def _bare_name(cls, value: Any) -> Any:
        if not isinstance(value, str):
            return value
        return {"files": [value]} if "files" in cls.model_fields else {"file": value}
