"""Friction as a function of time, after a velocity jump or under any history of velocity and load.

Read `velocity_jump` first. From the steady state before a jump (`limits`), the depth is marched in time (`march`), and
`contact_search` finds the contact patches at every time step. The package `elements` is slower, because it computes the
motion of every element, but it accepts any history, solid and indenter.
"""
