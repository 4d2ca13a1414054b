"""The Zarr layout of a study: the only room that knows Zarr.

A group holds one array for every output and ``status``, the ledger, over (axes..., realisation, ...), and a coordinate
for every parameter. The driver lays arrays out; a block is written by whoever computed it, one whole chunk of every
array, ``status`` last. Readers see consolidated metadata, which is replaced in one write.
"""

from mdr_dask.store.blocks import (
    Place,
    attempts,
    ledger,
    read_block,
    records,
    values,
    write_record,
    write_status,
    write_values,
)
from mdr_dask.store.files import attributes, exists, is_study, sweep
from mdr_dask.store.identity import Stored, reconcile
from mdr_dask.store.layout import lay_out
from mdr_dask.store.locks import holding, lock
from mdr_dask.store.reading import datasets, is_damage, readable, save

__all__ = [
    "Place",
    "Stored",
    "attempts",
    "attributes",
    "datasets",
    "exists",
    "holding",
    "is_damage",
    "is_study",
    "lay_out",
    "ledger",
    "lock",
    "read_block",
    "readable",
    "reconcile",
    "records",
    "save",
    "sweep",
    "values",
    "write_record",
    "write_status",
    "write_values",
]
