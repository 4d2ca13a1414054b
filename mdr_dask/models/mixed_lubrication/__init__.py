"""Mixed lubrication of two rough rollers with breakthrough of the boundary layer (thesis chapter 5).

`declaration` has parameters and outputs and is light to import. `solve` turns a block into arrays: `operation` is a
case before its roughness (contact, film, shares of the load), `lines` has the rough lines, and `revolution` the
intimate contact during one revolution of the rollers.
"""

from mdr_dask.models.mixed_lubrication.declaration import MODEL, MixedLubrication

__all__ = ["MODEL", "MixedLubrication"]
