"""The table of keys in docs/architecture.md has every key of a configuration, with a meaning, values and a default."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from colonnade.common.errors import UserError
from colonnade.design.generator import manifest_for
from colonnade.design.toolchain import project_root

#: Keys with values that are no list or range: the meaning, or a table of their own, has them.
OTHERS = {"textureBytes", "cache", "lines", "sharedLines", "sharedWays", "physicalAttributeMemory", "encoding"} | {
    "mapBytes",
    "planeBytes",
    "queries",
}


@pytest.fixture(scope="module")
def rows() -> dict[str, list[str]]:
    """Meaning, values and default of each key in the page that the tool prints."""
    page = subprocess.run([project_root() / "tools/configuration-keys"], capture_output=True, text=True, check=True)
    table = page.stdout.split("<!-- keys, by tools/regenerate -->")[1].split("<!-- end of keys -->")[0]
    found = [line.strip("|").split("|") for line in table.strip().splitlines()[2:]]
    return {row[0].strip("`"): row[1:] for row in found}


def keys_of(config: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    for key, value in config.items():
        if isinstance(value, Mapping):
            yield from keys_of(value, f"{prefix}{key}.")
        elif (prefix, key) != ("", "version"):
            yield f"{prefix}{key}"


def test_every_key_is_in_the_table(rows: dict[str, list[str]]) -> None:
    config = dict(manifest_for("edge").manifest.config)
    config["precision"] = dict.fromkeys(("mac", "sqrt", "div"))
    config["queries"] = manifest_for("traversal").manifest.config["queries"]
    assert set(rows) == {*keys_of(config), "columnBvhMemory.cache", "physicalAttributeMemory", "queries"}
    assert all(meaning and default for meaning, _, default in rows.values())
    assert {key.split(".")[-1] for key, row in rows.items() if not row[1]} == OTHERS


def test_values_are_those_that_the_generator_allows(rows: dict[str, list[str]]) -> None:
    for key in ("array.contexts", "units.pathContexts", "units.rayInterval", "frame.tileSize", "frame.lights"):
        values = rows[key][1]
        with pytest.raises(UserError, match=re.escape(values.replace(" … ", " to "))):
            manifest_for("small", (f"{key}=9999",))
