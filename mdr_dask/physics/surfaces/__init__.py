"""Lines over which an elastomer slides: their sources, and their shape between nodes.

`waves` is the common form of all roughness. `roughness` generates lines, `measured` prepares recorded lines, and
`shapes` holds indenters. `rough_line` puts roughness on an indenter or a plane, and `cubic_line` is the line for the
solvers. `splines` are lines with few points, for quantities that depend on the shape between points.
For measured surfaces, `maps` and `scans` compute a `spectrum`, from which lines are made; `self_affine` fits power
laws.
"""
