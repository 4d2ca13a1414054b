"""The transforms of the method of dimensionality reduction for bodies of revolution.

Read `transforms` first: the integrals, with an error estimate. `half_integrals` provides them as matrices on graded
panels, and `uniform_grid` as matrices on a uniform grid. `revolution` contains the profiles of bodies, and
`power_law_contact` closed forms for the contacts of power-law bodies.
"""
