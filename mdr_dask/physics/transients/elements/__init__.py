"""Friction under any history of velocity and load, for a foundation of any linear solid.

The motion of every element is computed. The computation takes longer than the march of a velocity jump. Read
`foundation` first: it describes a solid, and the motion of one element during one step. `steps` moves all elements
through the moments of a history, finds where contact begins and ends between elements, and adds up the forces.
`loading_history` describes velocity and load in time, chooses the moments, and starts from rest or from steady sliding.
"""
