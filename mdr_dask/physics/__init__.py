"""The numerical methods. They take and return arrays, and use numpy, scipy and numba only.

The lowest layer contains `outcome` (how a solver ended), `jit` (compilation of kernels), `linear` (linear systems,
solved by one thread) and `solids` (linear viscoelastic solids). The packages `mdr` and `surfaces` form the next layer,
and `sliding` the layer above. The top layer consists of `transients`, `wear`, `lubrication` and `superposition`, which
do not import each other.
"""
