"""Reads untrusted input files: regular files of limited size, and JSON of limited depth and length."""

from __future__ import annotations

import codecs
import hashlib
import json
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colonnade.common import ledger
from colonnade.common.atomic_files import kind_of
from colonnade.common.errors import UserError, reason_of
from colonnade.common.limits import MAX_DEPTH, MAX_DIGITS, MAX_GROUPS, MAX_TEXT, MAX_TEXT_BYTES

#: The first bytes of what Git leaves in place of a large file.
_POINTER = b"version https://git-lfs.github.com/spec/"


def read_input(
    path: Path, what: str, maximum: int = MAX_TEXT_BYTES, missing: str | None = None, first: int | None = None
) -> bytes:
    """Read an input file.

    Args:
        path: a regular file, or a link to one.
        what: for messages, e.g. ``"the scene"``.
        maximum: largest size, bytes.
        missing: the error message for a missing file.
        first: only so many bytes are read; None: all.

    Raises:
        UserError: The file is missing, not regular, too large, unreadable, a pointer of Git LFS, or a declared output.
    """
    refused = require_regular(path, what, missing)
    try:
        # O_NONBLOCK: a pipe may have replaced the file since the check
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as stream:
            status = os.fstat(handle)
            if not stat.S_ISREG(status.st_mode):
                raise refused
            data = stream.read(first or maximum + 1) if status.st_size <= maximum else b""
    except OSError as error:
        raise UserError(f"cannot read {what} {path}: {reason_of(error)}") from None
    if status.st_size > maximum or len(data) > maximum:
        raise UserError(f"{what} {path} is too large: it may have {maximum:,} bytes")
    if data.startswith(_POINTER):
        raise UserError(f"{what} {path} is a pointer of Git LFS, not the file itself: get it by git lfs pull")
    ledger.add_input(path, status)
    return data


def require_regular(path: Path, what: str, missing: str | None = None) -> UserError:
    """Refuse a path that is not a regular file; returns that error for a later check of the opened file."""
    ledger.add_lookup(path)
    try:
        status = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        raise UserError(missing or f"{what} {path} does not exist") from None
    except OSError as error:
        raise UserError(f"cannot read {what} {path}: {reason_of(error)}") from None
    except ValueError:
        raise UserError(f"{what} {str(path)!r} does not exist: this is not a file name") from None
    refused = UserError(f"cannot read {what} {path}: it is {kind_of(status)}, name a file")
    if not stat.S_ISREG(status.st_mode):
        raise refused
    return refused


def exists(path: Path) -> bool:
    """Whether the path exists, as any type of file."""
    ledger.add_lookup(path)
    try:
        return os.path.lexists(path)
    except ValueError:
        return False


def is_folder(path: Path) -> bool:
    """Whether the path is a folder; False for an invalid name."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def is_file(path: Path) -> bool:
    """Whether the path is a regular file; False for an invalid name."""
    ledger.add_lookup(path)
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_json(path: Path, what: str, maximum: int = MAX_TEXT_BYTES, missing: str | None = None) -> Any:
    """The JSON in an input file; see `parse_json`."""
    return parse_json(read_input(path, what, maximum, missing), f"{what} {path}")


def text_of(data: bytes) -> str:
    """The text of a file: UTF-16 if it begins with a mark of it, else UTF-8, with a mark or without.

    Bytes that are not UTF-8, as of names in another encoding, stay apart as surrogates.
    """
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", "replace")
    return data.removeprefix(codecs.BOM_UTF8).decode("utf-8", "surrogateescape")


def parse_json(data: bytes | str, what: str) -> Any:
    """Parse a JSON document, whose strings may have `MAX_TEXT` characters.

    Raises:
        UserError: The document is not JSON in UTF-8, repeats a key, has a number that is too long or not finite, or is
            nested too deeply.
    """
    try:
        text = data.decode("utf-8-sig") if isinstance(data, bytes) else data
        if text.count("[") + text.count("{") > MAX_GROUPS:
            raise ValueError(f"it holds more than {MAX_GROUPS:,} lists and objects")
        value = json.loads(
            text,
            object_pairs_hook=_object,
            parse_int=_whole_number,
            parse_float=_real_number,
            parse_constant=_no_constant,
        )
    except UnicodeDecodeError as error:
        raise UserError(f"{what} is not JSON: it is not UTF-8 text ({error.reason})") from None
    except RecursionError:
        raise UserError(f"{what} is nested too deeply: {MAX_DEPTH} levels at most") from None
    except ValueError as error:
        raise UserError(f"{what} is not JSON: {error}") from None
    check_values(value, what)
    return value


def check_values(data: Any, what: str) -> None:
    """Refuse a parsed document with too deep nesting, or with too long strings or numbers."""
    level = [data]
    for _ in range(MAX_DEPTH + 1):
        below: list[Any] = []
        for value in level:
            if isinstance(value, Mapping):
                below += value.values()
            elif isinstance(value, list):
                below += value
            elif isinstance(value, str) and len(value) > MAX_TEXT:
                raise UserError(f"{what} holds a text of {len(value):,} characters: {MAX_TEXT:,} at most")
            elif isinstance(value, int) and abs(value) >= 10**MAX_DIGITS:
                raise UserError(f"{what} holds a number of more than {MAX_DIGITS} digits")
        if not below:
            return
        level = below
    raise UserError(f"{what} is nested too deeply: {MAX_DEPTH} levels at most")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"the key {key} occurs twice in an object")
        found[key] = value
    return found


def _whole_number(text: str) -> int:
    if len(text) > MAX_DIGITS:
        raise ValueError(f"a number has {len(text):,} digits, {MAX_DIGITS} at most")
    return int(text)


def _real_number(text: str) -> float:
    value = float(text)
    if value in (float("inf"), float("-inf")):
        raise ValueError(f"the number {text} is too large")
    return value


def _no_constant(text: str) -> float:
    raise ValueError(f"{text} is not a JSON number")


def sha256_of(file: Path) -> str:
    """The SHA-256 of a file's content, in hexadecimal digits; `OSError` if it cannot be read."""
    digest = hashlib.sha256()
    with file.open("rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()
