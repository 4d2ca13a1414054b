"""Parameter sets that a user can write as a file name only."""

from __future__ import annotations

from typing import Any

from pydantic import ConfigDict, model_validator

from mdr_dask.models.base import Parameters


class NamedByFile(Parameters):
    """A parameter set with a field `file` or `files`. A file name alone means this file with the default options."""

    model_config = ConfigDict(json_schema_extra={"bare_name": True})

    @model_validator(mode="before")
    @classmethod
    def _bare_name(cls, value: Any) -> Any:
        if not isinstance(value, str):
            return value
        return {"files": [value]} if "files" in cls.model_fields else {"file": value}
