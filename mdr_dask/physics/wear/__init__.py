"""Fretting and sliding wear of a contact of revolution.

Read `worn` first: what a worn contact is, its limit and the fast rule. `rules` are those compiled for many cases,
`exact` and `forced` the exact evolution at constant depth and force (`evolution`, `gross_slip`, `forced_slip`,
`forced_fast`), `history` blocks of load, `factor` the fit of one factor to measured wear.
"""
