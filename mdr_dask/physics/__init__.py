"""Numerical methods that take and return arrays, and use only numpy, scipy and numba.

The lowest layer contains `outcome` (how a solver ended), `jit` (compilation of kernels), `linear` (linear systems,
solved by one thread) and `solids` (linear viscoelastic solids). The packages `mdr` and `surfaces` form the next layer,
and `sliding` forms the layer above. The top layer consists of `transients`, `wear`, `lubrication` and `superposition`.
Packages of the top layer do not import each other.
"""
