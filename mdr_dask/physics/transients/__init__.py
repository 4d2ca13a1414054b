"""Friction as a function of time, after a velocity jump or under any history of velocity and load.

Read `velocity_jump` first. The module `march` computes the depth in many time steps, from the steady state before a
jump (`limits`). At every time step, `contact_search` finds the contact patches. The package `elements` computes the
motion of every element. This method is slower, but accepts any history, solid and indenter.
"""
