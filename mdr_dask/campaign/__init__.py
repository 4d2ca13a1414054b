"""The campaign file: from text to checked, frozen data."""

from mdr_dask.campaign.definition import Axis, Campaign, Refinement, Replication, Series, Spread, Tolerance
from mdr_dask.campaign.read import load, loads
from mdr_dask.campaign.schema import json_schema
