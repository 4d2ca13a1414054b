"""Oil films between rollers, and the boundary layers that break through them.

Read `oil` and `film_formulas` first: they contain closed forms. `line_contact` solves for the film numerically, on
finer and finer `grids`, and estimates the error. On one grid, `newton` finds the film, `deformation` computes the
deformation of a half-plane, and `grid_solution` describes the result. `traction` computes the friction of the film.

For rough rollers, `load_sharing` divides the load between film and asperities. `clusters` finds the intervals in which
the asperities overlap through the film. `breakthrough` decides which of these clusters break the boundary layer.
"""
