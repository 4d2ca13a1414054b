"""Conditions and formulas that a user types, such as ``velocity > 3 km/h and contact_fraction < 50 %``.

Python's own parser converts the text to a syntax tree. The nodes of the tree are evaluated with numpy. No text is
executed.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask.arrays import SAME
from mdr_dask.errors import DataError, did_you_mean
from mdr_dask.units import conversion, dimension_of, is_unit

FUNCTIONS: Mapping[str, Callable[[Any], Any]] = {
    "abs": np.abs,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "log10": np.log10,
}
#: Dimension of a column with several words in each row. The comparison ``==`` is true if it is true for any word of the
#: row.
ALTERNATIVES = "alternatives"
_NUMBER = re.compile(r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![\w.])|(?<![\w.])\d+\.?\d*(?=[^\W\d_])")
_PIECE = re.compile(r"\s*(\*\*|[*/^]|-?\d+|[^\W\d]\w*|[%°]\w*)")
_KEYWORDS = {"and", "or", "not", "in", "is", "if", "else"}
_OPERATORS: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: np.power,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}


Find = Callable[[str], xr.DataArray | None]


class Value(NamedTuple):
    """The value of an expression: numbers in SI, words, or truth values.

    `dimension` is the physical dimension of the numbers in pint, such as length. It is None for words, truth values,
    numbers that are typed without a unit, and columns whose unit is unknown to pint. If numbers whose dimension is None
    are compared with a quantity or added to a quantity, they count as SI values of this quantity.
    """

    array: Any
    dimension: Any = None

    @property
    def kind(self) -> str:
        """The letter that numpy uses for the data type, such as ``f`` for floats."""
        return str((self.array if hasattr(self.array, "dtype") else np.asarray(self.array)).dtype.kind)


@dataclass(frozen=True)
class Expression:
    """A parsed text. In the syntax tree, a name such as ``_quantity_0`` stands for a number with a unit."""

    text: str
    tree: ast.expr
    quantities: Mapping[str, Value] = field(repr=False)

    @property
    def names(self) -> set[str]:
        """All names in the expression, including words without quotation marks."""
        found = {_name(node) for node in ast.walk(self.tree) if isinstance(node, ast.Name | ast.Attribute)}
        return found - self.quantities.keys() - FUNCTIONS.keys()


def parse(text: str) -> Expression:
    """Parse a condition or a formula. Raise DataError if the text is not a valid expression."""
    wanted = "expected a condition such as 'velocity > 1 mm/s and hurst < 0.7', or a formula such as 'velocity / 2'"
    marked, quantities = _without_units(text)
    try:
        tree = ast.parse(marked.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise DataError(f"{wanted}, got {text!r}{_likely_mistake(marked)}") from None
    return Expression(text, tree, quantities)


def evaluate(expression: Expression, find: Find, known: Sequence[str] = ()) -> Value:
    """Return the value of an expression.

    DataError is raised for unknown names, for operations that are not allowed, and for quantities of different kinds.

    `find` returns a column with its unit in ``attrs["units"]``, or None if there is no column of this name.
    """
    try:
        with np.errstate(all="ignore"):
            return _Evaluation(expression, find, known).value(expression.tree)
    except RecursionError:
        raise DataError(f"expected a shorter expression, got {len(expression.text)} characters") from None


def _without_units(text: str) -> tuple[str, dict[str, Value]]:
    """Replace each number that has a unit by a name that Python can parse. Also return the values of the names."""
    quantities: dict[str, Value] = {}
    parts, end = [], 0
    for match in _NUMBER.finditer(text):
        unit = "" if match.start() < end else _unit_at(text, match.end())
        if unit.strip():
            dimension, coherent = dimension_of(unit.strip())
            factor, zero = conversion(unit.strip(), coherent)
            name = f"_quantity_{len(quantities)}"
            quantities[name] = Value(float(match[0]) * factor + zero, dimension)
            parts += [text[end : match.start()], f" {name} "]
            end = match.end() + len(unit)
    return "".join([*parts, text[end:]]), quantities


def _unit_at(text: str, start: int) -> str:
    """Return the longest unit that begins at the position `start` of a text, or an empty text if there is none."""
    longest, end = start, start
    while piece := _PIECE.match(text, end):
        if piece[1] in _KEYWORDS or (end == start and not re.match(r"[^\W\d]|[%°]", piece[1])):
            break
        end = piece.end()
        if is_unit(text[start:end].strip()):
            longest = end
    return text[start:longest]


def _likely_mistake(text: str) -> str:
    unit = re.search(rf"(?:{_NUMBER.pattern})\s*([^\W\d]\w*)", text)
    if unit and unit[1] not in _KEYWORDS:
        return f"; unknown unit {unit[1]!r}"
    return "; write == to compare" if re.search(r"[^<>=!]=[^=]", text) else ""


def _name(node: ast.expr) -> str:
    """Return the name that a node of the syntax tree stands for, with ``_`` for dots."""
    if isinstance(node, ast.Attribute):
        return f"{_name(node.value)}_{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


class _Evaluation:
    def __init__(self, expression: Expression, find: Find, known: Sequence[str]) -> None:
        self.text, self.quantities, self.find, self.known = expression.text, expression.quantities, find, known

    def value(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                return Value(float(number))
            case ast.Constant(value=str() as word):
                return Value(word)
            case ast.Name() | ast.Attribute():
                return self._named(_name(node))
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return Value(np.logical_not(self._truth(operand)))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                value = self._number(operand)
                return Value(-value.array, value.dimension)
            case ast.BoolOp(op=op, values=values):
                join = operator.and_ if isinstance(op, ast.And) else operator.or_
                return Value(reduce(join, map(self._truth, values)))
            case ast.Compare(left=left, ops=ops, comparators=rights):
                pairs = zip([left, *rights], ops, rights, strict=False)
                return Value(reduce(operator.and_, (self._compared(node, *pair) for pair in pairs)))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return self._combined(node, self._number(left), op, self._number(right))
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
                return self._function(name, self._number(argument))
        raise self._refused(node)

    def _refused(self, node: ast.AST) -> DataError:
        got = ast.unparse(node)
        for name in self.quantities:
            got = got.replace(name, "a quantity")
        allowed = f"only + - * / **, comparisons, 'and', 'or', 'not', 'in', and the functions {', '.join(FUNCTIONS)}"
        return DataError(f"{self.text!r}: expected {allowed}, got {got!r}")

    def _named(self, name: str) -> Value:
        if name in self.quantities:
            return self.quantities[name]
        found = self.find(name)
        if found is None:
            raise DataError(f"{self.text!r}: no column {name!r}{did_you_mean(name, self.known)}")
        try:
            return Value(found, dimension_of(found.attrs.get("units", "1"))[0] if found.dtype.kind in "fiu" else None)
        except ValueError:  # a model of another package may use an unknown unit
            return Value(found)

    def _truth(self, node: ast.expr) -> Any:
        value = self.value(node)
        if value.kind != "b":
            raise DataError(f"{self.text!r}: expected a comparison such as 'hurst < 0.7'")
        return value.array

    def _number(self, node: ast.expr) -> Value:
        value = self.value(node)
        if value.kind not in "fiu":
            raise DataError(f"{self.text!r}: expected numbers, got {ast.unparse(node)!r}")
        return value

    def _compared(self, node: ast.AST, left: ast.expr, op: ast.cmpop, right: ast.expr) -> Any:
        if isinstance(op, ast.In | ast.NotIn) and isinstance(right, ast.Tuple | ast.List | ast.Set):
            found = reduce(operator.or_, (self._equal(left, each) for each in right.elts))
            return found if isinstance(op, ast.In) else np.logical_not(found)
        if isinstance(op, ast.Eq | ast.NotEq):
            found = self._equal(left, right)
            return found if isinstance(op, ast.Eq) else np.logical_not(found)
        if type(op) not in _OPERATORS:
            raise self._refused(node)
        first, second = self._number(left), self._number(right)
        self._require_alike(first, second)
        return _OPERATORS[type(op)](first.array, second.array)

    def _equal(self, left: ast.expr, right: ast.expr) -> Any:
        """Return where numbers agree within `SAME`, or where words are equal.

        If one side is a word, a name on the other side that is not a column is a word too.
        """
        sides = [None if self._is_unknown(node) else self.value(node) for node in (left, right)]
        if any(side is not None and side.kind in "OUT" for side in sides):
            names = (_name(left), _name(right))
            first, second = (side or Value(name) for side, name in zip(sides, names, strict=True))
            if not (first.kind in "OUT" and second.kind in "OUT"):
                raise DataError(
                    f"{self.text!r}: expected a comparison of two words or a comparison of two numbers, "
                    "got a word and a number"
                )
            same = first.array == second.array
            return same.any(ALTERNATIVES) if ALTERNATIVES in getattr(same, "dims", ()) else same
        first, second = self._number(left), self._number(right)
        self._require_alike(first, second)
        return np.abs(first.array - second.array) <= SAME * np.abs(second.array)

    def _is_unknown(self, node: ast.expr) -> bool:
        name = _name(node)
        return bool(name) and name not in self.quantities and self.find(name) is None

    def _require_alike(self, first: Value, second: Value) -> None:
        if None not in (first.dimension, second.dimension) and first.dimension != second.dimension:
            got = f"{_shown(first.dimension)} and {_shown(second.dimension)}"
            raise DataError(f"{self.text!r}: expected quantities of the same kind, got {got}")

    def _combined(self, node: ast.AST, left: Value, op: ast.operator, right: Value) -> Value:
        result = _OPERATORS[type(op)](left.array, right.array)
        first, second = left.dimension, right.dimension
        if isinstance(op, ast.Pow):
            if not first:
                return Value(result, first)
            if np.ndim(right.array):
                raise self._refused(node)
            return Value(result, first ** float(right.array))
        if isinstance(op, ast.Add | ast.Sub):
            self._require_alike(left, right)
            return Value(result, second if first is None else first)
        if None in (first, second):
            known = second if first is None else first
            inverse = first is None and known is not None and isinstance(op, ast.Div)
            return Value(result, known**-1 if inverse else known)
        return Value(result, first * second if isinstance(op, ast.Mult) else first / second)

    def _function(self, name: str, value: Value) -> Value:
        result = FUNCTIONS[name](value.array)
        if name == "abs" or not value.dimension:
            return Value(result, value.dimension)
        if name == "sqrt":
            return Value(result, value.dimension**0.5)
        raise DataError(f"{self.text!r}: expected a pure number in {name}(...), got {_shown(value.dimension)}")


def _shown(dimension: Any) -> str:
    return str(dimension).replace("[", "").replace("]", "") if dimension else "a pure number"
