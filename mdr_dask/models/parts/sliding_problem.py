"""Dimensionless loads, velocities, lines and solids of the sliding bodies of a block."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.errors import DataError
from mdr_dask.models.base import LEAST, MOST, Block, Status, canonical
from mdr_dask.models.parts.material import solid_of
from mdr_dask.models.parts.measured_line import line_of
from mdr_dask.models.parts.rough_line import Generated, Measured, OfSurface, Roughness, Smooth
from mdr_dask.models.parts.sliding_body import SlidingBody
from mdr_dask.physics.outcome import Outcome

if TYPE_CHECKING:
    from mdr_dask.physics.sliding.problem import PronyTerms
    from mdr_dask.physics.surfaces.shapes import PowerLaw

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
"""The status that is stored for each outcome of a solver."""


@dataclass(frozen=True)
class Setting:
    """The dimensionless roughness, shape and solid that several cases have in common.

    `body` is None for a plane, and `terms` is None for a Kelvin solid.
    """

    roughness: Roughness
    body: PowerLaw | None
    terms: PronyTerms | None


@dataclass(frozen=True)
class SlidingProblems:
    """The cases of a block as dimensionless numbers.

    `which` holds the index into `settings` for every case, or -1 for a case that cannot be solved. `loads` are
    F_N / (4 G_inf L h) with the static shear modulus G_inf. `deborah` are the Deborah numbers eta v / (G_inf L) with
    the viscosity eta of the dashpot, which is 0 for a solid without a dashpot. For a Kelvin body, the Deborah number is
    v tau / L. `length` is the length L of the line in m. `height` is the unit of height h in m: the rms height, or L if
    there is no roughness. `faults` has a message for each case that cannot be solved. The key is the index of the case.
    """

    settings: list[Setting]
    which: IntArray
    loads: FloatArray
    deborah: FloatArray
    length: FloatArray
    height: FloatArray
    faults: dict[int, str]

    def groups(self, *columns: NDArray[Any]) -> Iterator[tuple[Setting, IntArray]]:
        """Yield the setting and the case indices of each group of solvable cases.

        All cases of a group have the same setting, and the same value in each of the `columns`.
        """
        is_sound = self.which >= 0
        is_sound[list(self.faults)] = False
        sound = np.flatnonzero(is_sound)
        first, group = combinations(self.which[sound], *(column[sound] for column in columns))
        ends = np.cumsum(np.bincount(group, minlength=1))[:-1]
        for k, members in zip(first, np.split(sound[np.argsort(group, kind="stable")], ends), strict=False):
            yield self.settings[self.which[sound[k]]], members

    def different(self, members: IntArray) -> tuple[FloatArray, FloatArray, IntArray]:
        """Return the distinct pairs of Deborah number and load of some cases, and the index of each case's pair."""
        pairs, which = np.unique(self.deborah[members] + 1j * self.loads[members], return_inverse=True)
        return pairs.real.copy(), pairs.imag.copy(), which


def combinations(*columns: NDArray[Any]) -> tuple[IntArray, IntArray]:
    """Find the distinct rows of a table with the given columns. Objects are compared by identity.

    Return the index of the first occurrence of each distinct row, and for every row its index among the distinct rows.
    """
    which = np.zeros(columns[0].size, np.int64) if columns else np.zeros(1, np.int64)
    first = np.zeros(min(which.size, 1), np.int64)
    for column in columns:
        keys = np.fromiter(map(id, column), np.int64, column.size) if column.dtype == object else column
        if np.all(keys == keys[:1]):
            continue
        code = np.unique(keys, return_inverse=True)[1]
        _, first, which = np.unique(which * (code.max() + 1) + code, return_index=True, return_inverse=True)
    return first, which


def sliding_problems(block: Block[Any]) -> SlidingProblems:
    """Return the cases of a block as dimensionless numbers. The parameters of the block are a `SlidingBody`."""
    faults: dict[int, str] = {}
    lines, which_line, length, height = _lines(block, faults)
    static, viscosity, terms, which_solid = _solids(block, faults)
    velocity, force = map(block.numbers, ("velocity", "normal_force"))
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

    indenters, which_indenter = each(block, "indenter")
    bodies = [indenter.line() for indenter in indenters]
    columns: list[NDArray[Any]] = [which_line, which_indenter, which_solid]
    columns += [length, height] if any(body is not None for body in bodies) else []
    columns += [length, velocity] if any(term is not None for term in terms) else []
    sound = np.ones(block.cases, np.bool_)
    sound[list(faults)] = False
    cases = np.flatnonzero(sound)
    first, of_sound = combinations(*(column[cases] for column in columns))
    places: dict[Setting, int] = {}
    codes = []
    for j in cases[first]:
        body = _without_units(bodies[which_indenter[j]], length[j], height[j])
        solid = _travelling(terms[which_solid[j]], float(velocity[j]), float(length[j]))
        codes.append(places.setdefault(Setting(lines[which_line[j]], body, solid), len(places)))
    which = np.full(block.cases, -1)
    which[cases] = np.array(codes, np.int64)[of_sound]
    return SlidingProblems(list(places), which, loads, deborah, length, height, faults)


