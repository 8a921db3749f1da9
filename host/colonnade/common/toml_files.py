"""Parses TOML of untrusted files, in a time that grows with their size alone."""

from __future__ import annotations

import re
import sys
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.input_files import check_values
from colonnade.common.limits import MAX_DEPTH

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

#: What may follow, by what is open: nothing, a text of four kinds, or a comment.
_NEXT = {
    "": re.compile(r'"""|\'\'\'|["\'#.=,\[\]{}\n]'),
    '"': re.compile(r'\\.|["\n]'),
    "'": re.compile(r"['\n]"),
    '"""': re.compile(r'\\.|"""(?!")', re.DOTALL),
    "'''": re.compile(r"'''(?!')"),
    "#": re.compile(r"\n"),
}


def parse_toml(data: bytes, what: str) -> dict[str, Any]:
    """Parse a TOML document.

    Raises:
        UserError: The document is not TOML in UTF-8, is nested too deeply, or has a text or number that is too long.
    """
    try:
        text = data.decode("utf-8-sig")
        # The parser's time for a dotted key grows with the square of its parts
        if _has_deep_key(text):
            raise RecursionError
        found: dict[str, Any] = tomllib.loads(text)
    except UnicodeDecodeError:
        raise UserError(f"{what} is not TOML: save it as UTF-8 text") from None
    except RecursionError:
        raise UserError(f"{what} is nested too deeply: {MAX_DEPTH} levels at most") from None
    except ValueError as error:  # invalid TOML, or too many digits
        raise UserError(f"{what} is not TOML: {error}") from None
    check_values(found, what)
    return found


def _has_deep_key(text: str) -> bool:
    """Whether a key has more dots than levels may be nested."""
    opened, dots, at = "", 0, 0
    while found := _NEXT[opened].search(text, at):
        token, at = found[0], found.end()
        if opened:
            opened = opened if token[0] == "\\" else ""
        elif token in _NEXT:
            opened = token
        else:
            dots = dots + 1 if token == "." else 0
            if dots >= MAX_DEPTH:
                return True
    return False
