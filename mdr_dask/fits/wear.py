"""Wear coefficient and xi of fretting wear from a measured table, named by the campaign's parameter ``measured``."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from pydantic import ValidationError

from mdr_dask.errors import DataError, FitError
from mdr_dask.fits.base import Fit
from mdr_dask.models.base import Block
from mdr_dask.models.fretting_wear.declaration import FrettingWear, Pressed
from mdr_dask.models.fretting_wear.reduction import reduce_block, table_profile
from mdr_dask.tables import Column, read_sheet, read_table

if TYPE_CHECKING:
    from mdr_dask.physics.wear.factor import Measured

MODELS = ("fretting_wear",)


def wear_coefficient(groups: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Fit the wear coefficient, or in a dimensionless campaign the factor from cycles to N."""

    def describe(parameters: FrettingWear) -> tuple[str, float, str]:
        if parameters.wear_coefficient:
            return "wear_coefficient", parameters.wear_coefficient, "wear coefficient k"
        return "cycle_factor", 1.0, "units N of wear in one cycle of the table"

    return _fit(groups, describe, lambda parameters: parameters.wear_rule)


def best_xi(groups: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Fit xi of the fast rule, the wear coefficient being known."""
    return _fit(groups, lambda parameters: ("xi", parameters.xi, "factor of the fast rule"), lambda _: "fast")


def _fit(
    groups: Mapping[str, xr.Dataset],
    describe: Callable[[FrettingWear], tuple[str, float, str]],
    choose: Callable[[FrettingWear], str],
) -> xr.Dataset:
    """Fit one factor in every series that names a table."""
    from mdr_dask.physics.wear.factor import fit_factor

    found: dict[str, dict[str, float | str]] = {}
    meanings: dict[str, tuple[str, str]] = {}
    for series, dataset in groups.items():
        try:
            parameters = FrettingWear.model_validate(json.loads(dataset.attrs["parameters"]))
        except ValidationError:
            raise FitError("the store was made with parameters of an older version; run its campaign again") from None
        if parameters.measured is None:
            continue
        name, start, meaning = describe(parameters)
        try:
            factor = fit_factor(*_prediction(parameters, choose(parameters)))
        except ValueError as problem:
            raise FitError(str(problem)) from None
        ends = {"": factor.value, "_low": factor.low, "_high": factor.high}
        row: dict[str, float | str] = {name + end: start * value for end, value in ends.items()}
        row |= {"residual": factor.residual, "explained": factor.explained, "law_holds": factor.law_holds}
        found[series] = row
        meanings |= {name + end: ("1", meaning) for end in ends}
    if not found:
        raise FitError("no series names a table of measurements; give the parameter measured: table.csv")
    meanings["residual"] = (
        "1",
        "root mean square deviation: over given errors, else relative for volumes, in d0 for f",
    )
    meanings["explained"] = ("1", "share of the variance explained")
    meanings["law_holds"] = ("1", "whether the law holds")
    return _dataset(found, meanings)


def _dataset(found: dict[str, dict[str, float | str]], meanings: dict[str, tuple[str, str]]) -> xr.Dataset:
    series = list(found)
    return xr.Dataset(
        {
            name: (
                ("series",),
                [found[one].get(name, np.nan) for one in series],
                {"units": unit, "long_name": long_name},
            )
            for name, (unit, long_name) in meanings.items()
        },
        coords={"series": series},
    )


def _prediction(parameters: FrettingWear, rule: str) -> tuple[Callable[[float], np.ndarray], Measured, np.ndarray]:
    """Return what the law predicts for a factor of N, the measurements, dimensionless, and what they are ordered by."""
    from mdr_dask.physics.mdr.revolution import PowerProfile
    from mdr_dask.physics.wear.factor import Law, Measured

    if rule not in {"fast", "exact"}:
        raise FitError(f"a wear law is fitted by wear_rule fast or exact, got {rule!r}")
    numbers, problems = reduce_block(Block(parameters, {}, 1, (0,), 0, ()))
    if problems:
        raise FitError(problems[0, 0])
    if not numbers.level[0, 0] > 0.0:
        raise FitError("the amplitude is in gross slip: the law of partial slip cannot be fitted")
    table, depth = isinstance(parameters.indenter, Pressed), float(numbers.height[0, 0])
    profile = table_profile(parameters.indenter, depth) if table else PowerProfile(float(numbers.exponent[0, 0]))
    stick = profile.inside(float(numbers.level[0, 0]))
    law = Law(profile, stick, rule, parameters.xi, parameters.hold == "force")
    columns, length = read_measured(parameters), float(numbers.length[0, 0])
    errors = columns.get("error")
    if "volume" in columns:
        unit, cycles = length**2 * depth, columns["cycles"] * float(numbers.advance[0, 0])
        worn = cycles > 0.0
        if not np.any(worn):
            raise FitError("the measurements do not depend on the factor: no row has cycles")
        curve = law.volumes()
        data = Measured(columns["volume"][worn] / unit, None if errors is None else errors[worn] / unit)
        return lambda factor: curve(factor * cycles[worn]), data, cycles[worn]
    heights = law.profiles(columns["radius"] / length)
    total = float(numbers.cycles[0, 0])
    data = Measured(columns["height"] / depth, None if errors is None else errors / depth, relative=False)
    return lambda factor: heights(factor * total), data, columns["radius"]


_VOLUMES = (Column("cycles", "1", least=0.0), Column("volume", "m^3", given_unit="m^3"))
_PROFILE = (Column("radius", "m", least=0.0, given_unit="m"), Column("height", "m", given_unit="m"))


def read_measured(parameters: FrettingWear) -> dict[str, np.ndarray]:
    """Read the campaign's table of measurements.

    Parameters
    ----------
    parameters : FrettingWear
        Names a table with the columns ``cycles, volume`` (m3) or ``radius, height`` (m), or without units in a
        dimensionless campaign, and perhaps ``error``, the standard error of volume or height.

    Returns
    -------
    dict of str to array
        The columns by name.

    Raises
    ------
    DataError
        If there is no table, or it does not hold such columns of finite numbers.
    """
    if parameters.measured is None:
        raise DataError("there is no table of measurements; give the parameter measured: table.csv")
    file = parameters.measured
    text = file.read_text()
    sheet = read_sheet(text, file.name)
    held = [cell.text.strip().lower() for cell in sheet.names]
    columns = _VOLUMES if "volume" in held else _PROFILE
    if not {column.name for column in columns} <= set(held):
        raise DataError(f"{file.name}: expected the columns cycles, volume or radius, height, got {held!r}")
    error = Column("error", columns[1].unit, needed=False, above=0.0, given_unit=columns[1].unit)
    return read_table(text, file.name, (*columns, error))


FITS: tuple[Fit, ...] = (
    Fit("wear_coefficient", MODELS, "V(N) or f(r) of the exact or fast rule, N = k cycles ...: k", wear_coefficient),
    Fit("xi", MODELS, "V(N) or f(r) of the fast rule at known k: xi", best_xi),
)
