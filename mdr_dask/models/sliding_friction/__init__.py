"""Steady friction of a viscoelastic body that slides over a rough line (thesis chapter 3).

`declaration` defines the parameters and outputs, and is quick to import; `solve` computes the outputs of a block of
cases.
"""

from mdr_dask.models.sliding_friction.declaration import MODEL, SlidingFriction

__all__ = ["MODEL", "SlidingFriction"]
