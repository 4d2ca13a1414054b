"""Friction as a function of time, after a velocity jump or under any history of velocity and load.

Read `velocity_jump` first. This module starts from the steady state before the jump (`limits`) and marches the depth in
time (`march`) until the steady state after the jump is reached. At every time step the march finds the contact patches
(`contact_search`) and the displacements of the elements that are out of contact (`free_recovery`). `patches` computes
the forces on a patch. `accuracy` chooses the grids and estimates the errors. The package `elements` computes the motion
of every element instead. This computation is slower, but accepts any history, solid and indenter.
"""
