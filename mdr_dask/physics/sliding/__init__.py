"""Steady sliding of a viscoelastic foundation over a line at a prescribed load.

Read `problem` first: a line, a solid and cases, and which solver the solid picks. Then `cases`, what goes into a solver
of a Kelvin solid and comes out, `steady`, the search for its depth, and `accuracy`, its grids. `full_contact` needs no
grid. A Kelvin solid is solved by `kelvin` (exact on cubic cells) or, many cases at once, by `vectorised` (from node to
node: `nodes`, `walk`) and `backward_euler` (the steps of the papers); any other solid by `viscoelastic`
(`viscoelastic_newton`, `viscoelastic_sweep`). `laws` are the closed forms; `displacement` is the displaced surface on a
grid, for pictures.
"""
