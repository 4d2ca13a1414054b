"""Every element of a foundation followed in time: slower than the march of a jump, but for any history, solid and body.

Read `foundation` first: a solid and one element of it through one step. `edges` are the forces on a line over all
elements, whose contact ends between them; `steps` takes all elements through time; `follow` starts from rest or from
steady sliding; `loading_history` is velocity and load in time, and in which steps they are taken.
"""
