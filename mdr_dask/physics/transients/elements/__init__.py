"""Histories of velocity and load in which every element of a foundation is followed in time, for any linear solid.

This takes longer than the march of a jump. Read `foundation` first: a solid, and one element of it through one step.
`edges` adds up the forces on a line over all elements, between which contact begins and ends. `steps` moves all
elements through the moments of a history. `follow` starts from rest or from steady sliding. `loading_history` describes
velocity and load in time, and chooses the moments.
"""
