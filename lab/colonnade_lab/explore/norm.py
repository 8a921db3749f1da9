"""Norms of the RenderIndex: arithmetic of one number ``x``, such as ``1 + x / 0.1``."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from dataclasses import dataclass

#: Characters of a norm, at most; deeper brackets would exhaust the stack.
MAX_LENGTH = 100

_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: math.pow,
}
_UNARY: dict[type[ast.unaryop], Callable[[float], float]] = {ast.USub: operator.neg, ast.UAdd: operator.pos}
_FUNCTIONS: dict[str, Callable[..., float]] = {
    "abs": abs, "exp": math.exp, "log": math.log, "max": max, "min": min, "sqrt": math.sqrt,
}  # fmt: skip
_KNOWN = f"x, numbers, + - * / **, brackets, {', '.join(_FUNCTIONS)}"


@dataclass(frozen=True)
class Norm:
    """A norm.

    Attributes:
        text: The expression.

    Raises:
        ValueError: The text is none; the message names what is wrong.
    """

    text: str

    def __post_init__(self) -> None:
        if len(self.text) > MAX_LENGTH:
            raise ValueError(f"the norm has {len(self.text)} characters: at most {MAX_LENGTH}")
        try:
            tree = ast.parse(self.text.strip(), mode="eval").body
        except SyntaxError as error:
            raise ValueError(f"the norm {self.text!r} is no expression: {error.msg}") from None
        except ValueError as error:
            raise ValueError(f"the norm {self.text!r} is no expression: {error}") from None
        self._check(tree)
        object.__setattr__(self, "_tree", tree)

    def __call__(self, x: float) -> float:
        """The value for a number; NaN if there is none."""
        try:
            value = float(self._value(self._tree, x))  # type: ignore[attr-defined]
        except (ArithmeticError, ValueError, TypeError):
            return math.nan
        return value if math.isfinite(value) else math.nan

    def _check(self, node: ast.expr) -> None:
        """Refuse all but arithmetic."""
        match node:
            case ast.Constant(int() | float() as value) if not isinstance(value, bool):
                return
            case ast.Name("x"):
                return
            case ast.BinOp(left, operation, right) if type(operation) in _BINARY:
                parts = [left, right]
            case ast.UnaryOp(operation, operand) if type(operation) in _UNARY:
                parts = [operand]
            case ast.Call(ast.Name(name), [_, *_] as parts, []) if name in _FUNCTIONS:
                pass
            case _:
                raise ValueError(f"the norm {self.text!r} has {ast.unparse(node)!r}: it may have {_KNOWN}")
        for part in parts:
            self._check(part)

    def _value(self, node: ast.expr, x: float) -> float:
        match node:
            case ast.Constant(int() | float() as value):
                return float(value)  # powers of whole numbers have no end
            case ast.BinOp(left, operation, right):
                return _BINARY[type(operation)](self._value(left, x), self._value(right, x))
            case ast.UnaryOp(operation, operand):
                return _UNARY[type(operation)](self._value(operand, x))
            case ast.Call(ast.Name(name), arguments):
                return _FUNCTIONS[name](*(self._value(one, x) for one in arguments))
        return x
