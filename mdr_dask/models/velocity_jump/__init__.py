"""Kinetics of friction after a jump of the sliding velocity, or under any loading history (thesis chapter 4).

`declaration` says what a campaign can name and is light to import; `solve` turns a block of cases into arrays.
"""

from mdr_dask.models.velocity_jump.declaration import MODEL, VelocityJump

__all__ = ["MODEL", "VelocityJump"]
