"""Fretting and sliding wear of a body of revolution that is pressed into a half-space.

`declaration` has parameters and outputs and is light to import; `reduction` turns them into the few numbers that
matter, `solve` a block into arrays.
"""

from mdr_dask.models.fretting_wear.declaration import MODEL, FrettingWear

__all__ = ["MODEL", "FrettingWear"]
