"""Lines that an elastomer slides over: where they come from and how they run between their nodes.

Read `waves` (the common form of any roughness), `roughness` (generated lines), `measured` (recorded lines), `shapes`
(indenters), `rough_line` (roughness over an indenter or a plane) and `cubic_line` (the line that the solvers take);
`splines` are lines of few points, for what is decided between these.
Measured surfaces: `maps` and `scans` lead to a `spectrum`, of which lines are made; `self_affine` fits its slope.
"""
