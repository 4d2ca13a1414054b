"""Parameters of a table of moduli from a dynamic mechanical analysis, and computation of one curve of moduli."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.errors import DataError
from mdr_dask.headings import Column, is_called, plain
from mdr_dask.models.base import quantity
from mdr_dask.models.data_file import NamedByFile, NamedFile, check_in_campaign
from mdr_dask.models.parts.temperature import Law
from mdr_dask.tables import Read, read_sheet, read_table
from mdr_dask.units import shown

#: Patterns for the names of columns with moduli in tension, or with moduli in shear. `plain` simplifies a name first.
_IN_TENSION = re.compile(r"(?<!\w)e(?:'|\*|1|2| ?stor| ?loss|$)|young|tensile|tension", re.IGNORECASE)
_IN_SHEAR = re.compile(r"(?<!\w)g(?:'|\*|1|2| ?stor| ?loss|$)|shear", re.IGNORECASE)
#: Pairs of columns. Each pair determines storage and loss modulus.
WAYS = (("storage modulus", "loss modulus"), ("storage modulus", "tan delta"), ("complex modulus", "phase angle"))
#: Temperature difference in K. If the temperatures of a table are sorted, neighbouring temperatures that differ by at
#: most this value belong to one curve.
SAME_TEMPERATURE = 1.0


class ModulusTable(NamedByFile):
    """A Prony series fitted to a table of frequencies and moduli, which are measured at one or more temperatures."""

    renamed: ClassVar[Mapping[str, str]] = {"arms_per_decade": "write terms_per_decade"}
    file: NamedFile = Field(
        description='table with a column "frequency" and one pair of columns: "storage modulus" and "loss modulus", '
        '"storage modulus" and "tan delta", or "complex modulus" and "phase angle"; a column "temperature" is optional'
    )
    frequency_unit: str = Field(default="", description="unit of the frequencies, if the table does not state it")
    modulus_unit: str = Field(default="", description="unit of the moduli, if the table does not state it")
    table_temperature: float | None = quantity(
        "K",
        "use only the curves that were measured at this temperature. If the table has no column of temperatures, this "
        "is the temperature of all its rows",
        usual="20 degC",
        default=None,
        gt=0,
    )
    reference: float | None = quantity(
        "K",
        "reference temperature; the curves of all other temperatures are shifted along the frequency until they "
        "overlap. If neither reference nor table_temperature is given, the curves are shifted by wlf, arrhenius or "
        "shift_factors",
        usual="20 degC",
        default=None,
        gt=0,
    )
    vertical: Literal["modulus", "none"] = Field(
        default="modulus",
        description="modulus: the moduli at the temperature T are multiplied by b_T = rho0 T0 / (rho T), with the "
        "densities rho0 at the reference temperature T0 and rho at T. none: the moduli are not multiplied",
    )
    poisson_ratio: float | None = quantity(
        "1",
        "Poisson's ratio nu, if the moduli were measured in tension; the moduli are then divided by 2 (1 + nu)",
        default=None,
        ge=-1,
        le=0.5,
    )
    terms_per_decade: float = quantity(
        "1", "number of Prony terms for each decade of the relaxation times", default=1.0, gt=0, le=5
    )

    @model_validator(mode="after")
    def _holds_moduli(self, info: ValidationInfo) -> ModulusTable:
        check_in_campaign(info, lambda: _measured(self))
        return self

    def notes(self) -> tuple[str, ...]:
        """Return notes on unused columns and rows, and on moduli that are assumed to be shear moduli."""
        table = _table(self)
        heading = table.headings["storage modulus"]
        notes = [table.remark] if table.remark else []
        if self.poisson_ratio is None and not _IN_SHEAR.search(plain(heading)):
            name = f"column {heading!r}" if heading else "the second column"
            notes.append(f"{name} is taken as a shear modulus (give poisson_ratio if it was measured in tension)")
        return tuple(f"table {self.file.name}: {note}" for note in notes)


@dataclass(frozen=True)
class Moduli:
    """One curve of moduli: angular frequency in rad/s, storage and loss modulus in Pa.

    `temperature` is the temperature of the curve in K, and `measured` are the lowest and the highest temperature of the
    table in K. Without a stated temperature, `temperature` and `measured` are None. `superposed` describes how the
    curves of several temperatures were superposed, and is empty if they were not.
    """

    omega: FloatArray
    storage: FloatArray
    loss: FloatArray
    temperature: float | None
    measured: tuple[float, float] | None
    superposed: str = ""


@lru_cache(maxsize=64)
def one_curve(chosen: ModulusTable, law: Law | None) -> Moduli:
    """Return the shear moduli of a table at one temperature.

    The curves of several temperatures are superposed, unless the user chooses one temperature. Raise DataError if the
    user gives neither a temperature nor a way to superpose the curves.
    """
    found = _as_measured(chosen, law)
    divisor = 1.0 if chosen.poisson_ratio is None else 2 * (1 + chosen.poisson_ratio)
    return replace(found, storage=found.storage / divisor, loss=found.loss / divisor)


def _as_measured(chosen: ModulusTable, law: Law | None) -> Moduli:
    """Return the moduli at one temperature: shear moduli or moduli in tension, whichever the table contains."""
    omega, storage, loss, temperature = _measured(chosen)
    if temperature is None:
        if chosen.reference is not None:
            raise DataError(
                f"{chosen.file.name}: expected a column 'temperature', because `reference` is given: add the column; "
                "if all rows were measured at one temperature, give `table_temperature` in place of `reference`"
            )
        only = chosen.table_temperature
        return Moduli(omega, storage, loss, only, None if only is None else (only, only))
    ends = float(temperature.min()), float(temperature.max())
    if _near(temperature, float(temperature.mean())).all():
        return Moduli(omega, storage, loss, float(temperature.mean()), ends)
    if chosen.table_temperature is not None:
        near = _near(temperature, chosen.table_temperature)
        return Moduli(omega[near], storage[near], loss[near], chosen.table_temperature, ends)
    member, levels = _levels(temperature)
    if chosen.reference is not None:
        reference = chosen.reference
        across, along, text = _superposed(chosen)
        shift, rise = 10**across, 10**along
        text = f"the overlap of both moduli, {_vertical(chosen)}{text}{_compared(levels, across, law, reference)}"
    elif law is not None:
        reference, text = law.reference, f"the given shift factors, moduli {_vertical(chosen)}"
        shift, rise = law.factor(levels), vertical_factor(chosen, levels, reference)
    else:
        raise DataError(
            f"{chosen.file.name}: has several temperatures: choose one by `table_temperature`, or superpose the "
            "curves by giving `reference` or a law (`wlf`, `arrhenius` or `shift_factors`)"
        )
    text = f"superposed at {shown(reference, 'K')} by {text}"
    return Moduli(omega * shift[member], storage * rise[member], loss * rise[member], reference, ends, text)


def _near(temperature: FloatArray, wanted: float) -> FloatArray:
    return np.asarray(np.abs(temperature - wanted) <= SAME_TEMPERATURE)


def _levels(temperature: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return, for every row, the index of its curve, and the mean temperature of each curve in ascending order."""
    order = np.argsort(temperature, kind="stable")
    member = np.empty(order.size, dtype=np.intp)
    member[order] = np.append(0, np.cumsum(np.diff(temperature[order]) > SAME_TEMPERATURE))
    return member, np.array([temperature[member == number].mean() for number in range(int(member.max()) + 1)])


