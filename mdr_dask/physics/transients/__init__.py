"""Friction as a function of time, after a velocity jump or under any history of velocity and load.

Read `velocity_jump` first. This module starts from the steady state before the jump (`limits`) and marches the depth in
time (`march`); at every time step the contact patches are found (`contact_search`). The package `elements` is slower,
because it computes the motion of every element, but it accepts any history, solid and indenter.
"""
