"""Fretting and sliding wear of a contact of revolution; read `worn` first.

`rules` contains the limiting profile and the fast rule, `exact` the exact evolution, and `history` the wear under
blocks of load. `exact` makes the steps of `evolution` with the equations of `slip`.
"""
