"""The cluster file: which Dask cluster to start, and how."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Any

from mdr_dask.campaign.document import parse, read_text
from mdr_dask.campaign.problems import shown
from mdr_dask.errors import did_you_mean

_EXPECTED = {
    "class": "a class such as dask_jobqueue.SLURMCluster",
    "arguments": "a mapping",
    "scale": "a mapping",
    "adapt": "a mapping",
}


def load_cluster(path: FilePath) -> dict[str, Any]:
    """Read a cluster file: the key ``class``, and the optional keys ``arguments``, ``scale`` and ``adapt``.

    Raise CampaignError if the file cannot be read or contains mistakes.
    """
    document = parse(read_text(path), str(path))
    data = document.data if isinstance(document.data, dict) else {}
    for key, value in data.items():
        if key not in _EXPECTED:
            document.report((key,), f"unknown key{did_you_mean(key, list(_EXPECTED))}", key=True)
        elif not (isinstance(value, dict) if key != "class" else isinstance(value, str) and "." in value):
            document.report((key,), f"expected {_EXPECTED[key]}, got {shown(value)}")
    if "class" not in data and not document.problems:
        document.report((), f"expected a mapping with the key 'class', got {shown(document.data)}")
    document.problems.raise_if_any()
    return data