def vertical_factor(chosen: ModulusTable, temperature: FloatArray, reference: float) -> FloatArray:
    """Return b_T = rho0 T0 / (rho T), the vertical factor of moduli, for each temperature T in K.

    A modulus at T, multiplied by b_T, becomes a modulus at the reference temperature T0. The densities at T0 and T are
    rho0 and rho. With the option `vertical: none`, b_T is 1.
    """
    from mdr_dask.physics.superposition.master_curve import known_rise

    return np.asarray(10 ** known_rise(np.append(reference, temperature), chosen.vertical)[1:], dtype=np.float64)


def _vertical(chosen: ModulusTable) -> str:
    """Return a text that says whether moduli are multiplied by b_T, and that states the thermal expansion in b_T."""
    from mdr_dask.physics.superposition.master_curve import EXPANSION

    if chosen.vertical == "none":
        return "not multiplied by b_T"
    return f"multiplied by b_T = rho0 T0 / (rho T), with an expansion of {EXPANSION:g} 1/K"


@lru_cache(maxsize=16)
def _superposed(chosen: ModulusTable) -> tuple[FloatArray, FloatArray, str]:
    """Return log10 of the horizontal and the vertical shift factor of each temperature, and a text.

    The text states log10 a_T at the lowest and the highest temperature, and the ranges of temperature in which shift
    factors are not determined. Raise DataError if the reference temperature lies outside the table.
    """
    from mdr_dask.physics.superposition.master_curve import rereference, superpose

    omega, storage, loss, temperature = _measured(chosen)
    assert temperature is not None
    assert chosen.reference is not None
    member, levels = _levels(temperature)
    if not levels[0] <= chosen.reference <= levels[-1]:
        raise DataError(
            f"{chosen.file.name}: expected a reference between {shown(levels[0], 'K')} and {shown(levels[-1], 'K')}, "
            f"got {shown(chosen.reference, 'K')}"
        )
    x, y = np.log10(omega), np.log10([storage, loss])
    parts = [member == number for number in range(levels.size)]
    free = superpose(levels, [(x[part], y[:, part]) for part in parts], chosen.vertical)
    found = rereference(free, chosen.reference)
    low, high = found.interval()[:, : levels.size]
    ends = ", ".join(
        f"{found.horizontal[k]:.2f} ({low[k]:.2f}, {high[k]:.2f}) at {shown(levels[k], 'K')}" for k in (0, -1)
    )
    text = f", log10 a_T (95 %) {ends}"
    if found.undetermined:
        runs = " and ".join(f"{shown(a, 'K')} to {shown(b, 'K')}" for a, b in found.undetermined)
        text += f"; shift factors are not determined in the range {runs}: give wlf, arrhenius or shift_factors instead"
    return found.horizontal, found.vertical, text


