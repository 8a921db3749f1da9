"""What a configuration may be called: a preset, a file, or the paper's precision notation."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from colonnade.errors import UserError

#: The preset that a bare precision such as ``32b32s64d`` changes.
PRECISION_PRESET = "small"

_PRECISION = re.compile(r"\d+b\d+s\d+d")


@dataclass(frozen=True)
class ConfigurationSource:
    """A configuration as the generator takes it.

    Attributes:
        path: the JSON file it starts from.
        overrides: ``key.path=value`` changes, applied in order.
    """

    path: Path
    overrides: tuple[str, ...]


def find_configuration(name: str, overrides: Sequence[str], root: Path) -> ConfigurationSource:
    """Resolve the name of a configuration.

    Args:
        name: preset (``small``), path of a JSON file, or precision (``32b32s64d``: preset `small` with it).
        overrides: ``key.path=value`` strings of ``--set``.
        root: the checkout, whose ``configs`` folder holds the presets.
    """
    for override in overrides:
        key, equals, _ = override.partition("=")
        if not equals or not key.strip():
            raise UserError(f"--set {override} is not of the form key.path=value, e.g. --set array.rows=4")
    presets = root / "configs"
    if _PRECISION.fullmatch(name):
        return ConfigurationSource(presets / f"{PRECISION_PRESET}.json", (f"precision={name}", *overrides))
    if re.fullmatch(r"[\w-]+", name) and (presets / f"{name}.json").is_file():
        return ConfigurationSource(presets / f"{name}.json", tuple(overrides))
    path = Path(name)
    if path.is_file():
        return ConfigurationSource(path.resolve(), tuple(overrides))
    known = ", ".join(sorted(preset.stem for preset in presets.glob("*.json")))
    raise UserError(f"no configuration {name}: name a preset ({known}), a JSON file, or a precision such as 32b32s64d")
