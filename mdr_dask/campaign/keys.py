"""A campaign from its keys: a dictionary has no lines, so that its messages name keys alone."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from mdr_dask.campaign.definition import Campaign
from mdr_dask.campaign.read import loads
from mdr_dask.errors import CampaignError


def of_keys(source: Mapping[str, Any]) -> Campaign:
    """Read a campaign from the keys of its file; numbers of numpy and paths are as good as those of a file.

    Raises
    ------
    CampaignError
        With every problem.
    """
    text = json.dumps({"name": "study", **source}, indent=1, default=_plain)
    try:
        found = loads(text, "campaign", ".")
    except CampaignError as error:
        raise CampaignError(*_without_lines(error.args)) from None
    return replace(found, remarks=_without_lines(found.remarks))


def _without_lines(messages: Sequence[str]) -> tuple[str, ...]:
    return tuple(re.sub(r"^campaign:\d+:\d+: ", "", message) for message in messages)


def _plain(value: Any) -> Any:
    """Return numbers of numpy, pandas and xarray, and ranges, as JSON holds them; the rest as text."""
    numbers = list(value) if isinstance(value, range) else getattr(value, "values", value)
    return numbers.tolist() if hasattr(numbers, "tolist") else numbers if isinstance(numbers, list) else str(value)
