"""Conditions and formulas as a user types them: ``velocity > 3 km/h and contact_fraction < 50 %``.

A small part of Python's grammar, walked node by node: numbers, quantities, names, words, arithmetic, comparisons,
``and``, ``or``, ``not``, ``in`` and the functions in `FUNCTIONS`. No text is ever run.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from mdr_dask.errors import DataError, did_you_mean
from mdr_dask.units import conversion, dimension_of, is_unit

FUNCTIONS: Mapping[str, Callable[[Any], Any]] = {
    "abs": np.abs,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "log10": np.log10,
}
#: Numbers that agree to this part are equal, as in a selection.
SAME = 1e-5
_LONGEST = 500
_NUMBER = re.compile(r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![\w.])|(?<![\w.])\d+\.?\d*(?=[^\W\d_])")
_PIECE = re.compile(r"\s*(\*\*|[*/^]|-?\d+|[^\W\d]\w*|[%°]\w*)")
_KEYWORDS = {"and", "or", "not", "in", "is", "if", "else"}
_ARITHMETIC: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_ORDER: Mapping[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}


class Column(NamedTuple):
    """Values that a name stands for: numbers with their coherent SI unit, or words and truths with None."""

    array: Any
    unit: str | None


@dataclass(frozen=True)
class Value:
    """Numbers in SI with their dimension, words, or truths.

    `dimension` is pint's, None for a bare number, which is SI of anything, and for words and truths.
    """

    array: Any
    dimension: Any = None

    @property
    def is_words(self) -> bool:
        """Whether these are words."""
        return _kind(self.array) in "OUT"


@dataclass(frozen=True)
class Expression:
    """A text that has been read: its tree, and the quantities in it by the names that stand for them there."""

    text: str
    tree: ast.expr
    quantities: Mapping[str, Value] = field(repr=False)

    @property
    def names(self) -> set[str]:
        """Names that stand in it, words without quotation marks among them."""
        found = {_name(node) for node in ast.walk(self.tree) if isinstance(node, ast.Name | ast.Attribute)}
        return found - self.quantities.keys() - FUNCTIONS.keys()


def parse(text: str) -> Expression:
    """Read a condition or a formula.

    Raises
    ------
    DataError
        If it is none.
    """
    wanted = "expected a condition such as 'velocity > 1 mm/s and hurst < 0.7'"
    if len(text) > _LONGEST:
        raise DataError(f"{wanted}, got {len(text)} characters")
    marked, quantities = _without_units(text)
    try:
        tree = ast.parse(marked.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise DataError(f"{wanted}, got {text!r}{_likely_mistake(marked)}") from None
    return Expression(text, tree, quantities)


def evaluate(expression: Expression, find: Callable[[str], Column | None], known: Sequence[str] = ()) -> Value:
    """Return what an expression comes to.

    Parameters
    ----------
    expression : Expression
        As `parse` returns it.
    find : callable, str -> Column or None
        Gives the values that a name stands for; None if there is no such name.
    known : sequence of str
        Names for a hint, where one is unknown.

    Raises
    ------
    DataError
        If a name is unknown, or numbers of different dimensions are added or compared.
    """
    with np.errstate(all="ignore"):
        return _Walk(expression, find, known).value(expression.tree)


def _without_units(text: str) -> tuple[str, dict[str, Value]]:
    """Put a name in place of every number with a unit, which is no Python."""
    quantities: dict[str, Value] = {}
    parts, end = [], 0
    for match in _NUMBER.finditer(text):
        unit = "" if match.start() < end else _unit_at(text, match.end())
        if unit.strip():
            name = f"_quantity_{len(quantities)}"
            quantities[name] = _quantity(float(match[0]), unit.strip())
            parts += [text[end : match.start()], f" {name} "]
            end = match.end() + len(unit)
    return "".join([*parts, text[end:]]), quantities


def _unit_at(text: str, start: int) -> str:
    """Return the longest unit that begins there."""
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
    return "; == compares" if re.search(r"[^<>=!]=[^=]", text) else ""


def _quantity(number: float, unit: str) -> Value:
    dimension, coherent = dimension_of(unit)
    factor, zero = conversion(unit, coherent)
    return Value(number * factor + zero, dimension)


def _name(node: ast.expr) -> str:
    """Return a name; dots of nested parameters become ``_``."""
    if isinstance(node, ast.Attribute):
        return f"{_name(node.value)}_{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


class _Walk:
    """One evaluation of an expression."""

    def __init__(self, expression: Expression, find: Callable[[str], Column | None], known: Sequence[str]) -> None:
        self._expression, self._find, self._known = expression, find, known

    def value(self, node: ast.expr) -> Value:
        """Return what a node comes to."""
        match node:
            case ast.Constant(value=bool()) | ast.Constant(value=None):
                raise self._refused(node)
            case ast.Constant(value=int() | float() | str() as constant):
                return Value(constant if isinstance(constant, str) else float(constant))
            case ast.Name() | ast.Attribute():
                return self._named(node)
            case ast.UnaryOp(op=ast.Not()):
                return Value(np.logical_not(self._truth(node.operand)))
            case ast.UnaryOp(op=ast.USub()):
                value = self._number(node.operand)
                return Value(-value.array, value.dimension)
            case ast.BoolOp():
                join = operator.and_ if isinstance(node.op, ast.And) else operator.or_
                truths = [self._truth(each) for each in node.values]
                return Value(_joined(truths, join))
            case ast.Compare():
                return Value(_joined(list(self._comparisons(node)), operator.and_))
            case ast.BinOp():
                return self._arithmetic(node)
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
                return self._function(name, argument)
        raise self._refused(node)

    def _refused(self, node: ast.AST) -> DataError:
        shown = ast.unparse(node)
        for name in self._expression.quantities:
            shown = shown.replace(name, "a quantity")
        allowed = f"+ - * / **, comparisons, and, or, not, in, and {', '.join(FUNCTIONS)}"
        return DataError(f"{self._expression.text!r}: expected {allowed}, got {shown!r}")

    def _named(self, node: ast.expr) -> Value:
        name = _name(node)
        if name in self._expression.quantities:
            return self._expression.quantities[name]
        found = self._find(name)
        if found is None:
            raise DataError(f"{self._expression.text!r}: no column {name!r}{did_you_mean(name, self._known)}")
        try:
            return Value(found.array, None if found.unit is None else dimension_of(found.unit)[0])
        except ValueError:  # a unit of a user's own model, of which pint knows nothing
            return Value(found.array)

    def _truth(self, node: ast.expr) -> Any:
        value = self.value(node).array
        if _kind(value) != "b":
            raise DataError(f"{self._expression.text!r}: expected a comparison such as 'hurst < 0.7'")
        return value

    def _number(self, node: ast.expr) -> Value:
        value = self.value(node)
        if _kind(value.array) not in "fiu":
            raise DataError(f"{self._expression.text!r}: expected numbers, got {ast.unparse(node)!r}")
        return value

    def _comparisons(self, node: ast.Compare) -> Iterator[Any]:
        left = node.left
        for comparison, right in zip(node.ops, node.comparators, strict=True):
            if isinstance(comparison, ast.In | ast.NotIn):
                if not isinstance(right, ast.Tuple | ast.List | ast.Set):
                    raise self._refused(node)
                found = _joined([self._equal(left, each) for each in right.elts], operator.or_)
                yield found if isinstance(comparison, ast.In) else np.logical_not(found)
            elif isinstance(comparison, ast.Eq | ast.NotEq):
                found = self._equal(left, right)
                yield found if isinstance(comparison, ast.Eq) else np.logical_not(found)
            elif type(comparison) in _ORDER:
                first, second = self._alike(self._number(left), self._number(right))
                yield _ORDER[type(comparison)](first, second)
            else:
                raise self._refused(node)
            left = right

    def _equal(self, left: ast.expr, right: ast.expr) -> Any:
        first, second = self._sides(left, right)
        if first.is_words != second.is_words:
            raise DataError(f"{self._expression.text!r}: expected words beside words, and numbers beside numbers")
        if first.is_words:
            return first.array == second.array
        one, other = self._alike(first, second)
        return np.abs(one - other) <= SAME * np.abs(other)

    def _sides(self, left: ast.expr, right: ast.expr) -> tuple[Value, Value]:
        """Return what is compared; beside words, a name without a meaning is a word itself."""
        sides = [None if self._is_unknown(node) else self.value(node) for node in (left, right)]
        if not any(side is not None and side.is_words for side in sides):
            return self._number(left), self._number(right)
        first, second = (
            Value(_name(node)) if side is None else side for node, side in zip((left, right), sides, strict=True)
        )
        return first, second

    def _is_unknown(self, node: ast.expr) -> bool:
        name = _name(node)
        return bool(name) and name not in self._expression.quantities and self._find(name) is None

    def _alike(self, first: Value, second: Value) -> tuple[Any, Any]:
        """Return numbers that may be added and compared."""
        if first.dimension is not None and second.dimension is not None and first.dimension != second.dimension:
            raise DataError(
                f"{self._expression.text!r}: expected quantities of one dimension, "
                f"got {_shown(first.dimension)} and {_shown(second.dimension)}"
            )
        return first.array, second.array

    def _arithmetic(self, node: ast.BinOp) -> Value:
        left, right = self._number(node.left), self._number(node.right)
        if isinstance(node.op, ast.Pow):
            return self._power(node, left, right)
        if type(node.op) not in _ARITHMETIC:
            raise self._refused(node)
        result = _ARITHMETIC[type(node.op)](left.array, right.array)
        if isinstance(node.op, ast.Add | ast.Sub):
            self._alike(left, right)
            return Value(result, left.dimension if left.dimension is not None else right.dimension)
        if left.dimension is None or right.dimension is None:
            sign = -1 if right.dimension is not None and isinstance(node.op, ast.Div) else 1
            known = left.dimension if left.dimension is not None else right.dimension
            return Value(result, known if known is None else known**sign)
        times = isinstance(node.op, ast.Mult)
        return Value(result, left.dimension * right.dimension if times else left.dimension / right.dimension)

    def _power(self, node: ast.BinOp, base: Value, exponent: Value) -> Value:
        result = np.power(base.array, exponent.array)
        if not base.dimension:
            return Value(result, base.dimension)
        if np.ndim(exponent.array):
            raise self._refused(node)
        return Value(result, base.dimension ** float(exponent.array))

    def _function(self, name: str, argument: ast.expr) -> Value:
        value = self._number(argument)
        result = FUNCTIONS[name](value.array)
        if name == "abs" or not value.dimension:
            return Value(result, value.dimension)
        if name == "sqrt":
            return Value(result, value.dimension**0.5)
        raise DataError(f"{self._expression.text!r}: expected a pure number in {name}, got {_shown(value.dimension)}")


def _kind(array: Any) -> str:
    """Return the kind of a type as numpy abbreviates it, without loading an array to know it."""
    return str((array if hasattr(array, "dtype") else np.asarray(array)).dtype.kind)


def _joined(values: Sequence[Any], join: Callable[[Any, Any], Any]) -> Any:
    result = values[0]
    for value in values[1:]:
        result = join(result, value)
    return result


def _shown(dimension: Any) -> str:
    return str(dimension).replace("[", "").replace("]", "") if dimension else "a pure number"
