"""Oil films between rollers, and the boundary layers that break through them.

Read `oil` and `film_formulas` first: they hold closed forms. `line_contact` solves for the film numerically and
estimates the error, on `grids` of increasing size; each `grid_solution` is found by `newton` with the `deformation` of
a half-plane, and `traction` computes its friction. For rough rollers, `load_sharing` divides the load between film and
asperities, `clusters` finds the places where asperities overlap through the film, and `breakthrough` decides which of
them break the boundary layer.
"""
