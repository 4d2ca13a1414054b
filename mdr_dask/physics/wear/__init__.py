"""Fretting and sliding wear of a contact of revolution.

Read `worn` first: a worn contact and its error. `rules` has the limit and the fast rule,
`approach` how near a contact has come to the limit. The exact evolution: `exact` is its front end for every condition,
`evolution` the time steps, `slip` the equations at constant depth and in gross slip, `forced_slip` those under constant
force, which `forced` solves. `history` has blocks of load on a uniform grid.
"""
