"""Oil films between rollers, and the boundary layers that break through them.

Read `oil` and `film_formulas` first: they contain closed forms. `line_contact` solves for the film numerically, on
finer and finer `grids`, and estimates the error. `newton` finds the film on one grid (a `grid_solution`), with the
`deformation` of a half-plane. `traction` computes the friction of the film.

For rough rollers, `load_sharing` divides the load between film and asperities. `clusters` finds the places where
asperities overlap through the film, and `breakthrough` decides which of them break the boundary layer.
"""
