"""Steady friction of a viscoelastic body that slides over a rough line (thesis chapter 3).

`declaration` says what a campaign can name and is light to import; `solve` turns a block of cases into arrays.
"""

from mdr_dask.models.sliding_friction.declaration import MODEL, SlidingFriction

__all__ = ["MODEL", "SlidingFriction"]
