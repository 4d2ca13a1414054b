"""Sliding bodies as dimensionless numbers: the one place where loads, velocities, lines and solids lose their units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.errors import DataError, distinguishable
from mdr_dask.models.base import Block, Status, canonical
from mdr_dask.models.parts.material import solid_of
from mdr_dask.models.parts.measured_line import line_of
from mdr_dask.models.parts.rough_line import Generated, Measured, OfSurface, Roughness, Smooth
from mdr_dask.models.parts.sliding_body import SlidingBody
from mdr_dask.models.parts.surface import Surface
from mdr_dask.physics.outcome import Outcome

if TYPE_CHECKING:
    from mdr_dask.physics.sliding.problem import PronyTerms
    from mdr_dask.physics.surfaces.shapes import Shape

STATUS = np.array(
    [
        Status.DONE
        if outcome == Outcome.CONVERGED
        else Status.FAILED
        if outcome.is_impossible
        else Status.NOT_CONVERGED
        for outcome in Outcome
    ],
    dtype=np.int8,
)
"""The status in a store for each outcome of a solver."""
LEAST = 1e-100  # squares and products of dimensionless numbers from here to its reciprocal can be represented


@dataclass(frozen=True)
class Setting:
    """Line and Prony terms of the solid (None for a Kelvin solid), without units: shared by cases solved together."""

    roughness: Roughness
    body: Shape | None
    terms: PronyTerms | None


@dataclass(frozen=True)
class SlidingProblems:
    """The cases of a block as dimensionless numbers: a solution depends on nothing else.

    Parameters
    ----------
    settings : list of Setting
        Line and solid of every case.
    loads : array, shape (cases,)
        F_N / (4 G_inf L h).
    deborah : array, shape (cases,)
        eta v / (G_inf L): the Deborah number v tau / L of a Kelvin body.
    length, height : array, shape (cases,)
        L and h, m: the units of length and height. h is the rms height, or L where there is no roughness.
    faults : dict of int to str
        Messages about cases that cannot be solved.
    """

    settings: list[Setting]
    loads: FloatArray
    deborah: FloatArray
    length: FloatArray
    height: FloatArray
    faults: dict[int, str]

    def groups(self, *columns: list[Any]) -> Iterator[tuple[Setting, tuple[Any, ...], IntArray]]:
        """Yield the cases that share a setting and the values of some columns."""
        members: dict[Any, list[int]] = {}
        for j, key in enumerate(zip(map(id, self.settings), *columns, strict=True)):  # equal settings are one object
            members.setdefault(key, []).append(j)
        for (_, *others), cases in members.items():
            sound = [j for j in cases if j not in self.faults]
            if sound:
                yield self.settings[sound[0]], tuple(others), np.array(sound)

    def different(self, members: IntArray) -> tuple[FloatArray, FloatArray, IntArray]:
        """Return the different pairs of Deborah number and load among some cases, and the pair of each case."""
        pairs = list(zip(self.deborah[members].tolist(), self.loads[members].tolist(), strict=True))
        places = {pair: k for k, pair in enumerate(sorted(set(pairs)))}
        deborah, loads = np.array(list(places)).T.copy()
        return deborah, loads, np.array([places[pair] for pair in pairs])


def sliding_problems(block: Block[Any]) -> SlidingProblems:
    """Return the cases of a block of any `SlidingBody` without units."""
    faults: dict[int, str] = {}
    roughness, length, height = _lines(block, faults)
    static, viscosity, terms = _solids(block, faults)
    velocity, force = (np.asarray(block.column(name), dtype=np.float64) for name in ("velocity", "normal_force"))
    with np.errstate(all="ignore"):
        loads = canonical(force / (4 * static * length * height))
        deborah = canonical(velocity * viscosity / length)
    given = {"length": length, "rms roughness": height, "load": force, "velocity": velocity}
    for name, numbers in given.items():
        for j in np.flatnonzero(~(np.isfinite(numbers) & (numbers > 0))):
            faults.setdefault(int(j), f"the {name} must be positive and finite, got {numbers[j]:g}")
    with np.errstate(all="ignore"):
        slope = height / length
    refuse_immense({"h / L": slope, "F_N / (4 G L h)": loads, "v tau / L": np.where(deborah == 0, 1, deborah)}, faults)
    settings = _settings(block, roughness, terms, length, height, velocity, faults)
    return SlidingProblems(settings, loads, deborah, length, height, faults)


def refuse_immense(numbers: dict[str, FloatArray], faults: dict[int, str]) -> None:
    """Add a message for every case whose dimensionless numbers, or their squares, overflow or underflow."""
    for name, column in numbers.items():
        for j in np.flatnonzero(~((column > LEAST) & (column < 1 / LEAST))):
            number, least, most = distinguishable(column[j], LEAST, 1 / LEAST, digits=6)
            faults.setdefault(int(j), f"expected {name} between {least} and {most}, got {number}; look at the units")


def each(block: Block[Any], name: str) -> list[Any]:
    """Return a nested parameter of every case, whichever part of it varies."""
    if any(path.partition(".")[0] == name for path in block.columns):
        return [getattr(block.case(j), name) for j in range(block.cases)]
    return [getattr(block.parameters, name)] * block.cases


def _numbers(block: Block[Any], name: str) -> FloatArray:
    """Return a number of every case, NaN where it is not given."""
    return np.array([np.nan if value is None else value for value in block.column(name).tolist()], dtype=np.float64)


def _lines(block: Block[Any], faults: dict[int, str]) -> tuple[list[Roughness], FloatArray, FloatArray]:
    """Return roughness, length and height of every case."""
    length, height = _numbers(block, "length"), _numbers(block, "rms_roughness")
    flat = height == 0
    height = np.where(flat, length, height)
    with np.errstate(all="ignore"):
        corners = [
            np.where(np.isnan(wavelength), 0.0, canonical(length / wavelength)).tolist()
            for wavelength in (_numbers(block, "rolloff_wavelength"), _numbers(block, "longest_wavelength"))
        ]
    columns = block.column("hurst").tolist(), block.column("points").tolist(), *corners
    distinct: dict[Any, Roughness] = {}
    lines: list[Roughness] = []
    for smooth, *numbers in zip(flat.tolist(), *columns, strict=True):
        key = (smooth, *numbers)
        if key not in distinct:
            distinct[key] = Smooth(numbers[1]) if smooth else Generated(*numbers)
        lines.append(distinct[key])
    surfaces: dict[Any, OfSurface | Measured] = {}
    for j, surface in enumerate(each(block, "surface")):
        if surface is not None:
            key = surface, columns[1][j], length[j]
            try:
                line = surfaces.setdefault(key, _measured(*key))
                length[j] = line_of(line.profile).length if isinstance(line, Measured) else length[j]
                lines[j], height[j] = line, line.height()
            except DataError as problem:
                faults[j] = str(problem)
    return lines, length, height


def _measured(surface: Surface, points: int, length: float) -> OfSurface | Measured:
    """Return the roughness of a measured surface, in units of length and height."""
    return OfSurface(surface, points, length) if surface.profile is None else Measured(surface.profile)


def _solids(block: Block[SlidingBody], faults: dict[int, str]) -> tuple[FloatArray, FloatArray, list[Any]]:
    """Return static modulus, viscosity and Prony terms of every case; the last are None for a Kelvin solid.

    Viscosity and moduli of the terms are divided by the static modulus.
    """
    static, viscosity = _numbers(block, "shear_modulus"), _numbers(block, "relaxation_time")
    terms: list[Any] = [None] * block.cases
    for j, material in enumerate(each(block, "material")):
        if material is not None:
            try:
                solid = solid_of(material)
            except (DataError, ValueError) as problem:
                faults[j] = str(problem)
                continue
            static[j], viscosity[j] = solid.static_modulus, solid.viscosity / solid.static_modulus
            is_kelvin = solid.times.size == 0 and solid.viscosity > 0
            terms[j] = None if is_kelvin else (solid.moduli / solid.static_modulus, solid.times)
    return static, viscosity, terms


def _settings(
    block: Block[Any],
    roughness: list[Roughness],
    terms: list[Any],
    length: FloatArray,
    height: FloatArray,
    velocity: FloatArray,
    faults: dict[int, str],
) -> list[Setting]:
    """Return line and solid of every case in units of length and height; equal settings are one object."""
    from mdr_dask.physics.sliding.problem import PronyTerms

    indenters = each(block, "indenter")
    bodies = {id(indenter): indenter.line() for indenter in {id(one): one for one in indenters}.values()}
    known: dict[Any, Setting] = {}
    equal: dict[Setting, Setting] = {}
    settings = []
    columns = roughness, indenters, terms, length.tolist(), height.tolist(), velocity.tolist()
    for j, (line, indenter, term, unit, rms, pace) in enumerate(zip(*columns, strict=True)):
        key: tuple[Any, ...] = (id(line), id(indenter), unit, rms)
        if term is not None:
            key += (id(term), pace)
        if key not in known:
            body, travelling = bodies[id(indenter)], None
            if body is not None and j not in faults:
                body = body.scaled(unit, rms)
                body = replace(body, **{name: float(canonical(number)) for name, number in vars(body).items()})
            if term is not None and j not in faults:
                numbers = canonical(term[0]), canonical(term[1] * pace / unit)
                travelling = PronyTerms(*(tuple(column.tolist()) for column in numbers))
            setting = Setting(line, body, travelling)
            known[key] = equal.setdefault(setting, setting)
        settings.append(known[key])
    return settings
