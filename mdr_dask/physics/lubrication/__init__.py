"""Oil films between rollers, and the boundary layers that break through them.

Read `oil` and `film_formulas` for closed forms, then `line_contact` for the numerical film: its cases, ever finer
`grids`, and the `limits` that films tend to, with their errors. Each `grid_solution` is found by `newton` with the
`deformation` of a half-plane; `traction` is its friction. Rough rollers: `load_sharing` divides the load between film
and asperities, `clusters` are the places where these overlap, and `breakthrough` decides which of them break the layer.
"""
