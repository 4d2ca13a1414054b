"""The Zarr store of a study. Only this package uses Zarr.

Every output is an array. Its dimensions are those of the axes, ``realisation``, and further dimensions of the output.
The array ``status``, called the ledger, holds the state of every result. The process that computes a block writes first
a record with the digests of the chunks of the block, then one whole chunk of every output, and finally the chunk of
``status``. Readers find all arrays through the ``zarr.json`` at the root. A run replaces this file in one write.
"""

from mdr_dask.store.blocks import Place, layout_mark, read_block, values, write_block
from mdr_dask.store.files import absolute
from mdr_dask.store.identity import Stored, reconcile
from mdr_dask.store.layout import Finding, is_laid_out, lay_out
from mdr_dask.store.ledgers import ledger, require_undamaged
from mdr_dask.store.locks import Lock, Part, active_runs, at_work, exclusive, gate, shared, while_locked
from mdr_dask.store.packing import contents, verify_packed
from mdr_dask.store.reading import datasets, save, with_plain_attributes
from mdr_dask.store.records import attempts, merge_records, records
from mdr_dask.store.study import attributes, exists, is_study, series_names
from mdr_dask.store.verification import CHECKSUMS, PUBLISHED, Inspection, repair, verify
