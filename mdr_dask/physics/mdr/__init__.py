"""The transforms of the method of dimensionality reduction for bodies of revolution.

Read `transforms` first: the integrals, with an error estimate. `half_integrals` computes them as matrices on graded
panels, `uniform_grid` as matrices on a uniform grid. `revolution` contains the profiles of bodies, `power_law_contact`
the contacts of power-law bodies in closed form.
"""
