"""The numerics: arrays in, arrays out, with numpy, scipy and numba only.

On the ground `outcome` (how a solver ended), `jit` (compilation of kernels), `linear` (solves by one thread)
and `solids` (linear viscoelastic solids). Above them the rooms `mdr` and `surfaces`; then `sliding`; on top
`transients`, `wear`, `lubrication` and `superposition`, which do not know each other.
"""
