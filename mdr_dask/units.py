"""Convert the units of campaign files and tables to SI. This is the only module that imports pint."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Sequence
from contextlib import suppress
from decimal import Decimal
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from mdr_dask.errors import similar

if TYPE_CHECKING:
    from pint import UnitRegistry

#: Units in the syntax of pint. Angles have a dimension. Pint's own list takes ten times as long to load, and contains
#: units with one-letter names (``c``, ``e``, ``M``), which would mostly be mistakes in a campaign.
DEFINITIONS = """
yocto- = 1e-24 = y-
zepto- = 1e-21 = z-
atto- = 1e-18 = a-
femto- = 1e-15 = f-
pico- = 1e-12 = p-
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = μ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
deci- = 1e-1 = d-
hecto- = 1e2 = h-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
tera- = 1e12 = T-
peta- = 1e15 = P-
meter = [length] = m = metre
second = [time] = s = sec
gram = [mass] = g
kelvin = [temperature]; offset: 0 = K
radian = [angle] = rad
ampere = [current] = A
mole = [substance] = mol
degree_Celsius = kelvin; offset: 273.15 = °C = degC = celsius = degreeC
degree_Fahrenheit = 0.5555555555555556 * kelvin; offset: 255.3722222222222 = °F = degF = fahrenheit
percent = 0.01
permille = 0.001 = ‰
ppm = 1e-6
cycle = 1 = cycles
degree = 0.017453292519943295 * radian = deg = °
arcminute = degree / 60 = arcmin
arcsecond = degree / 3600 = arcsec
turn = 6.283185307179586 * radian = _ = revolution = rev = U
revolutions_per_minute = turn / minute = rpm
minute = 60 * second = min
hour = 3600 * second = h = hr
day = 86400 * second = d
year = 31557600 * second = a
hertz = 1 / second = Hz
inch = 0.0254 * meter = in
foot = 0.3048 * meter = ft
angstrom = 1e-10 * meter = Å
micron = 1e-6 * meter
liter = 1e-3 * meter ** 3 = L = l = litre
tonne = 1e6 * gram = t
newton = kilogram * meter / second ** 2 = N
kilogram_force = 9.80665 * newton = kgf
pound_force = 4.4482216152605 * newton = lbf
newton_meter = newton * meter = Nm
pascal = newton / meter ** 2 = Pa
pascal_second = pascal * second = Pas
bar = 1e5 * pascal
atmosphere = 101325 * pascal = atm
psi = pound_force / inch ** 2
vickers = kilogram_force / millimeter ** 2 = HV
brinell = kilogram_force / millimeter ** 2 = HB = HBW
joule = newton * meter = J
electron_volt = 1.602176634e-19 * joule = eV
watt = joule / second = W
poise = 0.1 * pascal * second = P
stokes = 1e-4 * meter ** 2 / second = St
volt = joule / ampere / second = V
ohm = volt / ampere = Ω
siemens = ampere / volt = S
"""

#: For each SI unit: the name of the quantity and an example, for messages.
_MEANINGS = {
    "1": ("a number", ""),
    "m": ("a length", "20 mm"),
    "1/m": ("an inverse length", "5 1/mm"),
    "m/s": ("a velocity", "1 mm/s"),
    "m/s^2": ("an acceleration", "1 m/s^2"),
    "m^2": ("an area", "4 mm^2"),
    "m^3": ("a volume", "1 mm^3"),
    "s": ("a time", "1 ms"),
    "1/s": ("a rate", "10 1/s"),
    "N": ("a force", "1 mN"),
    "N/m": ("a force per length", "1 N/mm"),
    "Pa": ("a pressure", "10 MPa"),
    "1/Pa": ("an inverse pressure", "20 1/GPa"),
    "Pa s": ("a viscosity", "10 mPa s"),
    "m^2/s": ("a kinematic viscosity", "100 mm^2/s"),
    "rad": ("an angle", "5 deg"),
    "rad/s": ("an angular frequency", "10 rad/s"),
    "K": ("a temperature", "300 K"),
    "1/K": ("an inverse temperature", "1e-3 1/K"),
    "kg": ("a mass", "1 g"),
    "kg/m^3": ("a density", "870 kg/m^3"),
    "J": ("an energy", "1 mJ"),
    "W": ("a power", "1 W"),
}

#: Pint may take extremely long to parse a text of more than `_MOST_LETTERS` characters, or an exponent of three digits.
_MOST_LETTERS = 60
_BAD_POWER = re.compile(r"(\*\*|\^)\s*(?!\(?[-+]?\d{1,2}\)?(?![\d.]|\s*(\*\*|\^)))")

#: A factor before a unit, as in ``10^3 um^3``, ``1e-6 mm^3`` or ``x 1000 N``, or a factor without a unit, as in
#: ``10^3`` or ``x 1000``. The number in ``mu (10)`` is not a factor, but perhaps the condition of a test.
_POWER = r"10\s*\^\s*[+-]?\d+|\d+(?:\.\d+)?e[+-]?\d+"
_FACTOR = re.compile(
    rf"([x×*]\s*\d+|{_POWER})\Z|[x×*]?\s*({_POWER}|\d+(?:\.\d+)?|e[+-]?\d+)[\s×x*]*(?=[^\W\d]|°)", re.IGNORECASE
)
_DEGREES = re.compile(r"(?:(?i:deg(?:rees?)?\.?|°)\s*([CFcf])|([CF]))")
_NOT_A_UNIT = re.compile(r"[,._]|\d(?!\s*/)|.*%.*%")
#: Patterns of a number with a decimal comma, of a number whose comma may separate thousands, and of several numbers.
_COMMA = re.compile(r"\s*[+-]?\d*,\d+\s*([eE][+-]?\d+)?\s*[^\d,]*\Z")
_THOUSANDS = re.compile(r"[+-]?\d{1,3},\d{3}\s*[^\d,]*")
_SEVERAL = re.compile(r"\d.*?(,|;|\.\.|\bto\b|\s-\s)\s*[+-]?[\d.]")
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*\Z", re.DOTALL)


#: Units that a message may suggest instead of an unknown unit.
COMMON = (
    "m mm um nm cm km s ms us min h m/s mm/s km/h N mN kN Pa kPa MPa GPa K degC deg rad Hz kHz kg g J W bar psi rpm "
    "inch percent meter metre millimeter micrometer nanometer kilometer micron second millisecond microsecond minute "
    "hour newton millinewton kilonewton pascal kilopascal megapascal gigapascal kelvin celsius degree radian hertz "
    "gram kilogram"
)


def to_si(value: str, unit: str) -> float:
    """Convert a number with its unit, such as ``"20 mm"``, to the SI unit `unit`, or raise ValueError.

    A number without a unit is in SI. A factor that is a power of ten causes no rounding error: ``"1.1 mm"`` is 0.0011.
    """
    match = _QUANTITY.match(value)
    if match is None or _SEVERAL.search(value) or not _may_be_unit(match[2]):
        shown = value if len(value) <= _MOST_LETTERS else value[:_MOST_LETTERS] + "..."
        raise ValueError(f"expected {expected(unit)}, got {shown!r}{spelt(value)}")
    number, given = match.groups()
    if not math.isfinite(float(number)):
        raise ValueError(f"expected a finite number, got {value!r}")
    try:
        factor, offset = conversion(given, unit) if given else (1.0, 0.0)
    except ValueError as error:
        raise ValueError(f"{error}, got {value!r}{spelt(value)}") from None
    si = scaled(number, factor) + offset
    if not math.isfinite(si):
        raise ValueError(f"expected a finite number, got {value!r}")
    return si


def unit_behind(value: str) -> str:
    """Return the unit that follows the number in a text, or an empty text if no known unit follows."""
    match = _QUANTITY.match(value)
    return match[2] if match and match[2] and is_unit(match[2]) else ""


def spelt(value: str) -> str:
    """Return a hint on how to write a decimal point, a list or a range, or an empty text if none of them is meant."""
    if _THOUSANDS.fullmatch(value.strip()):
        return f" (write {value.replace(',', '')!r}, or {value.replace(',', '.')!r} with a decimal point)"
    if _COMMA.match(value):
        return f" (write a decimal point: {value.replace(',', '.', 1)!r})"
    if _SEVERAL.search(value.strip()):
        return " (write several values as [a, b, c], or a range as {linear: [a, b, n]} or {geometric: [a, b, n]})"
    return ""


def expected(unit: str, usual: str = "") -> str:
    """Return the name of a quantity with an example, as in ``a length (such as '20 mm')``."""
    spaced = unit.replace("**", "^").replace("*", " ")
    other = (f"a quantity in {unit}", f"1 {unit}") if is_unit(unit) else (f"a bare number in {unit}", "")
    name, example = _MEANINGS.get(spaced) or other
    example = usual or example
    return f"{name} (such as {example!r})" if example else name


#: Prefixes of printed units, indexed by the power of ten.
PREFIXES = {-9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_LEADING = re.compile(r"(m|s|N|Pa|J|W|Hz|ohm|S)(?![\w^*])")


def shown(value: float, unit: str, digits: int = 4, written: str = "") -> str:
    """Return a value in the SI unit `unit` as text: in the unit `written`, or else in a readable unit such as mm/s."""
    if written:
        factor, zero = conversion(written, unit)
        return f"{(value - zero) / factor:.{digits}g} {written}"
    if unit == "K":
        return f"{value - 273.15:.{digits}g} degC" if abs(value - 273.15) > 1e-9 else "0 degC"
    if unit in ("1", ""):
        return str(value) if isinstance(value, int) else f"{value:.{digits}g}"
    if unit == "rad":
        return f"{math.degrees(value):.{digits}g} deg"
    if value == 0 or not math.isfinite(value) or not _LEADING.match(unit):
        return f"{value:.{digits}g} {unit}"
    rounded = float(f"{value:.{digits}g}")
    exact = Decimal(repr(rounded))
    power = exact.adjusted() // 3 * 3
    power = power if power in PREFIXES else 0
    return f"{float(exact.scaleb(-power)):.{digits}g} {PREFIXES[power]}{unit}"


def seconds(duration: float) -> str:
    """Return a duration, given in s, as text such as ``0.5 s``, ``2 min 5 s`` or ``3 h 20 min``."""
    if duration < 60:
        return f"{duration:.2g} s" if duration < 10 else f"{duration:.0f} s"
    minutes, rest = divmod(round(duration), 60)
    if minutes < 10:
        return f"{minutes} min {rest} s"
    if minutes < 60:
        return f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60} min"


def likely(value: float, unit: str, usual: Sequence[str]) -> str:
    """Find the unit that was probably meant for a number without a unit; return the number with this unit.

    The units of the `usual` values, such as ``"20 mm"``, are tried. The result has the unit with which the number is
    nearest to the first usual value. The result is empty if the SI unit fits best.
    """
    found = {"": _decades(value, unit, usual[0])}
    for each in usual:
        meant = f"{value:g} {unit_behind(each)}"
        with suppress(ValueError):  # the converted number is too large
            found[meant] = _decades(to_si(meant, unit), unit, usual[0])
    return min(found, key=lambda meant: found[meant])


def _decades(value: float, unit: str, usual: str) -> float:
    """Return how many decades apart a number in SI and a usual value are; infinity for the number 0."""
    return abs(math.log10(abs(value)) - math.log10(abs(to_si(usual, unit)))) if value else math.inf


def example_unit(unit: str) -> str:
    """Return a common unit of a quantity with the given SI unit, such as MPa for Pa."""
    return _MEANINGS.get(unit, ("", f"1 {unit}"))[1].partition(" ")[2] or unit


def is_unit(text: str) -> bool:
    """Return whether a text is a known unit. A factor before the unit is allowed, as in ``10^3 um^3``.

    An empty text counts as the unit of pure numbers.
    """
    unit = _factor_and_unit(text[: 2 * _MOST_LETTERS])[1]
    if not _may_be_unit(unit):
        return False
    try:
        registry().parse_units(unit)
    except Exception:  # pint's parser raises many types of exceptions
        return False
    return True


def _may_be_unit(text: str) -> bool:
    return not (_NOT_A_UNIT.match(text) or len(text) > _MOST_LETTERS or _BAD_POWER.search(text))


def scaled(number: str, factor: float) -> float:
    """Return the product of a number and a factor, rounded correctly if the factor is a power of ten."""
    power = round(math.log10(factor))
    if math.isclose(factor, 10.0**power):
        return float(Decimal(number).scaleb(power))
    return float(number) * factor


@lru_cache(maxsize=1)
def registry() -> UnitRegistry[Any]:
    """Return the registry of pint for the units in `DEFINITIONS`."""
    from pint import UnitRegistry

    units: UnitRegistry[Any] = UnitRegistry(None)
    units.load_definitions(DEFINITIONS.split("\n"))
    return units


@lru_cache(maxsize=1024)
def conversion(given: str, unit: str) -> tuple[float, float]:
    """Return `factor` and `zero`, with which ``x`` in the unit `given` is ``x * factor + zero`` in the unit `unit`.

    Raise ValueError if `given` is unknown or has another dimension than `unit`.
    """
    from pint.errors import DimensionalityError, UndefinedUnitError

    units, wanted = registry(), "a pure number" if unit == "1" else expected(unit)
    try:
        before, spelling = _factor_and_unit(given)
        source, target = (units.parse_units(text) for text in (spelling, _factor_and_unit(unit)[1]))
        zero, one = (units.Quantity(size, source).to(target).magnitude for size in (0.0, 1.0))
    except UndefinedUnitError as error:
        word = error.args[0] if isinstance(error.args[0], str) else next(iter(error.args[0]))
        raise ValueError(f"unknown unit {word!r}{_nearest(word, unit if word == given.strip() else '')}") from None
    except DimensionalityError:
        hint = " (1 kg weighs 9.81 N)" if source == units.kilogram and target == units.newton else ""
        for angle in (units.turn, 1 / units.turn) if "[time]" in source.dimensionality else ():
            one = units.Quantity(1.0, source) * angle
            if one.is_compatible_with(target):
                hint = f" (1 {spelling} is {one.to(target).magnitude:.4g} {unit})"
        raise ValueError(f"expected {wanted}{hint}") from None
    except Exception:  # pint's parser raises many types of exceptions: TypeError, AssertionError, ...
        raise ValueError(f"expected {wanted}") from None
    factor = one - zero
    return (before * (1.0 if math.isclose(factor, 1.0) else factor), zero) if zero else (before * one, 0.0)


def converts(given: str, unit: str) -> bool:
    """Return whether the text `given` is a unit that can be converted to `unit`."""
    try:
        conversion(given, unit)
    except ValueError:
        return False
    return bool(given)


#: Coherent SI unit of each base dimension in `DEFINITIONS`.
_COHERENT = {
    "length": "m",
    "mass": "kg",
    "time": "s",
    "temperature": "K",
    "current": "A",
    "angle": "rad",
    "substance": "mol",
    "luminosity": "cd",
}


@lru_cache(maxsize=1024)
def dimension_of(unit: str) -> tuple[Any, str]:
    """Return the dimension of a unit as a pint object, and the coherent SI unit of that dimension.

    Raise ValueError if the unit is unknown.
    """
    if unit not in ("", "1") and not is_unit(unit):
        raise ValueError(f"unknown unit {unit!r}{_nearest(unit)}")
    dimension = registry().parse_units(_factor_and_unit(unit)[1]).dimensionality
    coherent = " * ".join(f"{_COHERENT[name.strip('[]')]}**{power}" for name, power in dimension.items())
    return dimension, coherent or "1"


def in_degrees(unit: str) -> str:
    """Return ``degC`` for ``C``, ``℃`` or ``deg C``, ``degF`` for ``F`` or ``deg F``, and other units unchanged."""
    found = _DEGREES.fullmatch(unicodedata.normalize("NFKC", unit.replace("º", "°")).strip())
    return f"deg{(found[1] or found[2]).upper()}" if found else unit


def _factor_and_unit(text: str) -> tuple[float, str]:
    """Return the factor before a unit (1 if there is none), and the unit as pint spells it, such as ``mm^3``."""
    text = re.sub(r"[⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻]+", lambda power: "^" + unicodedata.normalize("NFKC", power[0]), text)
    text = unicodedata.normalize("NFKC", text.replace("º", "°").replace("%", " percent ")).strip()
    found = _FACTOR.match(text)
    number = re.sub(r"^10\s*\^\s*", "1e", found[found.lastindex or 1].lstrip("x×X* ")) if found else "1"
    unit = text[found.end() :] if found else text
    unit = re.sub(r"^(HV|HBW?)\s?\d+([.,/]\d+)*$", r"\1", unit)  # 10 in HV10 is the test load
    unit = unit.replace("−", "-").replace("·", " ").replace("microns", "micron")
    unit = re.sub(r"(?<=[A-Za-zμ])\^?\{?(-?\d{1,2})\}?(?!\d)", r"^\1", unit)
    unit = in_degrees(unit)
    unit = "" if unit == "1" else f"1{unit}" if unit.startswith("/") else unit
    return float(f"1{number}" if number[0] in "eE" else number), unit


def _nearest(word: str, unit: str = "") -> str:
    """Return a hint with a unit in `COMMON` that is similar to `word`.

    If `unit` is given, the similar unit must have its dimension. If no unit is similar, the hint names the quantity
    that is measured in `unit`, or is empty if `unit` is not given. For a Rockwell hardness such as ``HRC``, the hint
    says how to convert it.
    """
    common = COMMON.split()
    if re.match("HR[A-K]", word):
        return " (Rockwell hardness is not a pressure: convert it to HV by a table)"
    known = [each for each in common if not unit or dimension_of(each) == dimension_of(unit)]
    return similar(word, known) or (f", expected {expected(unit)}" if unit else "")
