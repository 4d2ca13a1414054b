"""The numerics: arrays in, arrays out, with numpy, scipy and numba only.

On the ground `linear` (solves by one thread), `compiling` (the decorators of kernels) and `solids` (linear viscoelastic
solids). Above them the rooms `mdr` and `surfaces`; then `sliding`; on top `transients`, `wear`, `lubrication` and
`superposition`, which do not know each other.
"""
