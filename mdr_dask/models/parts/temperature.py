"""Parameters of the laws that give the factor a_T as a function of the temperature.

The relaxation times at a temperature are a_T times the relaxation times at the reference temperature.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.headings import Column
from mdr_dask.models.base import Parameters, quantity
from mdr_dask.models.data_file import NamedByFile, NamedFile, check_in_campaign
from mdr_dask.tables import read_table
from mdr_dask.units import shown


class Wlf(Parameters):
    """The law of Williams, Landel and Ferry."""

    c1: float = quantity("1", "constant c1 of log10 a_T = -c1 (T - reference)/(c2 + T - reference)", usual="17.4", gt=0)
    c2: float = quantity(
        "K", "constant c2 in the formula log10 a_T = -c1 (T - reference)/(c2 + T - reference)", usual="51.6 K", gt=0
    )
    reference: float = quantity("K", "reference temperature for c1 and c2, at which a_T = 1", usual="20 degC", gt=0)

    def factor(self, temperature: FloatArray | float) -> FloatArray:
        """Return a_T for temperatures in K. Raise ValueError at or below reference - c2, where the law diverges."""
        from mdr_dask.physics.solids import wlf_factor

        lowest, end = float(np.min(temperature)), self.reference - self.c2
        if lowest <= end:
            got, limit = shown(lowest, "K", 9), shown(end, "K", 9)
            raise ValueError(f"expected a temperature above {limit}, where wlf diverges (at reference - c2), got {got}")
        return wlf_factor(temperature, self.reference, self.c1, self.c2)


class Arrhenius(Parameters):
    """The law of Arrhenius, with an activation energy."""

    activation_energy: float = quantity(
        "J/mol", "activation energy E_a of a_T = exp(E_a/R (1/T - 1/reference))", usual="100 kJ/mol", gt=0
    )
    reference: float = quantity("K", "reference temperature, at which a_T = 1", usual="20 degC", gt=0)

    def factor(self, temperature: FloatArray | float) -> FloatArray:
        """Return a_T for temperatures in K, in the same shape."""
        from mdr_dask.physics.solids import arrhenius_factor

        return arrhenius_factor(temperature, self.reference, self.activation_energy)


class ShiftFactors(NamedByFile):
    """Measured shift factors. The user writes only the name of a file, or `file: name`."""

    file: NamedFile = Field(
        description='table with a column "temperature" and a column "a_T" or "log10 a_T"; the value 1 must lie within '
        "the range of a_T"
    )

    @model_validator(mode="after")
    def _holds_factors(self, info: ValidationInfo) -> ShiftFactors:
        check_in_campaign(info, lambda: self.reference)
        return self

    @property
    def reference(self) -> float:
        """Temperature in K at which a_T is 1."""
        temperature, decades = _shifts(self)
        return float(np.interp(0.0, decades[::-1], temperature[::-1]))

    def factor(self, temperature: FloatArray | float) -> FloatArray:
        """Return a_T for temperatures in K, by linear interpolation of log a_T. Raise ValueError outside the table."""
        known, decades = _shifts(self)
        wanted = np.asarray(temperature, dtype=np.float64)
        for outside in wanted[(wanted < known[0]) | (wanted > known[-1])].ravel():
            got, first, last = (shown(float(each), "K", 9) for each in (outside, known[0], known[-1]))
            raise ValueError(
                f"{self.file.name}: expected a temperature in the range of the table, {first} to {last}, got {got}"
            )
        return np.asarray(10 ** np.interp(wanted, known, decades), dtype=np.float64)


@lru_cache(maxsize=16)
def _shifts(factors: ShiftFactors) -> tuple[FloatArray, FloatArray]:
    """Return the temperatures of a table in ascending order, and the decreasing values of log10 a_T."""
    name = factors.file.name
    columns = (
        Column("temperature", "K", above=0),
        Column("a_T", "1", ("aT", "a(T)", "shift factor"), needed=False, above=0),
        Column("log10 a_T", "1", ("log aT", "log a_T", "log10 aT", "log10(aT)", "log(aT)"), needed=False),
    )
    table = read_table(factors.file.read_text(), name, columns, ways=(("log10 a_T",), ("a_T",)))
    decades = np.log10(table["a_T"]) if "a_T" in table else table["log10 a_T"]
    order = np.argsort(table["temperature"])
    temperature, decades = table["temperature"][order], decades[order]
    if order.size < 2 or np.any(np.diff(temperature) <= 0) or np.any(np.diff(decades) >= 0):
        raise DataError(
            f"{name}: expected two or more different temperatures, and values of a_T that decrease with the temperature"
        )
    if not decades[-1] <= 0 <= decades[0]:
        raise DataError(
            f"{name}: expected a range of a_T that contains 1, which is the value at the reference temperature"
        )
    return temperature, decades


Law = Wlf | Arrhenius | ShiftFactors
