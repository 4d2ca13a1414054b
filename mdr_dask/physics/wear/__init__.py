"""Fretting and sliding wear of a contact of revolution.

Read `worn` first: what a worn contact is, and how its error is told. `rules` has the limit and the fast rule,
`approach` how near a contact has come to the limit. The exact evolution: `exact` is its front end for every condition,
`evolution` the stepping, `slip` and `forced_slip` the equations (`remembered` is what a moving border leaves behind),
`forced` the way under constant force. `history` has blocks of load.
"""
