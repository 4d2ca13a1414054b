"""Fretting and sliding wear of a contact of revolution; read `worn` first.

`rules` contains the limiting profile and the fast rule, `exact` the exact evolution, and `history` the wear under
blocks of load. For the exact evolution, `evolution` contains the time integration and `slip` the equations of one time
step.
"""
