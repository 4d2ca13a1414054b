"""Oils defined in a campaign: by two viscosities of a data sheet, or by a table of measured viscosities."""

from __future__ import annotations

from functools import lru_cache
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.headings import Column
from mdr_dask.models.base import Alternatives, Parameters, quantity
from mdr_dask.models.data_file import DataFile, NamedFile
from mdr_dask.physics.lubrication.oil import Oil, density_at, kinematic_viscosity, walther_constants
from mdr_dask.tables import read_columns, read_sheet
from mdr_dask.units import converts, shown

_TWO = ("temperature_1", "viscosity_1", "temperature_2", "viscosity_2")


class OilData(Parameters):
    """An oil, given by the numbers of a data sheet or by a table of viscosities."""

    alternatives: ClassVar[tuple[Alternatives, ...]] = ((_TWO, ("viscosities",)),)
    temperature_1: float | None = quantity(
        "K", "temperature at which viscosity_1 was measured", usual="40 degC", gt=0, default=None
    )
    viscosity_1: float | None = quantity(
        "m^2/s", "kinematic viscosity at temperature_1", usual="320 mm^2/s", gt=0, default=None
    )
    temperature_2: float | None = quantity(
        "K", "temperature at which viscosity_2 was measured", usual="100 degC", gt=0, default=None
    )
    viscosity_2: float | None = quantity(
        "m^2/s", "kinematic viscosity at temperature_2", usual="40 mm^2/s", gt=0, default=None
    )
    viscosities: NamedFile | None = Field(
        default=None,
        description='table with the columns "temperature" and "kinematic viscosity" (or "dynamic viscosity"), given in '
        "place of the two viscosities; Walther's law is fitted to the table",
    )
    density: float = quantity(
        "kg/m^3", "density of the oil at density_temperature", usual="870 kg/m^3, 0.87 g/cm^3", gt=0
    )
    density_temperature: float = quantity(
        "K", "temperature at which the density was measured", usual="15 degC", default=288.15, gt=0
    )
    correlation: Literal["gold_mineral", "gold_polyalphaolefin"] = Field(
        default="gold_mineral",
        description="correlation that gives the pressure-viscosity coefficient as a function of the viscosity",
    )
    lowest_temperature: float | None = quantity(
        "K",
        "lowest allowed temperature; by default the lowest temperature at which the viscosity is given",
        usual="20 degC",
        default=None,
        gt=0,
    )
    highest_temperature: float | None = quantity(
        "K",
        "highest allowed temperature; by default the highest temperature at which the viscosity is given",
        usual="100 degC",
        default=None,
        gt=0,
    )

    @model_validator(mode="after")
    def _is_an_oil(self, info: ValidationInfo) -> OilData:
        self.require_one_alternative()
        if self.viscosities is None or info.context is not None:  # outside a campaign, the table is not read
            try:
                T1, nu1, T2, nu2 = self.two_viscosities
                walther_constants((T1, T2), (nu1, nu2))
            except DataError as problem:
                raise ValueError(str(problem)) from None
        return self

    @property
    def two_viscosities(self) -> tuple[float, float, float, float]:
        """Two temperatures in K, each followed by the kinematic viscosity in m^2/s at this temperature.

        Either the user gives these numbers, or they are the lowest and the highest temperature of the table, with the
        viscosities that the fitted law gives there.
        """
        if self.viscosities is not None:
            found = _fitted(self.viscosities, self.density, self.density_temperature)
            low, high = float(found.temperature[0]), float(found.temperature[-1])
            return low, found.at(low), high, found.at(high)
        given = (getattr(self, name) for name in _TWO)
        first, viscosity_1, second, viscosity_2 = given
        return first, viscosity_1, second, viscosity_2

    @property
    def oil(self) -> Oil:
        """The oil that these data define."""
        one, _, two, _ = data = self.two_viscosities
        low, high = self.lowest_temperature or min(one, two), self.highest_temperature or max(one, two)
        return Oil(*data, self.density, self.density_temperature, self.correlation, low, high)

    def notes(self) -> tuple[str, ...]:
        """Return notes about the fit of Walther's law to the table, and about extrapolated viscosities."""
        notes = []
        if self.viscosities is not None:
            found = _fitted(self.viscosities, self.density, self.density_temperature)
            temperature, off = found.temperature, 100 * found.departures
            worst = int(np.argmax(abs(off)))
            first, last = (found.at(float(temperature[end])) * 1e6 for end in (0, -1))
            notes.append(
                f"table {self.viscosities.name}: Walther's law (ASTM D341) fitted to {off.size} kinematic viscosities, "
                f"{first:.4g} to {last:.4g} mm^2/s; largest deviation {off[worst]:+.2g} % "
                f"at {shown(float(temperature[worst]), 'K')}"
            )
        one, _, two, _ = self.two_viscosities
        ends = ((self.lowest_temperature, min(one, two), "below"), (self.highest_temperature, max(one, two), "above"))
        for wanted, end, side in ends:
            if wanted is not None and (wanted < end if side == "below" else wanted > end):
                notes.append(
                    f"oil: the viscosity is extrapolated {side} {shown(end, 'K', 9)}, to {shown(wanted, 'K', 9)}"
                )
        return tuple(notes)


class _Fit(NamedTuple):
    """Walther's law fitted to a table.

    `temperature` contains the temperatures of the table in K, in ascending order. `departures` are the relative
    deviations of the measured viscosities from the law.
    """

    temperature: FloatArray
    constants: tuple[float, float]
    departures: FloatArray

    def at(self, temperature: float) -> float:
        """Return the kinematic viscosity in m^2/s according to the law."""
        return float(kinematic_viscosity(temperature, *self.constants))


@lru_cache(maxsize=16)
def _fitted(file: DataFile, density: float, density_temperature: float) -> _Fit:
    """Fit Walther's law to a table of viscosities. Raise DataError if no fit is possible."""
    sheet = read_sheet(file.read_text(), file.name)
    is_dynamic = any(converts(unit, "Pa s") for unit in sheet.units)
    viscous = Column("dynamic viscosity", "Pa s", above=0)
    if not is_dynamic:
        viscous = Column("kinematic viscosity", "m^2/s", above=0)
    table = read_columns(sheet, (Column("temperature", "K", above=0), viscous))
    order = np.argsort(table["temperature"])
    temperature, viscosity = table["temperature"][order], table[viscous.name][order]
    if is_dynamic:
        viscosity = viscosity / density_at(temperature, density, density_temperature)
    try:
        constants = walther_constants(temperature, viscosity)
    except ValueError as problem:
        raise DataError(f"{file.name}: {problem}") from None
    return _Fit(temperature, constants, viscosity / kinematic_viscosity(temperature, *constants) - 1)
