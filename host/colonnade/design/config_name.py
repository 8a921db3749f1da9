"""Resolves configuration names: a preset, a JSON file, or the paper's precision notation."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from colonnade.common.errors import UserError
from colonnade.common.input_files import is_file, parse_json, read_json
from colonnade.common.limits import MAX_DIGITS, MAX_TEXT

#: Changes to a configuration, applied in order.
Overrides = Annotated[Sequence[str], "a list of texts of the form key=value"]

#: The preset that a precision such as ``32b32s64d`` modifies.
PRECISION_PRESET = "small"

_PRECISION = re.compile(r"\d+b\d+s\d+d", re.ASCII)
#: Digits of each number in a precision, at most.
_PRECISION_DIGITS = 6


@dataclass(frozen=True)
class ConfigurationSource:
    """A configuration as the generator's input.

    Attributes:
        path: the base JSON file.
        overrides: ``key.path=value`` changes, applied in order.
    """

    path: Path
    overrides: tuple[str, ...]


def find_configuration(name: str, overrides: Overrides, root: Path) -> ConfigurationSource:
    """Resolve the name of a configuration.

    Args:
        name: a preset (``small``), a JSON file, or a precision (``32b32s64d``: preset `small` with this precision and
            with triangle tests as wide as its MAC operands).
        overrides: ``key.path=value`` strings of ``--set``.
        root: the checkout, whose ``configs`` folder contains the presets.

    Raises:
        UserError: The name or an override is invalid.
    """
    for override in overrides:
        key, equals, value = override.partition("=")
        if not equals or not key.strip():
            raise UserError(f"--set {override} is not of the form key.path=value, e.g. --set array.rows=4")
        _check_value(override, value)
    presets = root / "configs"
    if _PRECISION.fullmatch(name):
        if max(map(len, re.findall(r"\d+", name))) > _PRECISION_DIGITS:
            raise UserError(f"the precision {name} has a number of more than {_PRECISION_DIGITS} digits")
        precision = (f"precision={name}", "geometry.triangleBits=null")
        return ConfigurationSource(presets / f"{PRECISION_PRESET}.json", (*precision, *overrides))
    if re.fullmatch(r"[\w-]+", name) and is_file(presets / f"{name}.json"):
        return ConfigurationSource(presets / f"{name}.json", tuple(overrides))
    path = Path(name)
    known = ", ".join(sorted(preset.stem for preset in presets.glob("*.json")))
    missing = f"no configuration {name}: name a preset ({known}), a JSON file, or a precision such as 32b32s64d"
    # Refuse invalid JSON here at once: the generator, which reads the file again, takes seconds
    read_json(path, "the configuration", missing=missing)
    return ConfigurationSource(path.resolve(), tuple(overrides))


def _check_value(override: str, value: str) -> None:
    """Refuse values that are too long, too deeply nested, or repeat a key."""
    if len(override) > MAX_TEXT:
        raise UserError(f"--set {override} has {len(override):,} characters: {MAX_TEXT:,} at most")
    if value.lstrip()[:1] in ("{", "["):
        parse_json(value, f"--set {override}: the value")
    elif len(value) > MAX_DIGITS and re.fullmatch(r"[-+\d.eE]+", value):
        raise UserError(f"--set {override} has a number of more than {MAX_DIGITS} digits")
