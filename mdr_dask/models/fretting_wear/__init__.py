"""Fretting and sliding wear of a body of revolution that is pressed into a half-space."""

from mdr_dask.models.fretting_wear.declaration import MODEL, FrettingWear
