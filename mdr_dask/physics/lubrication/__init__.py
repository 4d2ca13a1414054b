"""Oil films between rollers, and the boundary layers that break through them.

Read `oil` and `film_formulas` for closed forms, then `line_contact` for the numerical film: its cases, nested `grids`
and error estimates, each grid solved by `newton` with the `deformation` of a half-plane; `traction` is its friction.
Rough rollers: `load_sharing` divides the load between film and asperities, `breakthrough` says where the asperities
break the boundary layer.
"""
