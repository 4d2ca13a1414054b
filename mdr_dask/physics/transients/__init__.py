"""Friction that changes in time, after a jump of the velocity or under any history of velocity and load.

Read `velocity_jump` first: it goes from one steady state to the next (`limits`) by a `march` of the depth, which finds
the contact patches at every moment (`contact_search`) and the displacement of the elements between them
(`free_recovery`). `patches` holds the forces on a patch. `accuracy` chooses the grids and estimates the errors.
`elements` follows every element: slower, but for any history, solid and indenter.
"""
