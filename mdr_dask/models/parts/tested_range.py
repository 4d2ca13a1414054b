"""Messages about cases outside the range in which the method was tested for measured surfaces (docs/validity.md)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.parts.indenter import Plane
from mdr_dask.models.parts.rough_line import OfSurface
from mdr_dask.models.parts.sliding_body import SlidingBody
from mdr_dask.models.parts.sliding_problem import Setting

LARGEST_LOAD = 1.0
"""Largest tested load F_N / (E* L h). For an incompressible solid, E* = 4 G.

At higher loads the line comes much closer to full contact than the surface that it represents.
"""
LARGEST_FRACTION = 0.5  # largest tested fraction of the line in contact
PAGE = "docs/validity.md"


def load_notes(sets: Sequence[SlidingBody]) -> tuple[str, ...]:
    """Return a note if the largest load of a study exceeds `LARGEST_LOAD`.

    Only plane bodies with the spectrum of a measured surface are checked.
    """
    from mdr_dask.models.parts.material import solid_of

    loads = []
    for one in sets:
        if one.surface is None or one.surface.profile is not None or not isinstance(one.indenter, Plane):
            continue
        assert one.length is not None
        try:
            modulus = one.shear_modulus if one.material is None else solid_of(one.material).static_modulus
            height, force = OfSurface(one.surface, one.points, one.length).height(), one.largest_force()
        except (DataError, ValueError):  # the solver reports the problem for each case
            continue
        loads.append(force / (4 * (modulus or np.inf) * one.length * height))
    largest = max(loads, default=0.0)
    if largest <= LARGEST_LOAD:
        return ()
    return (
        f"F_N / (E* L h) reaches {largest:.2g}; above {LARGEST_LOAD:g}, the computed friction is too small "
        f"by a factor that grows with the load ({PAGE})",
    )


def beyond_tested(setting: Setting, loads: FloatArray, fractions: FloatArray) -> dict[int, str]:
    """Return a message for every case outside the tested range. The key is the index of the case.

    `loads` are F_N / (4 G_inf L h), and `fractions` are the fractions of the line in contact. For a loading history,
    loads and fractions are the largest values during the history. Only plane bodies with the spectrum of a measured
    surface are checked. There are no messages for other bodies.
    """
    if setting.body is not None or not isinstance(setting.roughness, OfSurface):
        return {}
    heavy, full = loads > LARGEST_LOAD, fractions > LARGEST_FRACTION
    messages = {}
    for k in np.flatnonzero(heavy | full):
        reasons = [f"F_N / (E* L h) above {LARGEST_LOAD:g}"] * int(heavy[k])
        reasons += [f"more than {LARGEST_FRACTION:g} of the line in contact"] * int(full[k])
        messages[int(k)] = f"outside the range tested for friction on a rough surface ({PAGE}): {', '.join(reasons)}"
    return messages