def _compared(levels: FloatArray, decades: FloatArray, law: Law | None, reference: float) -> str:
    """Return a text with the largest difference between the shift factors of the curves and of `law`.

    If there is a temperature at which `law` does not apply, the text gives the reason. Without a law, it is empty.
    """
    if law is None:
        return ""
    try:
        apart = np.abs(decades - np.log10(law.factor(levels) / law.factor(reference)))
    except ValueError as error:
        return f"; these shift factors cannot be compared with the given ones ({error})"
    worst = int(apart.argmax())
    return (
        f"; these shift factors differ from the given ones by up to {apart[worst]:.2g} decades (at "
        f"{shown(levels[worst], 'K')})"
    )


def moduli_of(columns: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return storage and loss modulus, computed from the columns of one of the `WAYS`. The phase angle is in rad."""
    if "complex modulus" in columns:
        size, angle = columns["complex modulus"], columns["phase angle"]
        return size * np.cos(angle), size * np.sin(angle)
    storage = columns["storage modulus"]
    return storage, columns["loss modulus"] if "loss modulus" in columns else storage * columns["tan delta"]


def _table(chosen: ModulusTable) -> Read:
    """Return the columns of the file, including storage and loss modulus. Incomplete rows are left out."""
    name, content = chosen.file.name, chosen.file.read_text()

    def modulus(kind: str, *other_names: str) -> Column:
        return Column(kind, "Pa", other_names, needed=False, above=0, given_unit=chosen.modulus_unit)

    columns = (
        Column("frequency", "rad/s", above=0, given_unit=chosen.frequency_unit),
        modulus("storage modulus", "tensile storage modulus", "Young's modulus"),
        modulus("loss modulus", "tensile loss modulus"),
        Column("temperature", "K", needed=False, above=0),
        Column("tan delta", "1", needed=False, above=0),
        modulus("complex modulus"),
        Column("phase angle", "rad", needed=False, above=0),
    )
    try:
        table = read_table(content, name, columns, allow_missing=True, ways=WAYS)
    except DataError as problem:
        headings = read_sheet(content, name).names
        has = {name: any(is_called(each, name) for each in headings) for name in ("time", "frequency")}
        if has["time"] and not has["frequency"]:
            raise DataError(
                f"{name}: moduli against time cannot be used as a material: expected frequency, storage and loss "
                "modulus (`mdr-dask master-curve` merges relaxation curves)"
            ) from problem
        raise
    table.leave_out_incomplete()
    if table["frequency"].size < 2:
        raise DataError(f"{name}: expected at least two rows with all numbers, got {table['frequency'].size}")
    if "complex modulus" in table:
        table.headings = {**table.headings, "storage modulus": table.headings["complex modulus"]}
    storage, loss = moduli_of(table)
    table.update({"storage modulus": storage, "loss modulus": loss})
    return table


def _measured(chosen: ModulusTable) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray | None]:
    """Return angular frequency, storage modulus, loss modulus and temperature of each row, in SI units.

    The temperature is None if the table has no such column. Raise DataError if the table contradicts `chosen`.
    """
    name, table = chosen.file.name, _table(chosen)
    omega, storage, loss = (table[column] for column in ("frequency", "storage modulus", "loss modulus"))
    temperature, wanted = table.get("temperature"), chosen.table_temperature
    if temperature is not None and wanted is not None and np.count_nonzero(_near(temperature, wanted)) < 2:
        _, levels = _levels(temperature)
        known = ", ".join(shown(level, "K") for level in levels[:12])
        raise DataError(f"{name}: expected two or more rows at {shown(wanted, 'K')}; the table was measured at {known}")
    heading, others = table.headings["storage modulus"], read_sheet(chosen.file.read_text(), name).names
    is_shear = bool(_IN_SHEAR.search(plain(heading)))
    if is_shear and chosen.poisson_ratio is not None:
        raise DataError(f"{name}: column {heading!r} is a shear modulus: leave out poisson_ratio")
    tension = [each for each in (heading, *others) if _IN_TENSION.search(plain(each))]
    if tension and not is_shear and chosen.poisson_ratio is None:
        raise DataError(
            f"{name}: column {tension[0]!r} is a modulus in tension: give poisson_ratio (0.5 for rubber), or name the "
            "columns G' and G'' if they are shear moduli"
        )
    return omega, storage, loss, temperature
