"""Conversion of the parameters of a block to dimensionless numbers for every case and realisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from mdr_dask.arrays import FloatArray, random_stream
from mdr_dask.models.base import Block, canonical
from mdr_dask.models.data_file import NamedFile
from mdr_dask.models.fretting_wear.declaration import FrettingWear, Indenter, Table, profile_columns

if TYPE_CHECKING:
    from mdr_dask.physics.mdr.revolution import TableProfile


@dataclass(frozen=True)
class Numbers:
    """The dimensionless numbers and the units. Every array has the shape (cases, realisations).

    `exponent` is the exponent n of the body, or NaN for a table. `level` is g_c = 1 - G* U0 / (mu E* d0), the value of
    the one-dimensional image at the stick border, divided by d0. In sliding wear, `level` is 0. `cycles` is the
    dimensionless number of cycles N, or in sliding wear the dimensionless sliding distance. With ``wear_rule: limit``,
    `cycles` is 0, because the limiting profile does not depend on N. `advance` is N divided by the parameter `cycles`,
    or the dimensionless sliding distance divided by the parameter `path`. `length`, `height` and `force` are the units
    a0, d0 and E* d0 a0. In a dimensionless campaign, these units are 1.
    """

    exponent: FloatArray
    level: FloatArray
    advance: FloatArray
    cycles: FloatArray
    xi: FloatArray
    length: FloatArray
    height: FloatArray
    force: FloatArray


def indenters(block: Block[FrettingWear]) -> list[Indenter]:
    """Return a list with one indenter for every case, or with a single indenter for all cases.

    The list has a single element if all cases have the same indenter, or if only parameters of a power law vary, such
    as the angle of a cone.
    """
    if isinstance(block.parameters.indenter, Table) and any(path.startswith("indenter") for path in block.columns):
        return [block.case(case).indenter for case in range(block.cases)]
    return list(block.columns["indenter"]) if "indenter" in block.columns else [block.parameters.indenter]


def _power_laws(block: Block[FrettingWear]) -> tuple[FloatArray, FloatArray]:
    """Return coefficient and exponent of the power-law body of every case.

    Both numbers are NaN for a table. The coefficient is also NaN if the campaign does not give the size of the body.
    """
    none = np.nan, np.nan
    coefficient, exponent = np.array(
        [none if isinstance(one, Table) else one.power_law() for one in indenters(block)]
    ).T
    varied = {path.removeprefix("indenter."): np.asarray(column) for path, column in block.columns.items()}
    exponent = varied.get("exponent", exponent)
    coefficient = varied.get("coefficient", coefficient)
    if "radius" in varied:
        coefficient = 0.5 / varied["radius"]
    if "angle" in varied:
        coefficient = np.tan(varied["angle"])
    return np.broadcast_to(coefficient, block.cases), np.broadcast_to(exponent, block.cases)


def has_tables(block: Block[FrettingWear]) -> bool:
    """Return whether the block has an indenter that is not a power law."""
    return any(isinstance(one, Table) for one in indenters(block))


def _scatter(block: Block[FrettingWear]) -> FloatArray:
    """Return standard normal random numbers for friction, amplitude and wear coefficient, shape (realisations, 3)."""
    numbers = [random_stream(block.seed, realisation).standard_normal(3) for realisation in block.realisations]
    return np.array(numbers).reshape(-1, 3)


def _factor(block: Block[FrettingWear], name: str, normal: FloatArray) -> FloatArray:
    """Return log-normal factors of mean 1, shape (cases, realisations).

    The standard deviation of the factors is the value of the parameter `name`. `normal` contains a standard normal
    random number for each realisation.
    """
    width = np.sqrt(np.log1p(block.numbers(name) ** 2))[:, None]
    return np.asarray(np.exp(width * normal - 0.5 * width**2))


def reduce_block(block: Block[FrettingWear]) -> tuple[Numbers, dict[tuple[int, int], str]]:
    """Return the dimensionless numbers and the units of every case, and messages about cases that cannot be solved.

    The key of a message is (index of the case, position of the realisation in the block).
    """
    with np.errstate(all="ignore"):
        numbers, messages = _reduced(block)
    for case, position in np.argwhere(numbers.level >= 1):
        text = "nothing slips: the amplitude is too small compared with mu E* d0 / G*"
        messages.setdefault((int(case), int(position)), text)
    known = np.isfinite(numbers.level) & np.isfinite(numbers.cycles)
    for unit in (numbers.length, numbers.height, numbers.force):
        known &= (unit > 1e-100) & (unit < 1e100)  # cubes of units must neither overflow nor underflow
    for case, position in np.argwhere(~known):
        text = "a number of the case is too large or too small for double precision"
        messages.setdefault((int(case), int(position)), f"{text}; check the units")
    if block.parameters.path is not None or block.parameters.history or "history" in block.columns:
        return numbers, messages
    for case, position in np.argwhere(~(numbers.level > 0.0)):
        times = 1.0 - numbers.level[case, position]
        messages.setdefault(
            (int(case), int(position)),
            f"expected an amplitude below mu E* d0 / G*, where gross slip begins, got {times:.9g} times this value: "
            "lower `amplitude`, or raise `friction` or the load; or replace `cycles` by `path` (sliding in one "
            "direction) or by `history` (blocks of load)",
        )
    return numbers, messages


def _reduced(block: Block[FrettingWear]) -> tuple[Numbers, dict[tuple[int, int], str]]:
    coefficient, n = _power_laws(block)
    normal = _scatter(block)
    sliding = block.parameters.path is not None
    amplitude = _factor(block, "amplitude_scatter", normal[:, 1])
    widening = amplitude / _factor(block, "friction_scatter", normal[:, 0])
    advance = amplitude * _factor(block, "wear_coefficient_scatter", normal[:, 2])
    level = np.zeros_like(advance)
    messages: dict[tuple[int, int], str] = {}
    if block.parameters.dimensionless:
        length = height = force = np.ones(block.cases)
        if not sliding:
            level = (1.0 - widening) + widening * (block.numbers("stick_radius") ** n)[:, None]
    else:
        modulus = block.numbers("contact_modulus")
        length, height = _first_contact(block, coefficient, n, modulus, messages)
        force = modulus * height * length
        if not sliding:
            share = block.numbers("effective_shear_modulus") * block.numbers("amplitude")
            level = 1.0 - widening * (share / (block.numbers("friction") * modulus * height))[:, None]
        swept = 1.0 if sliding else 4.0 * block.numbers("amplitude")
        rate = swept * block.numbers("wear_coefficient") * modulus
        advance = advance * (rate / (length * block.numbers("hardness")))[:, None]
    amount = block.numbers("path" if sliding else "cycles")
    columns = (n, amount, block.numbers("xi"), length, height, force)
    n, amount, xi, length, height, force = (np.broadcast_to(c[:, None], level.shape) for c in columns)
    in_limit = np.asarray(block.column("wear_rule") == "limit")[:, None]
    cycles = np.where(in_limit, 0.0, canonical(amount * advance))
    return Numbers(n, canonical(level), advance, cycles, xi, length, height, force), messages


def _first_contact(
    block: Block[FrettingWear],
    coefficient: FloatArray,
    n: FloatArray,
    modulus: FloatArray,
    messages: dict[tuple[int, int], str],
) -> tuple[FloatArray, FloatArray]:
    """Return the contact radius a0 and the indentation depth d0 before wear, in m, for every case.

    If a0 cannot be computed from a table, for example because the table ends at a radius below a0, a0 is NaN, and a
    message is added to `messages` for every realisation.
    """
    from mdr_dask.physics.mdr import power_law_contact as contact

    depth, force = block.numbers("depth"), block.numbers("normal_force")
    if has_tables(block):
        length = np.full(block.cases, np.nan)
        bodies = indenters(block)
        for case, deep in enumerate(depth):
            try:
                length[case] = table_profile(bodies[case % len(bodies)], float(deep)).length
            except ValueError as problem:
                messages.update({(case, position): str(problem) for position in range(len(block.realisations))})
        return length, depth
    from_force = contact.radius_from_force(force, coefficient, n, modulus)
    length = np.where(np.isnan(depth), from_force, contact.contact_radius(depth, coefficient, n))
    return length, np.where(np.isnan(depth), contact.depth(length, coefficient, n), depth)


def table_profile(indenter: Indenter, depth: float) -> TableProfile:
    """Return the profile of a table, with the contact radius before wear at an indentation depth in m.

    Raise ValueError if the body is a power law, or if the contact reaches beyond the table.
    """
    if not isinstance(indenter, Table):
        raise ValueError("power laws and tables of profiles cannot be mixed along one axis")
    return _pressed_table(indenter.file, depth)


@lru_cache(maxsize=1024)  # cases share a solution only if their profile is the same object
def _pressed_table(file: NamedFile, depth: float) -> TableProfile:
    from mdr_dask.physics.mdr.revolution import from_table

    table = profile_columns(file)
    return from_table(table["radius"], table["height"], depth)


def notes(sets: Sequence[FrettingWear]) -> tuple[str, ...]:
    """Return a note if cases of a study will fail. Random scatter is ignored here."""
    texts: list[str] = []
    for parameters in sets:
        scatter = dict.fromkeys(("friction_scatter", "amplitude_scatter", "wear_coefficient_scatter"), 0.0)
        block = Block(parameters.model_copy(update=scatter), {}, 1, (0,), 0, ())
        texts += reduce_block(block)[1].values()
    if not texts:
        return ()
    return (f"{len(texts)} of the {len(sets)} tried parameter sets will fail: {texts[0]}",)
