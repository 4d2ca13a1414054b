"""Friction under any history of velocity and load, for a foundation of any linear solid.

The motion of every element is computed. Read `foundation` first. That module describes a solid, and the motion of one
element during one time step. `steps` moves all elements and adds up the forces. `loading_history` describes velocity
and load in time, and chooses the time steps.
"""
