"""Friction as a function of time, after a velocity jump or under any history of velocity and load.

Read `velocity_jump` first. The module `march` computes the depth in many time steps, from the steady state before a
jump (`limits`). At every time step, `contact_search` finds the contact patches. This method is limited to jumps of a
Kelvin solid on a periodic line at constant load. The package `elements` computes the motion of every element instead,
which is slower, but allows any loading history, linear solid and indenter.
"""
