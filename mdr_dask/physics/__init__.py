"""Numerical methods that take and return arrays, and use only numpy, scipy and numba.

The lowest layers are the modules `outcome` (how a solver ended), `jit` (compilation of kernels), `refine` (grid
refinement), `linear` (linear systems) and `solids` (linear viscoelastic solids). The packages `mdr` and `surfaces` form
the next layer, and `sliding` the layer above. The top layer is `transients`, `wear`, `lubrication` and `superposition`.
Packages of the top layer do not import each other.
"""
