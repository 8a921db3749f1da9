"""The table of mutations stays applicable, and has one of each module of the hardware."""

from __future__ import annotations

import runpy
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
    *packages, spec = mutation["spec"].split(".")
    files = ROOT.joinpath("src/test/scala/colonnade", *packages).glob("*.scala")
    assert any(f"class {spec} " in file.read_text(encoding="utf-8") for file in files)


@pytest.fixture
def tool(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    return runpy.run_path(str(ROOT / "tools/mutations"))


def test_the_page_lists_the_mutations_of_all_modules(tool: dict[str, Any]) -> None:
    page = tool["page"](TABLE)
    assert page.count("\n|") == len(TABLE) + 2
    assert "|`bus`|`RowBuffer`|`RowBufferSpec`|`Mux(isTaken, tagOf(pixel), tag)` → `tag`|\n" in page


def test_a_module_without_a_mutation_is_named(tool: dict[str, Any]) -> None:
    others = {name: mutation for name, mutation in TABLE.items() if mutation["file"] != "shading/SurfaceStage.scala"}
    with pytest.raises(SystemExit, match="SurfaceStage"):
        tool["page"](others)


def test_a_module_is_concrete_and_may_extend_an_abstract_one(tool: dict[str, Any]) -> None:
    declared = {name for inside in tool["modules"]().values() for name in inside.values()}
    assert {"ShadingPipeline", "TraversalStack", "TexelReader"} <= declared
    assert not {"Shader", "RaySetup", "ObjectAlbedo", "LitAssemblerIO"} & declared


def test_the_curve_puts_suites_with_most_faults_a_second_first(tool: dict[str, Any]) -> None:
    table = {str(n): {"spec": spec} for n, spec in enumerate(("FastSpec", "SlowSpec", "SlowSpec", "FastSpec"))}
    rows = tool["curve"](table, {"SlowSpec": 30.0, "IdleSpec": 60.0, "FastSpec": 10.0}).splitlines()
    assert [row.split() for row in rows[1:]] == [
        ["2", "10.0", "50.0%", "10.0%", "FastSpec"],
        ["2", "30.0", "100.0%", "40.0%", "SlowSpec"],
        ["0", "60.0", "100.0%", "100.0%", "IdleSpec"],
    ]


def test_kills_and_seconds_are_summed_by_suite(tool: dict[str, Any]) -> None:
    rows = tool["kills"]([("B", True, 2.0), ("A", True, 1.5), ("B", False, 4.0)]).splitlines()
    assert [row.split() for row in rows[1:]] == [["1", "1", "1.5", "A"], ["1", "2", "6.0", "B"]]


def test_a_cover_takes_the_tests_with_most_new_random_faults_a_second(tool: dict[str, Any]) -> None:
    tests = {"slow": (4.0, False), "fast": (1.0, False), "idle": (1.0, False), "late": (4.0, True)}
    found = {"slow": "abcd", "fast": "ab", "late": "e"}
    lines: list[dict[str, Any]] = [
        {"suite": "S", "test": name, "seconds": seconds, "matrix": matrix} for name, (seconds, matrix) in tests.items()
    ]
    lines += [
        {"suite": "S", "test": test, "mutant": f"X.scala {name}", "killed": name in found.get(test, "")}
        for test in tests
        for name in "abcdef"
    ]
    rows = tool["cover"]([*lines, {"end": "S"}]).splitlines()
    assert [row.split()[-1] for row in rows[1:5]] == ["fast", "slow", "late", "idle"]
    assert rows[2].split() == ["6", "4", "4.0", "66.7%", "50.0%", "slow"]
    assert "6 faults of 1 files: 4 by tests of `make test`, 5 with those of" in rows[5]
    assert rows[6:] == ["not found: X.scala f"]
