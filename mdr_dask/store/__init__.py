"""The Zarr layout of a study: the only room that knows Zarr.

A group holds one array for every output and ``status``, the ledger, over (axes..., realisation, ...), and a coordinate
for every parameter. The driver lays arrays out; a block is written by whoever computed it, one whole chunk of every
array, ``status`` last. Readers see consolidated metadata, which is replaced in one write.
"""

from mdr_dask.store.blocks import Place, is_written, layout_mark, read_block, values, write_block
from mdr_dask.store.files import absolute
from mdr_dask.store.identity import Stored, reconcile
from mdr_dask.store.layout import lay_out
from mdr_dask.store.ledgers import ledger
from mdr_dask.store.locks import Hold, holding, lock
from mdr_dask.store.packing import contents, verify_packed
from mdr_dask.store.reading import datasets, is_damage, readable, save
from mdr_dask.store.records import attempts, kinds, put_together, record, records
from mdr_dask.store.repairing import repair
from mdr_dask.store.runners import Part, alone, at_work, beside, entrance
from mdr_dask.store.sound import Look, look, require_blocks, require_laid_out, require_sound, seal
from mdr_dask.store.study import attributes, exists, is_study, series_names
from mdr_dask.store.verifying import CHECKSUMS, CRATE, PUBLISHED, Finding, Inspection, verify

__all__ = [
    "CHECKSUMS",
    "CRATE",
    "PUBLISHED",
    "Finding",
    "Hold",
    "Inspection",
    "Look",
    "Part",
    "Place",
    "Stored",
    "absolute",
    "alone",
    "at_work",
    "attempts",
    "attributes",
    "beside",
    "contents",
    "datasets",
    "entrance",
    "exists",
    "holding",
    "is_damage",
    "is_study",
    "is_written",
    "kinds",
    "lay_out",
    "layout_mark",
    "ledger",
    "lock",
    "look",
    "put_together",
    "read_block",
    "readable",
    "reconcile",
    "record",
    "records",
    "repair",
    "require_blocks",
    "require_laid_out",
    "require_sound",
    "save",
    "seal",
    "series_names",
    "values",
    "verify",
    "verify_packed",
    "write_block",
]
