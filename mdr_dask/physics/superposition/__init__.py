"""Master curves: curves measured in groups, shifted along their axes until they are one.

Read `master_curve` first, which says what is asked and what comes out. `problem` holds the points and what is known of
shifts without them, `least_squares` the compiled fit of shifts and spline, `steps` the scans that tell how far
neighbours lie apart, also on a plateau, and `factors` puts the three together. `two_factors` splits shifts into sums
of two, `laws` fits WLF, Arrhenius and powers of the velocity to them.
"""
