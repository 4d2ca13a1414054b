"""Fretting and sliding wear of the contact of a body of revolution. Read `worn` first.

`rules` contains the limiting profile and the fast rule, `exact` the exact evolution, and `history` the wear under
blocks of load. `exact` uses `evolution` for the time integration, and `slip` for the equations of one time step.
`accuracy` estimates the errors of all these methods.
"""
