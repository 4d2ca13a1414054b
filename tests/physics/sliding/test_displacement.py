"""The displaced surface of a foundation against its definition: the largest of all that decays behind a contact."""

import numpy as np
import pytest

from mdr_dask.physics.sliding.displacement import displacement


@pytest.mark.parametrize("deborah", [0.02, 3.0, 1e4])
@pytest.mark.parametrize("periodic", [True, False])
def test_it_is_the_largest_of_what_decays(deborah, periodic):
    w = np.random.default_rng(1).standard_normal(60)
    n = w.size
    behind = np.arange(n)[:, None] - np.arange(n)[None, :]
    behind = np.where(behind < 0, behind + n if periodic else np.inf, behind)
    with np.errstate(under="ignore"):
        expected = np.max(np.maximum(w, 0.0)[None, :] * np.exp(-behind / deborah), axis=1)
    np.testing.assert_allclose(displacement(w, deborah, periodic), expected, rtol=1e-9, atol=1e-300)


def test_without_contact_nothing_is_displaced():
    assert np.all(displacement(-np.ones(10), 1.0, True) == 0)
