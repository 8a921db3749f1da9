"""Truth tables of the functions that a liberty gives for its cells' outputs."""

from __future__ import annotations

import re
from collections.abc import Sequence

from colonnade.common.errors import UserError

_TOKEN = re.compile(r"\s*([A-Za-z_]\w*|[01]|[()!~'&*|+^])")

#: Most inputs of a cell: a table has two to the power of them entries.
MAX_INPUTS = 10


def truth_table(function: str, inputs: Sequence[str]) -> str:
    """The value, 0 or 1, for each combination of inputs; the first input is the least significant bit of its number.

    Raises:
        UserError: the function is not understood, or has too many inputs.
    """
    if len(inputs) > MAX_INPUTS:
        raise UserError(f"the liberty has a cell of {len(inputs)} inputs: power knows up to {MAX_INPUTS}")
    table = _Parser(function, inputs).table()
    return "".join(str(table >> number & 1) for number in range(1 << len(inputs)))


class _Parser:
    """Recursive descent; every value is the whole table as one integer. Negation binds closest, then ^, &, and |."""

    def __init__(self, function: str, inputs: Sequence[str]) -> None:
        self._function, self._inputs = function, inputs
        self._words = _TOKEN.findall(function)
        if "".join(self._words) != re.sub(r"\s", "", function):
            raise self._problem()
        self._all = (1 << (1 << len(inputs))) - 1

    def table(self) -> int:
        """Of the whole function."""
        value = self._either()
        if self._words:
            raise self._problem()
        return value

    def _problem(self) -> UserError:
        return UserError(f"the liberty's function {self._function!r} of {', '.join(self._inputs)} is not understood")

    def _next(self) -> str:
        return self._words[0] if self._words else ""

    def _either(self) -> int:
        value = self._both()
        while self._next() in ("|", "+"):
            self._words.pop(0)
            value |= self._both()
        return value

    def _both(self) -> int:
        value = self._differ()
        # Two factors side by side are a product, too
        while self._next() and self._next() not in ("|", "+", ")"):
            if self._next() in ("&", "*"):
                self._words.pop(0)
            value &= self._differ()
        return value

    def _differ(self) -> int:
        value = self._single()
        while self._next() == "^":
            self._words.pop(0)
            value ^= self._single()
        return value

    def _single(self) -> int:
        if not self._words:
            raise self._problem()
        word = self._words.pop(0)
        if word in ("!", "~"):
            return self._all ^ self._single()
        if word == "(":
            value = self._either()
            if self._next() != ")":
                raise self._problem()
            self._words.pop(0)
        elif word in ("0", "1"):
            value = self._all * int(word)
        elif word in self._inputs:
            place = self._inputs.index(word)
            value = sum(1 << number for number in range(1 << len(self._inputs)) if number >> place & 1)
        else:
            raise self._problem()
        while self._next() == "'":
            self._words.pop(0)
            value ^= self._all
        return value
