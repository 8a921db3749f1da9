"""The syntax of liberty files: nested groups with simple and complex attributes."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from colonnade.common.errors import UserError

_TOKEN = re.compile(r"/\*.*?\*/|//[^\n]*|\\\n|\s+|(\"[^\"]*\"|[{}();:,]|[^\s{}();:,\"]+)", re.DOTALL)


@contextlib.contextmanager
def parsing(path: Path) -> Iterator[None]:
    """Turn errors in a liberty file, such as missing or non-numeric values, into a `UserError`."""
    try:
        yield
    except (ValueError, KeyError, IndexError, TypeError, StopIteration, ZeroDivisionError, RuntimeError) as error:
        reason = f"{type(error).__name__}: {error}".rstrip(": ")
        raise UserError(f"{path.name} is not a usable liberty file: {reason}") from None


@dataclass
class Group:
    """A group of a liberty file.

    Attributes:
        name: Name.
        arguments: Arguments in parentheses.
        values: Words of each simple or complex attribute, by name.
        groups: Inner groups.
    """

    name: str
    arguments: list[str]
    values: dict[str, list[str]] = field(default_factory=dict)
    groups: list[Group] = field(default_factory=list)

    def of(self, *names: str) -> Iterator[Group]:
        """The inner groups with one of these names."""
        return (group for group in self.groups if group.name in names)

    def text(self, name: str, default: str = "") -> str:
        """The value of a simple attribute, without quotes."""
        return self.values.get(name, [default])[0].strip('"').strip()


def tokens(text: str) -> Iterator[str]:
    """The tokens of a liberty file, without comments."""
    return (token[1] for token in _TOKEN.finditer(text) if token[1] is not None)


def groups(tokens: Iterator[str]) -> Iterator[Group]:
    """Parse the top-level groups."""
    stack = [Group("", [])]
    words: list[str] = []
    for token in tokens:
        if token == "{":
            stack.append(Group(words[0], [word for word in words[1:] if word not in "(),"]))
            stack[-2].groups.append(stack[-1])
            words = []
        elif token in ";}":
            if len(words) > 1:
                stack[-1].values[words[0]] = [word for word in words[1:] if word not in "(),:"]
            words = []
            if token == "}":
                closed = stack.pop()
                if len(stack) == 1:
                    yield closed
        elif token == ":" or token == "(" or not words or words[-1] in ("(", ",", ":") or token in "),":
            words.append(token)
        elif len(words) > 2 and words[-1] == ")":
            # A complex attribute without a semicolon
            stack[-1].values[words[0]] = [word for word in words[1:] if word not in "(),"]
            words = [token]
        elif len(words) > 2 and words[1] == ":":
            # A simple attribute without a semicolon, unless an expression continues
            if _is_operator(words[-1]) or _is_operator(token):
                words.append(token)
            else:
                stack[-1].values[words[0]] = words[2:]
                words = [token]
        else:
            words.append(token)


def _is_operator(word: str) -> bool:
    return word in "+-*/"
