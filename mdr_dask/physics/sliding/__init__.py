"""Steady sliding of a viscoelastic foundation over a line at a prescribed load.

Read `problem` first: it takes a line, a solid and cases, and chooses the solver for the solid. Then read `cases` (input
and output of the solvers), `kelvin_refinement` (grids and errors for a Kelvin solid) and `steady` (the search for the
depth). `full_contact` needs no grid. A Kelvin solid is solved by `kelvin` (exact on cubic cells), by `node_to_node`
(many cases at once) or by `backward_euler` (the time steps of the papers). Any other solid is solved by `viscoelastic`,
with `viscoelastic_newton` and `viscoelastic_sweep`. `laws` contains the closed forms.
"""
