"""Messages that compare a number with a limit never print both alike."""

import numpy as np

from mdr_dask.errors import distinguishable
from mdr_dask.questions.selection import written_apart
from mdr_dask.units import shown_apart

JUST = 1 + 1e-9


def test_a_number_and_its_limits_have_the_fewest_digits_that_distinguish_them():
    assert distinguishable(1.2345, 1.0) == ("1.23", "1")
    assert distinguishable(1.0001, 1.0) == ("1.0001", "1")
    assert distinguishable(1.0001, 1.0, 1.0002, digits=2) == ("1.0001", "1", "1.0002")
    assert distinguishable(2.0, 2.0) == ("2", "2")
    least = np.nextafter(0.1, 1)
    assert len(set(distinguishable(least, 0.1))) == 2
    assert shown_apart("m", 1e-3 * JUST, 1e-3) == ("1.000000001 mm", "1 mm")
    assert shown_apart("K", 293.15, 293.1501) == ("20 degC", "20.0001 degC")
    assert written_apart("m/s", 0.1 * JUST, 0.1, 2.0) == ("0.1000000001 m/s", "0.1 m/s", "2 m/s")
