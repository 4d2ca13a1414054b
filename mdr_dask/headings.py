"""Names and units of the columns of tables, in the forms in which people and instruments write them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from mdr_dask.errors import similar
from mdr_dask.units import conversion, is_unit

#: Each line contains names of one quantity. The case of letters matters only in one-letter names.
SYNONYMS = tuple(
    tuple(line.split(", "))
    for line in """\
temperature, T, temp, temperatur, ts, tr
frequency, f, freq, omega, w, ω, angular frequency, frequency angular, frequenz, kreisfrequenz
time, t, zeit
velocity, v, speed, sliding velocity, sliding speed, load point velocity, geschwindigkeit, gleitgeschwindigkeit
mean velocity, mean speed, rolling velocity, rolling speed, entrainment velocity, entrainment speed, velocity, speed, v
rotation speed, rotational speed, angular velocity, speed, n, drehzahl
slide roll ratio, slide to roll ratio, srr
storage modulus, e', g', storage, e storage, g storage, e stor, g stor, e1, g1, speichermodul
loss modulus, e'', g'', loss, e loss, g loss, e2, g2, verlustmodul
modulus, relaxation modulus, e relax, g relax, e(t), g(t), E, G
compliance, creep compliance, J, j(t)
complex modulus, G*, E*, komplexer modul
phase angle, delta, δ, phasenwinkel
tan delta, tan d, tan δ, loss factor, damping factor, verlustfaktor
friction coefficient, traction coefficient, coefficient of friction, friction, coefficient, mu, μ, cof, reibwert, \
reibungszahl
friction force, traction force, tangential force, friction, reibkraft
normal force, force, load, normal load, f n, F, kraft, normalkraft
kinematic viscosity, nu, ν, viscosity, kinematische viskosität, viskosität
dynamic viscosity, eta, η, mu, viscosity, dynamische viskosität, viskosität
wavenumber, q, k, wave number, wavevector, wave vector
wavelength, lambda, λ
C2D, C, c iso, areal spectrum, psd 2d, psd, c(q)
C1D, C, line spectrum, psd 1d, psd, c(q)
x, X, position, pos, distance, length, weg
height, z, Z, h, höhe
radius, r
wear volume, worn volume, V, verschleißvolumen
cycles, number of cycles, N, zyklen, zyklenzahl
""".splitlines()
)  # fmt: skip
#: Words in the name of a column that do not change its meaning.
IGNORED = {"mean", "average", "avg", "mittel", "sample", "test", "step", "measured", "linear"}
#: Units that may be joined to a name, as in ``freq_hz``. The keys are in lower case.
JOINED = {unit.casefold(): unit for unit in ("Pa", "kPa", "MPa", "GPa", "mPa", "Hz", "K", "N")} | {"f": "degF"}
JOINED |= {"c": "degC"}
_ALIKE = str.maketrans({"’": "'", "′": "'", "″": "''", '"': "''", "µ": "μ"})
#: Two forms of a heading: a name with its unit in brackets, and a name with its unit after a slash, a comma or "in".
_BRACKETED = re.compile(r"(.+?)[\s,/]*([\[({<])([^\])}>]*)[\])}>]")
_BEHIND = re.compile(r"(.+?)\s*(?:/|,|\bin\b)\s*(\S.*)")


@dataclass(frozen=True)
class Column:
    """A column that a table may contain under its `name`, a synonym in `SYNONYMS`, or one of `other_names`.

    The SI `unit` is ``"1"`` for pure numbers. In SI, all values must be greater than `above` and at least `least`,
    if these bounds are given. `given_unit` is used if the table states no unit. If `given_unit` is empty, the table
    must state the unit of this column, unless the column contains pure numbers.
    """

    name: str
    unit: str
    other_names: tuple[str, ...] = ()
    needed: bool = True
    above: float | None = None
    least: float | None = None
    given_unit: str = ""

    def holds(self, heading: str) -> bool:
        """Return whether a heading, without its unit, is a name of this column."""
        return is_called(heading, self.name, *self.other_names)


def plain(name: str) -> str:
    """Return a name in lower case, in which single blanks replace blanks and the characters ``_.-:()|``.

    A single letter keeps its case, because t is a time and T is a temperature.
    """
    name = re.sub(r"[\s_.\-:()|]+", " ", name.translate(_ALIKE)).strip()
    return name if len(name) == 1 else name.casefold()


def _key(name: str) -> str:
    """Return a name without blanks, and without the words in `IGNORED` unless all its words are in `IGNORED`."""
    words = plain(name).split()
    return "".join([word for word in words if word not in IGNORED] or words)


@lru_cache(maxsize=1024)
def _names_of(name: str) -> list[str]:
    """Return a name and its synonyms. If `SYNONYMS` lacks the name, search again without the words in `IGNORED`."""
    lines = [line for line in SYNONYMS if plain(name) in map(plain, line)]
    lines = lines or [line for line in SYNONYMS if _key(name) in map(_key, line)]
    return [name, *(each for line in lines for each in line)]


def is_called(heading: str, name: str, *others: str) -> bool:
    """Return whether a heading is `name`, a synonym of `name`, or one of the `others`.

    The heading may be abbreviated, as in ``Stor. mod.``, or followed by a symbol, as in ``Storage modulus G'``.
    """
    known = [*others, *_names_of(name)]
    if _key(heading) in map(_key, known):
        return True
    front, _, symbol = re.sub(r"[()]", " ", heading).strip().rpartition(" ")
    if front and is_called(front, name, *others) and is_called(symbol, name, *others):
        return True
    parts = [re.escape(plain(part)) for part in re.split(r"(?<=\w{3})\.", heading)]
    return len(parts) > 1 and any(re.fullmatch(r"\w* ?".join(parts), plain(each)) for each in known)


def nearest(heading: str, names: Sequence[str]) -> str:
    """Return a hint with a name that is similar to a heading, or else with a name that shares a word with the heading.

    The word may also be in a synonym of the name. The hint is empty if there is no such name.
    """
    words = {word for word in plain(heading).split() if len(word) > 2}
    common = [name for name in names if any(words & set(plain(each).split()) for each in _names_of(name))]
    return similar(heading, names) or (f" (did you mean {common[0]!r}?)" if common else "")


def split_unit(heading: str) -> tuple[str, str]:
    """Return the name and the unit of a heading such as ``f [Hz]``, ``f (Hz)``, ``f / Hz``, ``f, Hz`` or ``f in Hz``.

    Text in square brackets is always a unit. Elsewhere, a text is a unit only if it looks like one. In ``force (F)``, F
    is the symbol of the force and not a unit. If there is no unit, return the whole heading and an empty unit.
    """
    found = _BRACKETED.fullmatch(heading.strip())
    if found:
        name, text = found[1].strip(" ,"), found[3].strip()
        looks = text in ("-", "1") or re.match(r"deg|°|1/|%", text) or is_unit(text)
        return (name, text) if found[2] == "[" or (looks and not is_called(text, name)) else (heading, "")
    found = _BEHIND.fullmatch(heading.strip())
    return (found[1], found[2]) if found and (found[2] in ("-", "1") or is_unit(found[2])) else (heading, "")


def match(name: str, unit: str, columns: Sequence[Column]) -> tuple[Column | None, str]:
    """Return the column that a name means, and its unit. The unit may be part of the name, such as mm/s in ``v_mm_s``.

    The column is None if the name means none of the `columns`. The name is compared with the names of `columns`, then
    with their synonyms, and then with their `other_names`. Columns that the unit does not fit are considered only if no
    other column has the name. ValueError is raised if several columns fit equally well. If no column fits, the name may
    also be a synonym of an entry of `other_names`.
    """
    exact = [column for column in columns if plain(name) == plain(column.name)]
    synonyms = [column for column in columns if is_called(name, column.name)]
    others = [column for column in columns if column.holds(name)]
    for alike in ([column for column in rank if _agrees(unit, column)] for rank in (exact[:1], synonyms, others)):
        if len(alike) > 1:
            several = " or ".join(repr(column.name) for column in alike)
            raise ValueError(f"expected the name of one quantity, got {name!r}, which may mean {several}")
        if alike:
            return alike[0], unit
    if found := exact or synonyms or ([] if unit else others):  # the unit is wrong or missing
        return found[0], unit
    # synonyms of `other_names` count only if the name is one word, and the unit fits only one column with such a name
    quantities = {line[0] for line in SYNONYMS} if " " not in plain(name) else set()
    short = [each for each in columns if any(is_called(name, other) for other in quantities & set(each.other_names))]
    if len(agreeing := [column for column in short if _agrees(unit, column)]) == 1:
        return agreeing[0], unit
    words = re.split(r"[\s_]", name)
    for count in range(len(words) - 1, 0, -1) if not unit else ():
        behind = [JOINED.get(word.casefold(), word) for word in words[count:]]
        for joined in (" ".join(behind), "/".join(behind)):
            for column in columns:
                if column.holds(" ".join(words[:count])) and fits(joined, column):
                    return column, joined
    written = _BRACKETED.fullmatch(name)  # an unknown unit in brackets is still part of the name
    return match(written[1], written[3], columns) if written and not unit else (None, unit)


def _agrees(unit: str, column: Column) -> bool:
    return fits(unit, column) or (unit in ("", "-", "1") and column.unit == "1")


def fits(unit: str, column: Column) -> bool:
    """Return whether a unit has the dimension of a column. Return False for an empty unit."""
    try:
        factors(unit, column.unit)
    except ValueError:
        return False
    return bool(unit)


def factors(unit: str, wanted: str) -> tuple[float, float, float]:
    """Return the numbers p, q and z that convert a unit to SI: x in this unit is p (q x + z) in the SI unit `wanted`.

    For an angular frequency, p is 2 pi if the unit is Hz, kHz or 1/min (revolutions per minute). Values in 1/s count as
    values in rad/s, and values in 1/m as values in rad/m. For all other units, p is 1. If `unit` is empty, the values
    count as SI. Raise ValueError if the unit is unknown or has another dimension.
    """
    if not unit:
        return 1.0, 1.0, 0.0
    try:
        return 1.0, *conversion(unit, wanted)
    except ValueError:
        if not wanted.startswith("rad/"):
            raise
        turns = 2 * math.pi if re.search("hz|min", unit.lower()) else 1.0
        return turns, *conversion(unit, wanted.replace("rad", "1"))
