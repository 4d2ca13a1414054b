"""Wear coefficient and xi of fretting wear from a measured table, named by the campaign's parameter ``measured``."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping

import numpy as np
import xarray as xr

from mdr_dask.errors import DataError, FitError
from mdr_dask.fit.base import Fit
from mdr_dask.models.base import Block
from mdr_dask.models.fretting_wear.parameters import FrettingWear, TableShape
from mdr_dask.models.fretting_wear.reduction import Numbers, reduce_block, table_profile

MODELS = ("fretting_wear",)


def wear_coefficient(groups: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Fit the wear coefficient, or in a dimensionless campaign the factor from cycles to N."""

    def describe(parameters: FrettingWear) -> tuple[str, float, str]:
        if parameters.wear_coefficient:
            return "wear_coefficient", parameters.wear_coefficient, "wear coefficient k"
        return "cycle_factor", 1.0, "units N of wear in one cycle of the table"

    return _fit(groups, describe, lambda parameters: parameters.method)


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

    found: dict[str, dict[str, float]] = {}
    meanings: dict[str, tuple[str, str]] = {}
    for series, dataset in groups.items():
        parameters = FrettingWear.model_validate(json.loads(dataset.attrs["parameters"]))
        if parameters.measured is None:
            continue
        name, start, meaning = describe(parameters)
        try:
            factor = fit_factor(*_prediction(parameters, choose(parameters)))
        except ValueError as problem:
            raise FitError(str(problem)) from None
        ends = {"": factor.value, "_low": factor.low, "_high": factor.high}
        row = {name + end: start * value for end, value in ends.items()}
        row |= {"residual": factor.residual, "explained": factor.explained}
        found[series] = row
        meanings |= {name + end: ("1", meaning) for end in ends}
    if not found:
        raise FitError("no series names a table of measurements; give the parameter measured: table.csv")
    meanings["residual"] = ("1", "root mean square deviation, in a0^2 d0 for volumes and d0 for profiles")
    meanings["explained"] = ("1", "share of the variance explained")
    return _dataset(found, meanings)


def _dataset(found: dict[str, dict[str, float]], meanings: dict[str, tuple[str, str]]) -> xr.Dataset:
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


def _prediction(parameters: FrettingWear, method: str) -> tuple[Callable[[float], np.ndarray], np.ndarray]:
    """Return what the law predicts for a factor of N, and the measurements, both dimensionless."""
    from mdr_dask.physics.mdr.revolution import PowerProfile
    from mdr_dask.physics.wear.factor import at_cycles, profile_curve, volume_curve

    if method not in {"fast", "exact"}:
        raise FitError(f"a wear law is fitted by method fast or exact, got {method!r}")
    numbers, problems = reduce_block(Block(parameters, {}, 1, (0,), 0, ()))
    if problems:
        raise FitError(problems[0, 0])
    if not numbers.level[0, 0] > 0.0:
        raise FitError("the amplitude is in gross slip: the law of partial slip cannot be fitted")
    table = isinstance(parameters.shape, TableShape)
    depth = float(numbers.height[0, 0])
    profile = table_profile(parameters.shape, depth) if table else PowerProfile(float(numbers.exponent[0, 0]))
    stick = profile.inside(float(numbers.level[0, 0]))
    columns, held = read_table(parameters), parameters.hold == "force"
    if "volume" in columns:
        measured, cycles = _volumes(columns, numbers)
        curve = volume_curve(profile, stick, method, parameters.xi, constant_force=held)
        return lambda factor: at_cycles(curve, factor * cycles), measured
    radius = columns["radius"] / float(numbers.length[0, 0])
    curve = profile_curve(profile, stick, radius, method, parameters.xi, constant_force=held)
    total = float(numbers.cycles[0, 0])
    return lambda factor: at_cycles(curve, factor * total), columns["height"] / depth


def _volumes(columns: dict[str, np.ndarray], numbers: Numbers) -> tuple[np.ndarray, np.ndarray]:
    """Return measured volumes and N, dimensionless."""
    unit = float(numbers.length[0, 0] ** 2 * numbers.height[0, 0])
    return columns["volume"] / unit, columns["cycles"] * float(numbers.advance[0, 0])


def read_table(parameters: FrettingWear) -> dict[str, np.ndarray]:
    """Read the campaign's table of measurements.

    Parameters
    ----------
    parameters : FrettingWear
        Names a CSV table with the columns ``cycles, volume`` (m3) or ``radius, height`` (m), or without units in a
        dimensionless campaign; lines that begin with ``#`` are comments.

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
    rows = [row for row in csv.reader(io.StringIO(file.read_text())) if row and not row[0].lstrip().startswith("#")]
    header = [cell.strip().lower() for cell in rows[0]] if rows else []
    if not ({"cycles", "volume"} <= set(header) or {"radius", "height"} <= set(header)):
        raise DataError(f"{file.name}: expected the columns cycles, volume or radius, height, got {header!r}")
    try:
        data = np.array([[float(cell) for cell in row] for row in rows[1:]]).reshape(-1, len(header))
    except ValueError as problem:
        raise DataError(f"{file.name}: {problem}") from None
    if not np.all(np.isfinite(data)):
        raise DataError(f"{file.name}: the measurements must be finite")
    return dict(zip(header, data.T, strict=True))


FITS: tuple[Fit, ...] = (
    Fit("wear_coefficient", MODELS, "V(N) or f(r) of the exact or fast rule, N = k cycles ...: k", wear_coefficient),
    Fit("xi", MODELS, "V(N) or f(r) of the fast rule at known k: xi", best_xi),
)
