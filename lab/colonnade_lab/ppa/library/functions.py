"""Truth tables of the Boolean functions of liberty cells."""

from __future__ import annotations

import re
from collections.abc import Sequence

from colonnade.common.errors import UserError

_TOKEN = re.compile(r"\s*([A-Za-z_]\w*|[01]|[()!~'&*|+^])")

#: Maximum number of inputs. A table of n inputs has 2^n entries.
MAX_INPUTS = 10


def truth_table(function: str, inputs: Sequence[str]) -> str:
    """The truth table of a function: a 0 or 1 for each combination of inputs, the first input least significant.

    Raises:
        UserError: The function cannot be parsed, or has too many inputs.
    """
    if len(inputs) > MAX_INPUTS:
        raise UserError(f"the liberty has a cell with {len(inputs)} inputs: power estimation allows {MAX_INPUTS}")
    table = _Parser(function, inputs).table()
    return "".join(str(table >> number & 1) for number in range(1 << len(inputs)))


class _Parser:
    """A recursive-descent parser. Values are truth tables as integers. Precedence: negation, ^, &, |."""

    def __init__(self, function: str, inputs: Sequence[str]) -> None:
        self._function, self._inputs = function, inputs
        self._words = _TOKEN.findall(function)
        if "".join(self._words) != re.sub(r"\s", "", function):
            raise self._error()
        self._all = (1 << (1 << len(inputs))) - 1

    def table(self) -> int:
        """The truth table of the whole function."""
        value = self._or()
        if self._words:
            raise self._error()
        return value

    def _error(self) -> UserError:
        return UserError(f"cannot parse the liberty's function {self._function!r} of {', '.join(self._inputs)}")

    def _next(self) -> str:
        return self._words[0] if self._words else ""

    def _or(self) -> int:
        value = self._and()
        while self._next() in ("|", "+"):
            self._words.pop(0)
            value |= self._and()
        return value

    def _and(self) -> int:
        value = self._xor()
        # Adjacent factors are a product
        while self._next() and self._next() not in ("|", "+", ")"):
            if self._next() in ("&", "*"):
                self._words.pop(0)
            value &= self._xor()
        return value

    def _xor(self) -> int:
        value = self._factor()
        while self._next() == "^":
            self._words.pop(0)
            value ^= self._factor()
        return value

    def _factor(self) -> int:
        if not self._words:
            raise self._error()
        word = self._words.pop(0)
        if word in ("!", "~"):
            return self._all ^ self._factor()
        if word == "(":
            value = self._or()
            if self._next() != ")":
                raise self._error()
            self._words.pop(0)
        elif word in ("0", "1"):
            value = self._all * int(word)
        elif word in self._inputs:
            position = self._inputs.index(word)
            value = sum(1 << number for number in range(1 << len(self._inputs)) if number >> position & 1)
        else:
            raise self._error()
        while self._next() == "'":
            self._words.pop(0)
            value ^= self._all
        return value
