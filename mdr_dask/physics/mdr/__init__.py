"""The transforms of the method of dimensionality reduction for bodies of revolution.

Read `transforms` first: it computes the integrals and estimates their errors. `half_integrals` provides the transforms
as matrices on graded panels, and `uniform_grid` as matrices on a uniform grid. `revolution` contains the profiles of
bodies. `power_law_contact` contains closed forms for the contacts of power-law bodies.
"""
