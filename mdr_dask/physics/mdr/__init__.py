"""The transforms of the method of dimensionality reduction for bodies of revolution.

Read `transforms` first (the integrals, with an error estimate), then `half_integrals` (the same as matrices on graded
panels) and `uniform_grid` (the same on a uniform grid). `revolution` holds the profiles of bodies,
`power_law_contact` their contacts in closed form.
"""