def _without_units(body: PowerLaw | None, length: float, height: float) -> PowerLaw | None:
    """Return the profile of an indenter with positions divided by `length` and heights divided by `height`.

    The numbers are rounded (see `canonical`), so that cases that differ only by rounding errors share a profile.
    """
    if body is None:
        return None
    body = body.scaled(float(length), float(height))
    return replace(body, coefficient=float(canonical(body.coefficient)), exponent=float(canonical(body.exponent)))


def _travelling(term: tuple[FloatArray, FloatArray] | None, velocity: float, length: float) -> PronyTerms | None:
    """Return Prony terms with relaxation times divided by L / v, the time of sliding over the length L."""
    from mdr_dask.physics.sliding.problem import PronyTerms

    if term is None:
        return None
    return PronyTerms(*(tuple(canonical(numbers).tolist()) for numbers in (term[0], term[1] * velocity / length)))


def refuse_immense(numbers: dict[str, FloatArray], faults: dict[int, str]) -> None:
    """Add a message to `faults` for every case with a dimensionless number that is too large or too small."""
    for name, column in numbers.items():
        for j in np.flatnonzero(~((column > LEAST) & (column < MOST))):
            between = f"expected {name} between {LEAST:g} and {MOST:g}, got {column[j]:.9g}"
            faults.setdefault(int(j), f"{between}; check the units")


def each(block: Block[Any], name: str) -> tuple[list[Any], IntArray]:
    """Return the distinct values of a nested parameter, and for every case its index among these values."""
    varied = [column for path, column in block.columns.items() if path.partition(".")[0] == name]
    if not varied:
        return [getattr(block.parameters, name)], np.zeros(block.cases, np.int64)
    first, which = combinations(*varied)
    return [getattr(block.case(int(j)), name) for j in first], which


def _lines(
    block: Block[Any], faults: dict[int, str]
) -> tuple[list[Roughness | None], IntArray, FloatArray, FloatArray]:
    """Return the distinct rough lines, and for every case the index of its line, the length L and the rms height h.

    For a line without roughness, L is returned in place of h. A line that cannot be made is None, and `faults` gets a
    message for each of its cases.
    """
    length, height = block.numbers("length"), block.numbers("rms_roughness")
    flat = height == 0
    height = np.where(flat, length, height)
    with np.errstate(all="ignore"):
        ends = [canonical(length / block.numbers(name)) for name in ("rolloff_wavelength", "longest_wavelength")]
    corners = [np.where(np.isnan(end), 0.0, end) for end in ends]  # 0 if the wavelength is not given
    surfaces, which_surface = each(block, "surface")
    columns = block.numbers("hurst"), block.numbers("points").astype(np.int64), *corners
    own_length = [length] if any(surface is not None for surface in surfaces) else []
    first, which = combinations(which_surface, flat, *columns, *own_length)
    lines: list[Roughness | None] = []
    for k, j in enumerate(first):
        surface = surfaces[which_surface[j]]
        hurst, points, rolloff, longest = (column[j].item() for column in columns)
        if surface is None:
            lines.append(Smooth(points) if flat[j] else Generated(hurst, points, rolloff, longest))
            continue
        members = np.flatnonzero(which == k)
        try:
            if surface.profile is None:
                line: OfSurface | Measured = OfSurface(surface, points, float(length[j]))
            else:
                line = Measured(surface.profile)
            length[members] = line_of(line.profile).length if isinstance(line, Measured) else length[j]
            height[members] = line.height()
            lines.append(line)
        except DataError as problem:
            faults.update(dict.fromkeys(members.tolist(), str(problem)))
            lines.append(None)
    return lines, which, length, height


def _solids(block: Block[SlidingBody], faults: dict[int, str]) -> tuple[FloatArray, FloatArray, list[Any], IntArray]:
    """Return, for every case, the static modulus in Pa and the ratio of viscosity to static modulus in s.

    Also return the Prony terms of each distinct solid, and for every case the index of its solid. Prony terms consist
    of moduli divided by the static modulus, and of relaxation times in s. The Prony terms of a Kelvin solid are None.
    If a solid cannot be made, its Prony terms are also None, and `faults` gets a message for each of its cases.
    """
    static, viscosity = block.numbers("shear_modulus"), block.numbers("relaxation_time")
    materials, which = each(block, "material")
    terms: list[Any] = [None] * len(materials)
    for k, material in enumerate(materials):
        if material is None:
            continue
        members = np.flatnonzero(which == k)
        try:
            solid = solid_of(material)
        except (DataError, ValueError) as problem:
            faults.update(dict.fromkeys(members.tolist(), str(problem)))
            continue
        static[members], viscosity[members] = solid.static_modulus, solid.viscosity / solid.static_modulus
        is_kelvin = solid.times.size == 0 and solid.viscosity > 0
        terms[k] = None if is_kelvin else (solid.moduli / solid.static_modulus, solid.times)
    return static, viscosity, terms, which
