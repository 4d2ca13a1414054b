"""Run a campaign: rounds, resumed runs, failures and progress. Only this package imports `distributed`."""

from mdr_dask.execute.events import Event, Progress, Tell
from mdr_dask.execute.resources import Resources
from mdr_dask.execute.rounds import outlook, run
from mdr_dask.store import Part
