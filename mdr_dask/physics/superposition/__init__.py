"""Master curves: curves measured in groups, shifted along their axes until they are one.

Read `master_curve` first, then `problem` and `least_squares` (the spline and its normal equations), `two_factors`
(shifts that are sums of two) and `laws` (WLF, Arrhenius, powers of the velocity). `posterior` samples vertical
shifts.
"""
