"""Fretting and sliding wear of a contact of revolution.

Read `worn` first: it holds a worn contact and the estimate of its error. `rules` computes the limiting profile and the
fast rule; `approach` bounds the distance of a contact from its limiting profile. The exact evolution is spread over
four modules: `exact` is the front end for all conditions, `evolution` makes the time steps, `slip` holds the equations
at constant depth and in gross slip, and `forced_slip` holds the equations under constant force, which `forced` solves.
`history` computes wear under blocks of load, on a uniform grid.
"""
