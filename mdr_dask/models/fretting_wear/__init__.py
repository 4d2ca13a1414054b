"""Fretting and sliding wear of a body of revolution that is pressed into a half-space.

`declaration` holds parameters and outputs and is fast to import. `reduction` converts the parameters to a few
dimensionless numbers. `solve` computes the arrays of a block.
"""

from mdr_dask.models.fretting_wear.declaration import MODEL, FrettingWear

__all__ = ["MODEL", "FrettingWear"]
