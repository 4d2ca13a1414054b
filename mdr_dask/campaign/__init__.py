"""The campaign file: text to checked, frozen data."""

from mdr_dask.campaign.definition import Axis, Campaign, Replication, Series, Tolerance
from mdr_dask.campaign.read import load, loads
from mdr_dask.campaign.schema import json_schema

__all__ = ["Axis", "Campaign", "Replication", "Series", "Tolerance", "json_schema", "load", "loads"]
