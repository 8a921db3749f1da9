"""Finds liberty files and prunes them to the groups and cells that are used.

Pruning drops current-source models, noise, and power or timing. It also drops cells that ordinary logic must not be
mapped to, and saves Yosys most of its reading time.
"""

from __future__ import annotations

import gzip
import io
import os
import re
import zlib
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

from colonnade.common.downloads import fetched
from colonnade.common.errors import UserError, reason_of
from colonnade.common.input_files import exists, is_folder, read_input, require_regular
from colonnade.common.limits import MAX_LIBERTY_BYTES
from colonnade.common.published import LIBRARIES

#: Cells that ordinary logic must not use: scan, power domains, probes, delays.
AVOIDED = (
    *("*lpflow*", "*probe*", "*sdlclk*", "*sparecell*", "*dlygate*", "*dlymetal*", "*clkdly*"),
    *("*__sdf*", "*__sedf*", "*__edf*", "*__dfbb*", "SDF*"),
)

_DROPPED = re.compile(
    r"(?P<comment>/\*.*?\*/)|(?P<string>\"[^\"]*\")|"
    r"(?P<group>\b(?P<name>\w+)\s*\((?P<argument>[^(){}]*)\)\s*\{)|(?P<open>\{)|(?P<close>\})",
    re.DOTALL,
)
_ALWAYS_DROPPED = (
    r"output_current_\w+|receiver_capacitance\w*|ccs\w*|test_cell|normalized_driver_waveform|wire_load\w*|"
    r"hyperbolic_noise\w*|dc_current|min_pulse_width"
)
#: Groups to drop when a liberty is read for timing, and for power.
FOR_TIMING = re.compile(rf"{_ALWAYS_DROPPED}|internal_power|leakage_power|pg_pin")
FOR_POWER = re.compile(rf"{_ALWAYS_DROPPED}|timing")


def find_liberties(names: Sequence[str]) -> tuple[Path, ...]:
    """The liberty files of ``--liberty``, whose values are files, folders, or names of published libraries.

    A library is in the files and folders of the variable of its name, separated by spaces, else it is fetched.

    Raises:
        UserError: A file is missing, cannot be fetched, or a folder has no liberty files.
    """
    found: list[Path] = []
    for name in names:
        path, library = Path(name), LIBRARIES.get(name.lower())
        if library is not None and not exists(path):
            own = os.environ.get(name.upper(), "").split()
            found += find_liberties(own) if own else (fetched(file, f"a file of {name}") for file in library.files)
            continue
        if is_folder(path):
            try:
                inside = sorted(p for p in path.iterdir() if re.search(r"\.lib(\.gz)?$", p.name))
            except OSError as error:
                raise UserError(f"cannot search {path}: {reason_of(error)}") from None
            if not inside:
                raise UserError(f"{name} holds no .lib and no .lib.gz file: name another folder for --liberty")
            found += inside
        else:
            require_regular(
                path,
                "the liberty",
                f"no liberty {name}: name a .lib or .lib.gz file, a folder of them, or {' or '.join(LIBRARIES)}",
            )
            found.append(path)
    return tuple(found)


def library_text(path: Path) -> str:
    """The text of a liberty file, unpacked if it is a .gz file.

    Raises:
        UserError: The file cannot be read, or has no library.
    """
    data = read_input(path, "the liberty", MAX_LIBERTY_BYTES)
    if path.suffix == ".gz":
        try:
            with gzip.open(io.BytesIO(data)) as stream:
                data = stream.read(MAX_LIBERTY_BYTES + 1)
        except (OSError, EOFError, zlib.error) as error:
            raise UserError(f"{path} cannot be unpacked: {error}") from None
        if len(data) > MAX_LIBERTY_BYTES:
            raise UserError(f"{path} is too large: the limit is {MAX_LIBERTY_BYTES:,} bytes unpacked")
    text = data.decode("latin-1")
    if not re.search(r"\blibrary\s*\(", text):
        raise UserError(f"{path} is not a liberty file: it has no library group")
    return text


def pruned(path: Path, dropped: re.Pattern[str] = FOR_TIMING) -> str:
    """The text of a liberty file without comments, `AVOIDED` cells and groups that match `dropped`.

    Raises:
        UserError: The file is not a liberty file, or is truncated.
    """
    text = library_text(path)
    if text.rfind("/*") > text.rfind("*/"):
        raise UserError(f"{path} is truncated or not a liberty file: a comment does not end")
    parts: list[str] = []
    begin = depth = dropped_from = 0
    for token in _DROPPED.finditer(text):
        if token["group"] or token["open"]:
            depth += 1
            if token["group"] and not dropped_from and _is_dropped(token["name"], token["argument"], dropped):
                parts.append(text[begin : token.start()])
                dropped_from = depth
        elif token["close"]:
            if dropped_from == depth:
                begin, dropped_from = token.end(), 0
            depth -= 1
        elif token["comment"] and not dropped_from:
            parts.append(text[begin : token.start()])
            begin = token.end()
    parts.append(text[begin:])
    if depth != 0:
        raise UserError(f"{path} is truncated or not a liberty file: its braces do not match")
    # Wire load models are among the dropped groups
    text = re.sub(r"default_wire_load\w*\s*:[^;]*;", "", "".join(parts))
    return re.sub(r"\n\s*\n+", "\n", text)


def _is_dropped(group: str, argument: str, dropped: re.Pattern[str]) -> bool:
    name = argument.strip().strip('"')
    is_avoided = group == "cell" and any(fnmatch(name, pattern) for pattern in AVOIDED)
    return is_avoided or dropped.fullmatch(group) is not None
