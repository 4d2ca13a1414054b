"""Messages that compare a number with a limit: the two never read the same."""

import re

import numpy as np
import pytest
import xarray as xr

from mdr_dask.campaign.measured import LARGEST, require_readable
from mdr_dask.errors import DataError, distinguishable
from mdr_dask.fits.base import law_holds
from mdr_dask.fits.sensitivity import NARROW, _advice
from mdr_dask.models.parts.sliding_problem import refuse_immense
from mdr_dask.models.parts.temperature import Wlf
from mdr_dask.physics.solids import wlf_factor
from mdr_dask.physics.surfaces.maps import MOST_MISSING, SurfaceMap, filled
from mdr_dask.questions.selection import written_apart
from mdr_dask.units import shown_apart

JUST = 1 + 1e-9


def test_a_number_and_its_limits_have_the_fewest_digits_that_tell_them_apart():
    assert distinguishable(1.2345, 1.0) == ("1.23", "1")
    assert distinguishable(1.0001, 1.0) == ("1.0001", "1")
    assert distinguishable(1.0001, 1.0, 1.0002, digits=2) == ("1.0001", "1", "1.0002")
    assert distinguishable(2.0, 2.0) == ("2", "2")
    least = np.nextafter(0.1, 1)
    assert len(set(distinguishable(least, 0.1))) == 2
    assert shown_apart("m", 1e-3 * JUST, 1e-3) == ("1.000000001 mm", "1 mm")
    assert shown_apart("K", 293.15, 293.1501) == ("20 degC", "20.0001 degC")
    assert written_apart("m/s", 0.1 * JUST, 0.1, 2.0) == ("0.1000000001 m/s", "0.1 m/s", "2 m/s")


def refused(call) -> str:
    with pytest.raises((DataError, ValueError)) as raised:
        call()
    return str(raised.value)


def immense() -> str:
    faults: dict[int, str] = {}
    refuse_immense({"load": np.array([1e-100 / JUST])}, faults)
    return faults[0]


def holes() -> SurfaceMap:
    height = np.zeros((1000, 1000))
    height.flat[: int(MOST_MISSING * height.size) + 1] = np.nan
    return SurfaceMap(height, (1e-3, 1e-3))


def indices() -> xr.Dataset:
    ends = {f"{name}_{end}": ("input", [value]) for name in ("first", "total") for end, value in ENDS.items()}
    return xr.Dataset(ends, attrs={"cases": 100})


ENDS = {"low": 0.0, "high": 2 * NARROW * JUST}
#: Numbers just beyond a limit.
SAID = {
    "bytes of a table": lambda: refused(lambda: require_readable("x" * (LARGEST + 1), "rig.csv", "toy", (), ())),
    "holes of a map": lambda: refused(lambda: filled(holes())),
    "an immense number": immense,
    "a law that holds": lambda: law_holds(np.array([0.03, np.sqrt(0.0041)]) / JUST, 1.0),
    "an interval": lambda: _advice(indices()),
    "the end of wlf": lambda: refused(lambda: wlf_factor(250.0 / JUST, 300.0, 17.0, 50.0)),
    "the end of wlf in a campaign": lambda: refused(lambda: Wlf(c1=17.0, c2=50.0, reference=300.0).factor(250 / JUST)),
}


@pytest.mark.parametrize("what", SAID)
def test_no_number_reads_as_the_limit_that_it_misses(what):
    numbers = re.findall(r"(?<![\w.])-?\d[\d.]*(?:e[-+]?\d+)?", SAID[what]())
    assert len(numbers) > 1
    assert len({float(number) for number in numbers}) == len(numbers)
