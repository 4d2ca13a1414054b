"""Counts the operations of kernels: their source is rewritten so that every operation on floating-point numbers counts.

Only in a process of its own, with ``NUMBA_DISABLE_JIT=1``: :func:`count_kernels` before any kernel is imported.
"""

from __future__ import annotations

import ast
import builtins
import operator
import sys
from collections import Counter
from importlib.machinery import PathFinder, SourceFileLoader
from typing import Any

import numpy as np

COUNTS: Counter[str] = Counter()
KERNELS = {"kernel", "compiled", "spliced", "nested", "inlined", "fused"}  # the decorators of what is compiled
OPERATIONS = {ast.Add: "add", ast.Sub: "add", ast.Mult: "multiply", ast.Div: "divide"}
COMPARES = {ast.Lt: "lt", ast.LtE: "le", ast.Gt: "gt", ast.GtE: "ge"}
FUNCTIONS = {"sqrt": "root", "pow": "power"} | dict.fromkeys(
    ("exp", "expm1", "log", "log1p", "sin", "cos", "asin", "acos", "atan2"), "function"
)


def _size(*values: Any) -> int:
    """Return how many floating-point numbers an operation on some values makes."""
    sizes = [np.size(value) for value in values if isinstance(value, float) or np.asarray(value).dtype.kind == "f"]
    return max(sizes, default=0)


def counted(kind: str, times: int, *values: Any) -> Any:
    """Count operations on values, of which the last is returned."""
    COUNTS[kind] += times * _size(*values)
    return values[-1]


def power(base: Any, exponent: Any) -> Any:
    """Count a power: small whole ones are products."""
    whole = isinstance(exponent, int) and 0 < exponent < 5
    COUNTS["multiply" if whole else "power"] += (exponent - 1 if whole else 1) * _size(base)
    return base**exponent


def compare(way: str, left: Any, right: Any) -> Any:
    """Count a comparison."""
    COUNTS["compare"] += _size(left, right)
    return getattr(operator, way)(left, right)


class _Counting(ast.NodeTransformer):
    """Rewrites what is compiled."""

    inside = False

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        names = {getattr(part, "id", None) for each in node.decorator_list for part in ast.walk(each)}
        if self.inside or names & KERNELS:
            self.inside = True
            node.decorator_list, decorators = [], node.decorator_list
            self.generic_visit(node)
            node.decorator_list = decorators
            self.inside = False
        return node

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        return node

    def _note(self, kind: str, times: int, *values: ast.expr) -> ast.expr:
        return ast.Call(
            ast.Name("_operation_counted", ast.Load()), [ast.Constant(kind), ast.Constant(times), *values], []
        )

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        if not self.inside:
            return node
        if isinstance(node.op, ast.Pow):
            return ast.Call(ast.Name("_power_counted", ast.Load()), [node.left, node.right], [])
        kind = OPERATIONS.get(type(node.op))
        return self._note(kind, 1, node) if kind else node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        target = node.target
        read = ast.parse(ast.unparse(target), mode="eval").body
        return self.visit(ast.Assign([target], ast.BinOp(read, node.op, node.value)))

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        compares = COMPARES.get(type(node.ops[0]))
        if not self.inside or len(node.ops) > 1 or compares is None:
            return node
        return ast.Call(
            ast.Name("_compare_counted", ast.Load()), [ast.Constant(compares), node.left, *node.comparators], []
        )

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        name = getattr(node.func, "attr", getattr(node.func, "id", None))
        if not self.inside or name is None:
            return node
        if name in ("max", "min"):
            return self._note("compare", len(node.args) - 1, node)
        return self._note(FUNCTIONS[name], 1, node) if name in FUNCTIONS else node

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        self.generic_visit(node)
        return self._note("load", 1, node) if self.inside and isinstance(node.ctx, ast.Load) else node

    def visit_Assign(self, node: ast.Assign) -> Any:
        self.generic_visit(node)
        if not self.inside:
            return node
        targets = [part for target in node.targets for part in getattr(target, "elts", [target])]
        stored = [part for part in targets if isinstance(part, ast.Subscript)]
        reads = [ast.parse(ast.unparse(part), mode="eval").body for part in stored]
        return [node, *(ast.Expr(self._note("store", 1, read)) for read in reads)]

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        return node


class _Loader(SourceFileLoader):
    def get_code(self, fullname: str) -> Any:
        path = self.get_filename(fullname)
        tree = ast.fix_missing_locations(_Counting().visit(ast.parse(self.get_data(path))))
        return compile(tree, path, "exec")


class _Finder(PathFinder):
    @classmethod
    def find_spec(cls, fullname: str, path: Any = None, target: Any = None) -> Any:
        spec = super().find_spec(fullname, path, target) if fullname.startswith("mdr_dask.physics.") else None
        if spec and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec


def count_kernels() -> None:
    """Let every kernel that is imported from now on count its operations in `COUNTS`."""
    vars(builtins).update(_operation_counted=counted, _power_counted=power, _compare_counted=compare)
    sys.meta_path.insert(0, _Finder)
