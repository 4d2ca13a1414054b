"""Friction under any history of velocity and load, for a foundation of any linear solid.

The motion of every element is computed, which takes longer than the march of a velocity jump. Read `foundation` first:
it describes a solid, and one element of it during one step. `steps` moves all elements through the moments of a history
and adds up their forces, with the places between elements where contact begins and ends. `loading_history` describes
velocity and load in time, chooses the moments, and starts from rest or from steady sliding.
"""
