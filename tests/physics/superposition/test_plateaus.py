"""Curves that end in a plateau: steps that they do not determine are named and have long intervals."""

import numpy as np

from benchmarks.solvers.curves import on_a_plateau
from mdr_dask.physics.superposition.master_curve import superpose


def test_steps_that_the_curves_do_not_determine_are_named():
    family = on_a_plateau(("decay", 8, 20, 0.02, 0.3), np.random.default_rng(1))
    found = superpose(10 * family.groups, family.curves)
    ((first, last),) = found.undetermined
    assert first == 0
    assert 10 <= last <= 40
    assert found.horizontal_error[0] > 20 * found.horizontal_error[-1]
    determined = on_a_plateau(("sigmoid", 5, 20, 0.005, 0.5), np.random.default_rng(1))
    assert superpose(determined.groups, determined.curves).undetermined == ()


def test_flat_noisy_curves_are_answered_with_intervals_as_long_as_a_curve():
    random = np.random.default_rng(1)
    x = np.linspace(-1, 1, 12)
    found = superpose(np.arange(4.0), [(x, 1 + 0.01 * random.standard_normal(12)) for _ in range(4)], reference=0.0)
    assert found.undetermined == ((0.0, 3.0),)
    assert found.horizontal_error[1] > 0.6
