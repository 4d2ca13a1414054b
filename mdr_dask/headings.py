"""Names and units of the columns of tables, in the forms in which people and instruments write them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from mdr_dask.units import conversion, is_unit

#: Further names of quantities. A `Column` whose name is a key here also has the names listed under this key.
SYNONYMS = {
    name: tuple(text.split(", "))
    for name, text in {
        "temperature": "T, temp, sample temperature, temperature sample, ts, tr, temperatur",
        "frequency": "f, freq, omega, w, ω, angular frequency, frequency angular, frequenz, kreisfrequenz",
        "time": "t, step time, test time, zeit",
        "velocity": "v, speed, sliding velocity, sliding speed, load point velocity, geschwindigkeit, "
        "gleitgeschwindigkeit",
        "storage modulus": "e', g', storage, e storage, g storage, e stor, g stor, e1, g1, speichermodul",
        "loss modulus": "e'', g'', loss, e loss, g loss, e2, g2, verlustmodul",
        "modulus": "relaxation modulus, e relax, g relax, e(t), g(t), e, g",
        "compliance": "creep compliance, j, j(t)",
        "tan delta": "tan(delta), tan d, tan δ, tandelta, tan(δ), loss factor, damping factor, verlustfaktor",
        "friction coefficient": "coefficient of friction, coefficient, friction, mu, μ, cof, reibwert, "
        "reibungskoeffizient, reibungszahl",
        "normal force": "force, load, normal load, f n, fn, F, kraft, normalkraft",
        "kinematic viscosity": "nu, ν, viscosity, kinematische viskosität, viskosität",
        "dynamic viscosity": "eta, η, mu, viscosity, dynamische viskosität, viskosität",
        "wavenumber": "q, k, wave number, wavevector, wave vector",
        "wavelength": "lambda, λ",
        "C2D": "C, c iso, areal spectrum, psd 2d, psd, c(q)",
        "C1D": "C, line spectrum, psd 1d, psd, c(q)",
        "x": "X, position, distance, length, weg",
        "height": "z, Z, h, höhe",
        "wear volume": "worn volume, verschleißvolumen",
    }.items()
}
#: Units that may be joined to a name, as in ``freq_hz``, by their spelling in lower case.
JOINED = {unit.casefold(): unit for unit in ("Pa", "kPa", "MPa", "GPa", "Hz", "K", "N")} | {"c": "degC", "f": "degF"}
_ALIKE = str.maketrans({"’": "'", "′": "'", "″": "''", '"': "''", "µ": "μ", "δ": "δ"})
#: A name followed by its symbol, as in ``Storage modulus G'`` or ``force (F)``.
_WITH_SYMBOL = re.compile(r"(.+?)\s*(?:\(([^()]+)\)|\s(\S['\"’′″]*))")
#: The end of an abbreviated word, as in ``Ang. frequency``.
_ABBREVIATED = re.compile(r"(?<=\w{3})\.")
#: Two forms of a heading: a name with its unit in brackets, and a name with its unit after a slash, a comma or "in".
_BRACKETED = re.compile(r"(.+?)[\s,/]*([\[({<])([^\])}>]*)[\])}>]")
_BEHIND = re.compile(r"(.+?)\s*(?:/|,|\bin\b)\s*(\S.*)")


@dataclass(frozen=True)
class Column:
    """The description of a column that a table may have.

    Parameters
    ----------
    name : str
        Name in messages and in the result. A table may also use one of the `SYNONYMS` of this name.
    unit : str
        SI unit of the result, ``"1"`` for a pure number. For angular frequencies (``rad/s``) a table may use Hz or rpm.
    other_names : tuple of str
        Further names. Case, blanks and punctuation are ignored, except in names of one letter.
    needed : bool
        Whether a table must have this column.
    above, least : float, optional
        Limits in SI: values must be greater than `above` and not smaller than `least`. None means no limit.
    given_unit : str
        Unit to use if the table states no unit. If `given_unit` is empty, a table must state the unit, except for pure
        numbers.
    """

    name: str
    unit: str
    other_names: tuple[str, ...] = ()
    needed: bool = True
    above: float | None = None
    least: float | None = None
    given_unit: str = ""

    def holds(self, heading: str) -> bool:
        """Return whether a heading without unit is a name of this column."""
        return is_called(heading, self.name, *self.other_names)


def is_called(heading: str, *names: str) -> bool:
    """Return whether a heading is one of the names or a synonym, perhaps abbreviated or followed by a symbol.

    For example, ``Storage modulus G'`` and ``Stor. mod.`` are names of the storage modulus.
    """
    known = [each for name in names for each in (name, *SYNONYMS.get(plain(name), ()), *SYNONYMS.get(name, ()))]
    if len(heading.strip()) == 1:
        return heading.strip().translate(_ALIKE) in known
    if plain(heading) in {plain(name) for name in known}:
        return True
    if found := _WITH_SYMBOL.fullmatch(heading.strip()):
        return is_called(found[1], *names) and is_called(found[2] or found[3], *names)
    parts = [re.escape(plain(part)) for part in _ABBREVIATED.split(heading)]
    return len(parts) > 1 and any(re.fullmatch(r"\w* ?".join(parts), plain(name)) for name in known)


def plain(name: str) -> str:
    """Return a name in a standard form: lower case, single blanks, no punctuation, one kind of prime."""
    return re.sub(r"[\s_.\-:]+", " ", name.strip().casefold().translate(_ALIKE)).strip()


def split_unit(heading: str) -> tuple[str, str]:
    """Return the name and the unit of a heading: ``f [Hz]``, ``f (Hz)``, ``f / Hz``, ``f, Hz`` or ``f in Hz``.

    Text in square brackets is always taken as a unit. Any other text is taken as a unit only if it looks like one. In
    other brackets it must also not be a symbol of the quantity, as in ``force (F)``.
    """
    found = _BRACKETED.fullmatch(heading.strip())
    if found:
        name, text = found[1].strip(" ,"), found[3].strip()
        is_symbol = any(is_called(name, quantity) and is_called(text, quantity) for quantity in SYNONYMS)
        looks = text == "-" or re.match(r"deg|°|1/|%", text) or is_unit(text)
        return (name, text) if found[2] == "[" or (looks and not is_symbol) else (heading, "")
    found = _BEHIND.fullmatch(heading.strip())
    return (found[1], found[2]) if found and is_unit(found[2]) else (heading, "")


def match(name: str, unit: str, columns: Sequence[Column]) -> tuple[Column | None, str]:
    """Return the column that a name means, and its unit, which may be part of the name (``freq_hz``).

    The column is None if the name fits none of the columns.
    """
    front, _, behind = name.replace(" ", "_").rpartition("_")
    readings = [(name, unit)]
    if front and not unit:
        readings.append((front, JOINED.get(behind.casefold(), behind)))
    for reading, written in readings:
        fitting = [each for each in columns if each.holds(reading) and (reading == name or _fits(written, each))]
        best = [each for each in fitting if _fits(written, each)] or fitting
        if best:
            return best[0], written
    return None, unit


def _fits(unit: str, column: Column) -> bool:
    try:
        factors(unit, column.unit)
    except ValueError:
        return False
    return bool(unit)


def factors(unit: str, wanted: str) -> tuple[float, float, float]:
    """Return numbers p, q and z: a number x in a unit is p (q x + z) in the SI unit `wanted`.

    If an angular frequency is wanted, p is 2 pi for Hz, and 1/s counts as rad/s.
    """
    if not unit:
        return 1.0, 1.0, 0.0
    try:
        return 1.0, *conversion(unit, wanted)
    except ValueError:
        if not wanted.startswith("rad/"):
            raise
        turns = 2 * math.pi if "hz" in unit.lower() else 1.0
        return turns, *conversion(unit, wanted.replace("rad", "1"))
