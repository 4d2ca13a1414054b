"""Friction as a function of time, after a velocity jump or under any history of velocity and load.

For velocity jumps of a Kelvin body without an indenter shape, start with `accuracy.solve_jumps`. The module `limits`
computes the steady states before and after a jump, `velocity_jump` prepares the march, and `march` computes the depth
in many time steps. At every time step, `contact_search` finds the contact patches.

The package `elements` computes the motion of every element; start with `elements.loading_history.trace`. This second
method is slower, but accepts any history, solid and indenter.
"""
