"""The Zarr layout of a study: the only room that knows Zarr.

A group holds one array for every output and ``status``, the ledger, over (axes..., realisation, ...), and a coordinate
for every parameter. The driver lays arrays out; a block is written by whoever computed it, one whole chunk of every
array, ``status`` last. Readers see consolidated metadata, which is replaced in one write.
"""

from mdr_dask.store.blocks import (
    Place,
    attempts,
    layout_mark,
    ledger,
    read_block,
    record,
    records,
    values,
    write_record,
    write_status,
    write_values,
)
from mdr_dask.store.files import absolute, attributes, exists, is_study
from mdr_dask.store.identity import Stored, reconcile
from mdr_dask.store.layout import lay_out
from mdr_dask.store.reading import datasets, is_damage, readable, save
from mdr_dask.store.runners import Part, alone, at_work, beside, entrance

__all__ = [
    "Part",
    "Place",
    "Stored",
    "absolute",
    "alone",
    "at_work",
    "attempts",
    "attributes",
    "beside",
    "datasets",
    "entrance",
    "exists",
    "is_damage",
    "is_study",
    "lay_out",
    "layout_mark",
    "ledger",
    "read_block",
    "readable",
    "reconcile",
    "record",
    "records",
    "save",
    "values",
    "write_record",
    "write_status",
    "write_values",
]
