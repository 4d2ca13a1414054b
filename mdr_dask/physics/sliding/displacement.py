"""The displaced surface of a Kelvin foundation in steady sliding, on a grid, for figures of a contact."""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray


def displacement(penetration: FloatArray, deborah: float, periodic: bool) -> FloatArray:
    """Return how far the line pushes each element of a Kelvin foundation in.

    An element in contact has u = w. It leaves where u + v tau u' = 0, from where on u decays as exp(-x / (v tau)) until
    the line meets it again: u is the largest of w at a place and of all that decays from places met before.

    Parameters
    ----------
    penetration : array, shape (n,)
        w = depth + height at equidistant places, in the order in which an element meets them.
    deborah : float
        v tau over the distance of two places.
    periodic : bool
        Whether the line closes; if not, elements enter undeformed.

    Returns
    -------
    array, shape (n,)
        The displacement u >= w; both are equal in contact.
    """
    rounds = 2 if periodic else 1
    place = np.arange(rounds * penetration.size) / deborah
    with np.errstate(divide="ignore"):
        pushed = np.log(np.maximum(np.tile(penetration, rounds), 0.0)) + place
    kept: FloatArray = np.exp(np.maximum.accumulate(pushed) - place)[-penetration.size :]
    return kept
