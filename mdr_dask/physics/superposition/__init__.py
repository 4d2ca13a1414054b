"""Master curves: measured curves, one for each group, are shifted along their axes until they form one curve.

Read `master_curve` first, which describes input and result. `posterior` computes the probability density of shifts and
the gradient of this density; `sampling` draws shifts from the density. `two_factors` splits each shift factor into a
sum of two factors. `laws` fits the WLF law, Arrhenius' law and powers of the velocity to shift factors.
"""
