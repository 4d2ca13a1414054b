"""Fretting and sliding wear of a contact of revolution.

Read `worn` first, which defines a worn contact and the estimate of its error. `rules` computes the limiting profile and
the fast rule. `exact` computes the exact evolution. For this evolution, `evolution` makes the time steps, and `slip`
contains the equations. `history` computes wear under blocks of load, on a uniform grid.
"""
