"""Messages where a line stands for a measured surface outside the range that docs/validity.md has tested."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.parts.indenter import Plane
from mdr_dask.models.parts.sliding_body import SlidingBody

LARGEST_LOAD = 1.0
"""F_N / (E* L h), with E* = 4 G of an incompressible solid: beyond, lines come closer to full contact than surfaces."""
LARGEST_FRACTION = 0.5  # of the line in contact
PAGE = "docs/validity.md"


def load_notes(sets: Sequence[SlidingBody]) -> tuple[str, ...]:
    """Return a note if loads of a study lie beyond those for which friction on a rough surface was tested."""
    from mdr_dask.models.parts.material import solid_of
    from mdr_dask.models.parts.rough_line import OfSurface

    loads = []
    for one in sets:
        if one.surface is None or one.surface.profile is not None or not isinstance(one.indenter, Plane):
            continue
        assert one.length is not None
        try:
            modulus = one.shear_modulus if one.material is None else solid_of(one.material).static_modulus
            height = OfSurface(one.surface, one.points, one.length).height()
        except (DataError, ValueError):  # a message of the cases themselves
            continue
        loads.append(one.normal_force / (4 * (modulus or np.inf) * one.length * height))
    largest = max(loads, default=0.0)
    if largest <= LARGEST_LOAD:
        return ()
    return (
        f"F_N / (E* L h) of up to {largest:.2g}: above {LARGEST_LOAD:g} the friction of lines is too small "
        f"by a factor that grows with the load ({PAGE})",
    )


def beyond_tested(loads: FloatArray, fractions: FloatArray) -> dict[int, str]:
    """Return a message for every case outside the tested range, by the index of the case.

    Parameters
    ----------
    loads : array, shape (cases,)
        F_N / (4 G_inf L h).
    fractions : array, shape (cases,)
        Length in contact over length of the line.
    """
    heavy, full = loads > LARGEST_LOAD, fractions > LARGEST_FRACTION
    messages = {}
    for k in np.flatnonzero(heavy | full):
        reasons = [f"F_N / (E* L h) above {LARGEST_LOAD:g}"] * int(heavy[k])
        reasons += [f"more than {LARGEST_FRACTION:g} of the line in contact"] * int(full[k])
        messages[int(k)] = f"outside the range tested for friction on a rough surface ({PAGE}): {', '.join(reasons)}"
    return messages
