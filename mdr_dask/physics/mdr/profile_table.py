"""Tables of measured profiles of revolution: two columns, radius and height."""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray


def read_table(text: str) -> tuple[FloatArray, FloatArray]:
    """Read a table of a profile and check it.

    Parameters
    ----------
    text : str
        A header line, then rows ``radius,height``.

    Returns
    -------
    radius, height : array, shape (m,)
        In the unit of the table.

    Raises
    ------
    ValueError
        If the rows are not two numbers, or not a profile (see `check_table`).
    """
    rows = [line.split(",") for line in text.splitlines()[1:] if line.strip()]
    try:
        data = np.array([[float(row[0]), float(row[1])] for row in rows]).reshape(-1, 2)
    except (ValueError, IndexError) as problem:
        raise ValueError(f"a table of a profile needs two columns of numbers below its header: {problem}") from None
    check_table(data[:, 0], data[:, 1])
    return data[:, 0], data[:, 1]


def check_table(radius: FloatArray, height: FloatArray) -> None:
    """Raise ValueError unless a table of a profile starts at the axis, is finite and rises."""
    if radius.ndim != 1 or radius.shape != height.shape or radius.size < 4:
        raise ValueError(
            f"a profile needs two columns of at least 4 rows, got shapes {radius.shape!r} and {height.shape!r}"
        )
    if not (np.all(np.isfinite(radius)) and np.all(np.isfinite(height))):
        bad = int(np.argmin(np.isfinite(radius) & np.isfinite(height)))
        raise ValueError(
            f"a profile must be finite, got {float(radius[bad])!r}, {float(height[bad])!r} in row {bad + 1}"
        )
    if radius[0] != 0.0 or np.any(np.diff(radius) <= 0.0):
        raise ValueError(f"the radii of a profile must start at 0 and increase, got {float(radius[0])!r} first")
    if np.any(np.diff(height) <= 0.0):
        bad = int(np.argmax(np.diff(height) <= 0.0))
        raise ValueError(
            f"the profile must rise with the radius, got {float(height[bad + 1])!r} after {float(height[bad])!r} "
            f"at r = {float(radius[bad + 1])!r}"
        )
