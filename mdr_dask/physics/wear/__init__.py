"""Fretting and sliding wear of a contact of revolution.

Read `worn` first: it holds a worn contact and the estimate of its error. `rules` computes the limiting profile and the
fast rule. `exact` is the front end of the exact evolution for all conditions; `evolution` makes the time steps, and
`slip` holds the equations. `history` computes wear under blocks of load, on a uniform grid.
"""
