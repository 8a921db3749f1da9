"""The table of mutations stays applicable: `tools/mutations` breaks each module that docs/verification.md lists."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[3]
TABLE: dict[str, dict[str, Any]] = tomllib.loads((ROOT / "src/test/mutations.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", TABLE)
def test_a_mutation_changes_one_place_and_names_a_spec(name: str) -> None:
    mutation = TABLE[name]
    assert mutation.keys() - {"test"} == {"file", "from", "to", "spec"}
    text = (ROOT / "src/main/scala/colonnade" / mutation["file"]).read_text(encoding="utf-8")
    assert text.count(mutation["from"]) == 1, mutation["from"]
    assert mutation["to"] != mutation["from"]
    spec = ROOT / "src/test/scala/colonnade" / (mutation["spec"].replace(".", "/") + ".scala")
    assert f"class {spec.stem} " in spec.read_text(encoding="utf-8")


def test_each_module_of_the_verification_page_has_a_mutation() -> None:
    page = (ROOT / "docs/verification.md").read_text(encoding="utf-8")
    rows = page.split("## Modules and their specs")[1].split("\n\n| of the host")[0].splitlines()
    cells = [row.split(" | ")[1] for row in rows if row.startswith("| ") and not row.startswith("| package")]
    modules = {module for cell in cells for module in re.findall(r"`(\w+)`", cell)}
    assert len(modules) > 70
    assert modules <= TABLE.keys(), modules - TABLE.keys()
