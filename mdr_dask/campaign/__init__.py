"""The campaign file: text to checked, frozen data."""

from mdr_dask.campaign.definition import Axis, Campaign, Replication, Series, Tolerance
from mdr_dask.campaign.read import load, loads

__all__ = ["Axis", "Campaign", "Replication", "Series", "Tolerance", "load", "loads"]
