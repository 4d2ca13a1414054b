"""Mixed lubrication of two rough rollers, and the breakthrough of the boundary layer (thesis chapter 5)."""

from mdr_dask.models.mixed_lubrication.declaration import MODEL, MixedLubrication
