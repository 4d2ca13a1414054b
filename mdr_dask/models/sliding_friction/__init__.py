"""Steady friction of a viscoelastic body that slides over a rough line (thesis chapter 3)."""

from mdr_dask.models.sliding_friction.declaration import MODEL, SlidingFriction
