"""Conditions over parameters, as text that is data: when a parameter is visible, which combinations are valid.

A condition consists of `and`, `or`, `not`, the comparisons `< <= > >= == !=`, `+ - *`, numbers and names of parameters,
with their meaning in Python. It is parsed once and never executed as code. It can be evaluated for many shapes at once.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

Term = Callable[[Mapping[str, Any]], Any]

_COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_ARITHMETIC: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
}


@dataclass(frozen=True)
class Condition:
    """A condition such as `is_monoleg and (not is_monoleg_tent or monoleg_tent_pct < 0.4)`.

    Raises ValueError where it contains anything else than the module's docstring lists.
    """

    text: str

    def __post_init__(self) -> None:
        _ = self._parsed

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters in it, each once, in the order of their first mention."""
        return self._parsed[1]

    def holds(self, values: Mapping[str, Any]) -> Any:
        """Whether it holds for `values` of all its `names`: a bool for numbers, a bool array (n,) for arrays (n,)."""
        return self._parsed[0](values)

    @cached_property
    def _parsed(self) -> tuple[Term, tuple[str, ...]]:
        try:
            tree = ast.parse(self.text.strip(), mode="eval").body
        except SyntaxError as error:
            raise ValueError(f"condition {self.text!r}: {error.msg}") from error
        names: dict[str, None] = {}
        return self._truth(tree, names), tuple(names)

    def _truth(self, node: ast.expr, names: dict[str, None]) -> Term:
        """A term that is true or false, made of operators that numbers and arrays both have."""
        match node:
            case ast.BoolOp(op=join, values=parts):
                terms = [self._truth(part, names) for part in parts]
                joined = operator.and_ if isinstance(join, ast.And) else operator.or_
                return lambda values: reduce(joined, [term(values) for term in terms])
            case ast.UnaryOp(op=ast.Not(), operand=part):
                denied = self._truth(part, names)
                return lambda values: denied(values) == False  # noqa: E712  # `not` has no meaning for arrays
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARISONS:
                return self._join(_COMPARISONS[type(op)], left, right, names)
        number = self._number(node, names)
        return lambda values: number(values) != 0

    def _number(self, node: ast.expr, names: dict[str, None]) -> Term:
        match node:
            case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _ARITHMETIC:
                return self._join(_ARITHMETIC[type(sign)], left, right, names)
            case ast.Name(id=name):
                names[name] = None
                return operator.itemgetter(name)
            case ast.Constant(value=int() | float() as number):
                return lambda values: number
        raise ValueError(f"condition {self.text!r}: {ast.unparse(node)!r} is not allowed")

    def _join(self, function: Callable[[Any, Any], Any], a: ast.expr, b: ast.expr, names: dict[str, None]) -> Term:
        left, right = self._number(a, names), self._number(b, names)
        return lambda values: function(left(values), right(values))
