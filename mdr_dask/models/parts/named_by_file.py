"""Parameter sets that contain a file. Instead of the set, a user can write the name of the file alone."""

from __future__ import annotations

from typing import Any

from pydantic import ConfigDict, model_validator

from mdr_dask.models.base import Parameters


class NamedByFile(Parameters):
    """A parameter set with a field `file` or `files`.

    If a user writes the name of a file alone, the other fields have their default values.
    """

    model_config = ConfigDict(json_schema_extra={"bare_name": True})

    @model_validator(mode="before")
    @classmethod
    def _bare_name(cls, value: Any) -> Any:
        if not isinstance(value, str):
            return value
        return {"files": [value]} if "files" in cls.model_fields else {"file": value}
