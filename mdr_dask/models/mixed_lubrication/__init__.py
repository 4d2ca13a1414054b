"""Mixed lubrication of two rough rollers with breakthrough of the boundary layer (thesis chapter 5).

`declaration` defines the parameters and outputs, and is quick to import. `solve` computes the outputs of a block of
cases. The module `solve` uses `operation` for the smooth rollers (Hertzian contact, oil film, load shares), `lines` for
the rough lines, and `revolution` for the intimate contact of the rough lines during one revolution of the rollers.
"""

from mdr_dask.models.mixed_lubrication.declaration import MODEL, MixedLubrication

__all__ = ["MODEL", "MixedLubrication"]
