"""Friction after a jump of the sliding velocity, or under any loading history (thesis chapter 4).

`declaration` defines the parameters and outputs, and is quick to import; `solve` computes the outputs of a block of
cases.
"""

from mdr_dask.models.velocity_jump.declaration import MODEL, VelocityJump

__all__ = ["MODEL", "VelocityJump"]
