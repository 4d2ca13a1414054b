"""Master curves: curves measured in groups, shifted along their axes until they are one.

Read `master_curve` first, which defines the question and the answer. `posterior` holds the probability density of
shifts and its gradient, `sampling` draws from it. `two_factors` splits shifts into sums of two, `laws` fits WLF,
Arrhenius and powers of the velocity to them.
"""
