"""Steady sliding of a viscoelastic foundation over a line at a prescribed load.

Read `problem` first: it chooses the solver, and refines the grid until the results have the requested accuracy. `cases`
contains the input and output of the solvers. `full_contact` needs no grid. A Kelvin solid is solved by `node_to_node`
(fast, many cases at once), by `steady` (search for the depth) with `kelvin` (exact sweep over cubic cells), or by
`backward_euler` (the time-stepping method of the papers). Any other solid is solved by `viscoelastic`, which calls
`viscoelastic_sweep`. `laws` contains the friction laws of the thesis in closed form.
"""
