"""Mixed lubrication of two rough rollers with breakthrough of the boundary layer (thesis chapter 5).

`declaration` holds parameters and outputs and is fast to import. `solve` computes the arrays of a block. It uses
`operation` for the smooth contact (contact, film, load shares), `lines` for the rough lines, and `revolution` for the
intimate contact during one revolution of the rollers.
"""

from mdr_dask.models.mixed_lubrication.declaration import MODEL, MixedLubrication

__all__ = ["MODEL", "MixedLubrication"]
