"""Oil films between rollers, and the boundary layers that break through them.

Read `film_formulas` and `oil` for closed forms, `line_contact` for the numerical film (`levels` of `grids`, each
solved by `newton` with the `deformation` of a half-plane), `traction` for its friction, `breakthrough` for rough
rollers.
"""
