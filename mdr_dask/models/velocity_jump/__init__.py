"""Friction after a jump of the sliding velocity, or under any loading history (thesis chapter 4)."""

from mdr_dask.models.velocity_jump.declaration import MODEL, VelocityJump
